"""Flying many missions with one policy, in one process or several; results do not depend on which."""

from collections.abc import Callable
from concurrent.futures import as_completed
from functools import partial
from itertools import chain
from pathlib import Path

from ..base.arguments import path_of, seeds_of, workers_of
from ..base.files import target_of
from ..base.kernels import ensure_compiled
from ..base.processes import pool_of
from ..mission.batch import MissionBatch
from ..mission.score import Score
from ..mission.trace import load_head, make_traces, save_trace
from ..policies import conditions_of, label_of, prepare
from ..radio import DEFAULT_LINKS
from ..scenarios import Scenario, load_scenario

DEFAULTS = (DEFAULT_LINKS, "matched", "nominal")
CHUNK = 16  # missions that one call flies side by side: memory and progress stay fine-grained


def trace_path(folder, scenario: Scenario, policy: str, links: str, limitation: str, seed: int) -> Path:
    """Where the trace of one mission goes; defaults stay out of its name."""
    conditions = [word for word in (links, scenario.radio.profile, limitation) if word not in DEFAULTS]
    return Path(folder) / ("-".join([scenario.name, label_of(policy), *conditions, str(seed)]) + ".npz")


def check_traces(folder, scenario: Scenario, policy: str, links: str, limitation: str, seeds) -> None:
    """Traces may be replaced by others of the same missions, and by nothing else.

    Raises:
      ValueError: another mission, or no trace at all, lies where one is to go; the message names it.
    """
    flown_in, flown_by = conditions_of(policy, scenario, links)
    ours = {"scenario": flown_in, "policy": label_of(policy), "links": flown_by, "limitation": limitation}
    for seed in seeds:
        path = trace_path(folder, scenario, policy, links, limitation, seed)
        if target_of(path).exists():
            held = load_head(path)
            other = [name for name, value in {**ours, "seed": seed}.items() if held[name] != value]
            if other:
                raise ValueError(f"{path} is of another {' and '.join(other)}: choose another folder, or remove it")


def fly(
    scenario: Scenario, policy: str, seeds, links=DEFAULT_LINKS, limitation="nominal", out=None, workers=1,
    advance: Callable[[float], None] = lambda missions: None,
) -> list[Score]:  # fmt: skip
    """Fly one mission a seed.

    Args:
      out: folder that gets a trace a mission, or None; another mission's trace there is refused before anything flies.
      workers: processes; 1 flies in this one.
      advance: told how much has just been flown, now and then: parts of missions in this process, whole ones in several.

    Returns:
      One score a seed, in the order of the seeds.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """
    scenario, seeds = load_scenario(scenario), seeds_of(seeds)
    if out is not None:
        out = path_of("out", out)
        check_traces(out, scenario, policy, links, limitation, seeds)
    jobs = [(scenario, policy, chunk, links, limitation, out) for chunk in chunks_of(seeds)]
    return _spread_missions(_fly_chunk, jobs, workers, advance)


def fly_recorded(
    look: Callable, scenario: Scenario, policy: str, seeds, links=DEFAULT_LINKS, limitation="nominal", workers=1,
    advance: Callable[[float], None] = lambda missions: None,
) -> list:  # fmt: skip
    """`look(trace)` of one recorded mission a seed, in the order of the seeds; traces are not kept."""
    jobs = [(look, scenario, policy, chunk, links, limitation) for chunk in chunks_of(seeds)]
    return _spread_missions(_look_chunk, jobs, workers, advance)


def _spread_missions(work, jobs, workers, advance) -> list:
    """What `work` answers, mission by mission; a long mission in this process says how far it is."""
    if is_alone(jobs, workers):
        chunks = spread(partial(work, advance=advance), jobs)
    else:
        chunks = spread(work, jobs, workers, lambda answers: advance(len(answers)))
    return list(chain.from_iterable(chunks))


def is_alone(jobs: list[tuple], workers: int) -> bool:
    """Whether this process does all the work."""
    return workers_of(workers) == 1 or len(jobs) <= 1


def chunks_of(seeds) -> list[list[int]]:
    """Seeds that one call flies together."""
    seeds = seeds_of(seeds)
    return [seeds[i : i + CHUNK] for i in range(0, len(seeds), CHUNK)]


def spread(work: Callable, jobs: list[tuple], workers=1, done: Callable = lambda result: None) -> list:
    """`work(*job)` of every job, in this process or in several; results in the order of the jobs.

    `done` is told each result as soon as it is there.
    """
    if is_alone(jobs, workers):
        results = []
        for job in jobs:
            results.append(work(*job))
            done(results[-1])
        return results
    ensure_compiled()
    with pool_of(workers) as pool:
        futures = [pool.submit(work, *job) for job in jobs]
        for future in as_completed(futures):
            done(future.result())
    return [future.result() for future in futures]


def fly_to_end(
    policy, scenario, seeds, links=DEFAULT_LINKS, limitation="nominal", record=False,
    advance: Callable[[float], None] = lambda missions: None,
) -> MissionBatch:  # fmt: skip
    """The batch of these missions when all are over; `advance` is told each hundredth of them that is flown."""
    batch, act = prepare(policy, scenario, seeds, links, limitation, record)
    observations, told, all_of_them = batch.observations, 0.0, len(batch.seeds)
    while not batch.over.all():
        observations = batch.step(act(observations))
        flown = batch.state.missions["now"].sum() / batch.scenario.time_limit
        if flown - told >= 0.01 * all_of_them:
            advance(flown - told)
            told = flown
    advance(all_of_them - told)
    return batch


def _fly_chunk(scenario, policy, seeds, links, limitation, out, advance=lambda missions: None) -> list[Score]:
    batch = fly_to_end(policy, scenario, seeds, links, limitation, out is not None, advance)
    if out is not None:
        for trace in make_traces(batch, label_of(policy)):
            save_trace(trace, trace_path(out, scenario, policy, links, limitation, trace.seed))
    return batch.scores()


def _look_chunk(look, scenario, policy, seeds, links, limitation, advance=lambda missions: None) -> list:
    batch = fly_to_end(policy, scenario, seeds, links, limitation, True, advance)
    return [look(trace) for trace in make_traces(batch, label_of(policy))]
