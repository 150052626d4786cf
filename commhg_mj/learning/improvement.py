"""Policy improvement by simulated alternatives: gather points, then learn what each alternative was worth beside the others.

Rollout classification policy iteration (Lagoudakis and Parr 2003), by regression. A run is a folder, and goes on to the same bits
after any interruption: each block of points is a file, and the fit begins anew.
"""

import time
from collections.abc import Iterator

import numpy as np
import torch

from ..base.arguments import instance, path_of
from .distributed import ALONE, ProcessGroup
from .fitting import EPOCHS, Fit
from .points import Gatherer, join_points, load_points, save_points
from .registry import make_method
from .train import TRAINING_SEEDS, WEIGHTS, Before, Plan, Run, begin_with
from .validation import Validation
from .weights import load_weights, save_weights

POINTS, FIT = "points", 1
GATHERING = 0.85  # share of the seconds of CPU that may be spent; the fit needs the rest


class Improvement(Run):
    """One run of a plan that learns by rollouts; made anew, it goes on where it stood.

    >>> for row in Improvement(plan, "runs/x").run():
    ...     print(row["points"])

    Args:
      group: of `plan.workers` processes, each with an Improvement of its own; the points do not depend on how many.
    """

    def __init__(self, plan: Plan, folder, group: ProcessGroup = ALONE):
        torch.set_num_threads(1)
        self.plan, self.folder, self.group = instance("plan", plan, Plan), path_of("folder", folder), group
        torch.manual_seed(plan.seed)
        self.method = make_method(plan.method, plan.plans)
        self.before = begin_with(self.method, plan.init) if plan.init else Before()
        self.validation = Validation(plan.scenario, plan.links, plan.limitation)
        self.n_blocks = -(-plan.missions // plan.side_by_side)
        self.cpu_seconds, self.updates, self.missions, self.decisions, self.written = 0.0, 0, 0, 0, None

    @property
    def is_done(self) -> bool:
        """Its weights are fitted to the points of all its missions."""
        path = self.folder / WEIGHTS
        return path.exists() and load_weights(path)[1].get("missions") == self.n_blocks * self.plan.side_by_side

    def run(self, cpu_seconds: float = float("inf")) -> Iterator[dict]:
        """What happened in each block and in each epoch of the fit, until all is done or has cost so much."""
        if self.is_done:
            return
        (self.folder / POINTS).mkdir(parents=True, exist_ok=True)
        first = self.group.rank
        while self.updates < self.n_blocks and self.cpu_seconds < GATHERING * (cpu_seconds - self.before.cpu_seconds):
            row = self._gather(self.updates + first)
            if self.group.is_first:
                self.log(row)
            yield row
        if self.group.is_first:
            yield from self._fit()
        self.group.least(0)  # nobody leaves before the weights are written

    def _gather(self, block):
        """Every process gathers a block, or finds it gathered."""
        facts = {"cpu_seconds": 0.0, "points": 0, "twcr": 0.0}
        if block < self.n_blocks:
            path = self._path(block)
            facts = load_points(path)[1] if path.exists() else self._write(block, path)
        blocks = min(self.group.size, self.n_blocks - self.updates)
        seconds, points, twcr = self.group.total(*(facts[name] for name in ("cpu_seconds", "points", "twcr")))
        self.updates, self.cpu_seconds = self.updates + blocks, self.cpu_seconds + seconds
        self.missions, self.decisions = self.updates * self.plan.side_by_side, self.decisions + int(points)
        return self._row(rate=points / seconds, twcr=twcr / blocks)

    def _write(self, block, path):
        start, plan = time.process_time(), self.plan
        first = (1 + plan.seed) * TRAINING_SEEDS + block * plan.side_by_side
        gatherer = Gatherer(plan, self.method.wants, first, np.random.default_rng([plan.seed, block]))
        points = gatherer.gather()
        facts = {"points": int(points.n_judged), "twcr": float(np.mean([score.twcr for score in gatherer.batch.scores()]))}
        facts["cpu_seconds"] = time.process_time() - start
        save_points(points, path, facts)
        return facts

    def _path(self, block):
        return self.folder / POINTS / f"{block:05d}.npz"

    def _fit(self):
        start, before = time.process_time(), self.cpu_seconds
        points = join_points([load_points(self._path(block))[0] for block in range(self.updates)])
        for epoch, losses in enumerate(Fit(self.method, points, np.random.default_rng([self.plan.seed, FIT])).run()):
            self.updates, self.cpu_seconds = self.updates + 1, before + time.process_time() - start
            is_last = epoch == EPOCHS - 1
            row = self._row(**losses, validation=self.validation.score(self.method) if is_last else float("nan"))
            self.log(row)
            if is_last:
                save_weights(self.method.eval(), self.folder / WEIGHTS, self.facts())
            yield row

    def _row(self, **known):
        unknown = dict.fromkeys(("rate", "twcr", "task_loss", "pick_loss", "imitation", "validation"), float("nan"))
        counts = {"update": self.updates, "missions": self.missions, "points": self.decisions, "cpu_seconds": self.cpu_seconds}
        return counts | unknown | known
