"""Training runs side by side: how they learned, and how their weights fly beside those that only imitated Greedy."""

import csv
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..base.charts import new_figure, save_figure, styled
from ..flights.statistics import Interval, mean_interval
from ..learning.run_log import LOG
from ..learning.train import CLONED, WEIGHTS
from ..learning.weights import load_weights
from ..scenarios import Scenario, from_json
from .evaluation import evaluate

REFERENCE = "greedy+no-query"


class Learned(NamedTuple):
    """One run."""

    method: str
    minutes: np.ndarray  # [updates] of CPU
    training: np.ndarray  # [updates] mean TWCR of the last training missions
    changes: float  # share of decisions, in the last update, that left a task which could be kept
    missions: int
    cloned: Interval  # TWCR on held-out missions after imitation
    final: Interval  # and at the end
    gain: Interval  # paired: what it learned beyond imitation
    margin: Interval  # paired: above the reference


class Study(NamedTuple):
    """Runs on one scenario under one training's conditions."""

    scenario: Scenario
    links: str
    limitation: str
    reference: Interval
    runs: list[Learned]


def study_runs(folders, n_missions: int, workers: int, advance) -> Study:
    """Fly each run's weights, and those that it had after imitation, on the same held-out missions.

    Raises:
      ValueError: a folder holds no such run, or runs were trained under different conditions; the message names it.
    """
    methods, plans = zip(*map(_read_weights, folders))
    for folder, plan in zip(folders, plans):
        if plan != plans[0]:
            raise ValueError(f"{folder} was trained under other conditions than {folders[0]}")
    scenario, links, limitation = from_json(plans[0][0]), *plans[0][1:]
    paths = [str(Path(folder, name)) for folder in folders for name in (CLONED, WEIGHTS)]
    flights = evaluate(scenario, list(dict.fromkeys([REFERENCE, *paths])), n_missions, links, limitation, workers, advance)
    twcr = {policy: np.array([score.twcr for score, _ in each]) for policy, each in flights.items()}
    runs = []
    for folder, method in zip(folders, methods):
        cloned, final = (twcr[str(Path(folder, name))] for name in (CLONED, WEIGHTS))
        minutes, training, changes, missions = _read_log(folder)
        runs.append(Learned(
            method, minutes, training, changes[-1], int(missions[-1]),
            *map(mean_interval, (cloned, final, final - cloned, final - twcr[REFERENCE])),
        ))  # fmt: skip
    return Study(scenario, links, limitation, mean_interval(twcr[REFERENCE]), runs)


def _read_weights(folder) -> tuple[str, tuple[str, str, str]]:
    """(method, what it was trained under: scenario as text, links, limitation) of a run that has both files of weights."""
    _, (method, facts) = (load_weights(Path(folder, name)) for name in (CLONED, WEIGHTS))
    plan = facts["plan"]
    return method.name, (json.dumps(plan["scenario"]), plan["links"], plan["limitation"])


def _read_log(folder) -> list[np.ndarray]:
    with open(Path(folder, LOG), newline="") as file:
        rows = list(csv.DictReader(file))
    columns = [np.array([float(row[name]) for row in rows]) for name in ("cpu_seconds", "twcr", "changes", "missions")]
    return [columns[0] / 60.0, *columns[1:]]


@styled
def draw_curves(study: Study, out) -> None:
    """Training TWCR against CPU-minutes, a line a run, the reference on held-out missions across.

    Raises:
      ValueError: `out` cannot be written.
    """
    figure, axes = new_figure(8.0, 4.5)
    for run in sorted(study.runs, key=lambda run: -run.final.mean):
        axes.plot(run.minutes, run.training, linewidth=1.3, label=f"{run.method}  {run.final.mean:.3f}")
    level = study.reference.mean
    axes.axhline(level, color="black", linestyle="--", linewidth=1.0, label=f"{REFERENCE}  {level:.3f}")
    axes.set_xlabel("CPU-minutes of training")
    axes.set_ylabel("TWCR, mean of the last 100 training missions")
    axes.set_title(f"{study.scenario.name}, {study.links} links, {study.limitation} limitation; one seed a method", loc="left")
    axes.grid(alpha=0.3)
    axes.legend(title="at the end, held-out missions", fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save_figure(figure, out)
