"""commhg-three: CommHG with the three relations that the paper names. Operators' records reach the query head alone."""

from ..registry import method
from .commhg import CommHG


@method("commhg-three")
class CommHGThree(CommHG):
    """The paper's three relations."""

    relations = ("tasks", "peers", "reports")
    about = CommHG.about._replace(
        relations="task, peer to robot; report to operator", inferred="widths that the paper leaves open"
    )
