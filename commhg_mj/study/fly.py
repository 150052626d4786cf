"""Flying many missions with one policy, in one process or several; results do not depend on which."""

import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from ..mission.score import Score
from ..mission.trace import make_traces, save_trace
from ..policies import POLICIES, ensure_compiled, prepare
from ..scenarios import Scenario

CHUNK = 16  # missions that one call flies side by side: memory and progress stay fine-grained


def trace_path(folder, scenario: Scenario, policy: str, links: str, limitation: str, seed: int) -> Path:
    """Where the trace of one mission goes; defaults stay out of its name."""
    conditions = [word for word in (links, limitation) if word not in ("abstract", "nominal")]
    return Path(folder) / ("-".join([scenario.name, policy, *conditions, str(seed)]) + ".npz")


def fly(
    scenario: Scenario, policy: str, seeds, links="abstract", limitation="nominal", out=None, workers=1,
    advance: Callable[[int], None] = lambda missions: None,
) -> list[Score]:  # fmt: skip
    """Fly one mission a seed.

    Args:
      out: folder that gets a trace a mission, or None.
      workers: processes; 1 flies in this one.
      advance: told how many missions have just ended, now and then.

    Returns:
      One score a seed, in the order of the seeds.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """
    seeds = list(seeds)
    chunks = [seeds[i : i + CHUNK] for i in range(0, len(seeds), CHUNK)]
    jobs = [(scenario, policy, chunk, links, limitation, out) for chunk in chunks]
    if workers == 1 or len(chunks) == 1:
        results = []
        for job in jobs:
            results.append(_fly_chunk(*job))
            advance(len(job[2]))
        return [score for chunk in results for score in chunk]
    ensure_compiled(POLICIES.values())
    # An interrupt is this process's to handle; the others finish their chunk.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_IGN))
    try:
        futures = [pool.submit(_fly_chunk, *job) for job in jobs]
        for future in as_completed(futures):
            advance(len(future.result()))
        return [score for future in futures for score in future.result()]
    finally:
        pool.shutdown(cancel_futures=True)


def _fly_chunk(scenario, policy, seeds, links, limitation, out) -> list[Score]:
    batch, act = prepare(policy, scenario, seeds, links, limitation, record=out is not None)
    observations = batch.observations
    while not batch.over.all():
        observations = batch.step(act(observations))
    if out is not None:
        for trace in make_traces(batch, policy):
            save_trace(trace, trace_path(out, scenario, policy, links, limitation, trace.seed))
    return batch.scores()
