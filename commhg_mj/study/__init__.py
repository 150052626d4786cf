"""Experiments over many missions: evaluation, calibration, model cards, the comparison of the link models."""
