"""Which missions are whose: what is tuned or trained on some is never scored on them.

Training flies seeds from a million on (learning/train.py), validation its own.
"""

CALIBRATION = 10_000  # first seed of the missions that the scenarios' defaults are calibrated on
FIT = 20_000  # of those that the abstract model's decay lengths are fitted to
HELD_OUT = 30_000  # of those that policies are scored on
