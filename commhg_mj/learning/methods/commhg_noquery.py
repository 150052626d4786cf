"""commhg-noquery: CommHG trained without its query head (paper, ablation NoQuery).

Nobody asks, so no reply comes: neither resource reports nor the tips that travel with them. The relation of operators to robots
would never hold a record, and is left out.
"""

from ..registry import method
from .commhg import CommHG


@method("commhg-noquery")
class NoQuery(CommHG):
    """No query head."""

    relations, asks = ("tasks", "peers", "reports"), False
    about = CommHG.about._replace(
        reads="as commhg; it never hears of operators",
        relations="task, peer to robot; report to operator",
        heads="broadcast, request",
        inferred="it loses tips, too, and the operator relation, which would never hold a record",
    )
