"""The first start on a machine compiles every kernel; later starts load them from disk."""

import sys
import time

from ..kernels import COMPILED
from ..mission.batch import MissionBatch


def ensure_compiled(policies) -> None:
    """Compile what is not compiled yet, and say so while it runs (on standard error)."""
    if COMPILED.exists():
        return
    print("compiling kernels, once for this version (about half a minute) ...", end=" ", file=sys.stderr, flush=True)
    start = time.perf_counter()
    batch = MissionBatch("small", seeds=[0], record=True)
    for info in policies:
        policy = info.make(batch)
        observations = batch.reset()
        for _ in range(20):
            observations = batch.step(policy(observations))
    COMPILED.touch()
    print(f"done in {time.perf_counter() - start:.0f} s", file=sys.stderr)
