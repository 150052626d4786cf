"""commhg-nograph: CommHG without messages (paper, ablation NoGraph): the same updates, of a node by itself.

Heads keep their own inputs: a task's features with the robot, an operator's record, a report.
"""

from ..registry import method
from .commhg import CommHG


@method("commhg-nograph")
class NoGraph(CommHG):
    """No messages."""

    relations = ()
    about = CommHG.about._replace(
        reads="own state; each head the record that it scores",
        relations="none",
        inferred="pair features stay with the heads; peers enter as claims alone",
    )
