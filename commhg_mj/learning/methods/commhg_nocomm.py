"""commhg-nocomm: CommHG on a fixed topology (paper, ablation NoComm), and a blinder reading of it that is ours.

Messages come from every peer, report and operator at every decision; who was never heard of is a row of zeros that says so.
Physics, access, masks and ages stay. `nocomm-blind` lacks ages and the flags of what is known on its edges, too.
"""

from ..graphs import Wants
from ..registry import method
from .commhg import CommHG


@method("commhg-nocomm")
class NoComm(CommHG):
    """A fixed topology instead of what communication delivered."""

    wants = Wants(every_record=True)
    about = CommHG.about._replace(
        reads="as commhg, and rows of zeros for who was never heard of",
        inferred="what an unheard row holds; ages and flags stay",
    )


@method("nocomm-blind")
class NoCommBlind(NoComm):
    """NoComm whose edges say neither age nor whether anything is known."""

    leaves_out = ("known", "age")
    about = NoComm.about._replace(reads="as commhg-nocomm, without ages and flags of knowledge", inferred="the whole variant")
