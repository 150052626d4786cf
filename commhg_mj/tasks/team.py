"""Missions as every task interface sees them: actions in, padded tables and masks out, over one `MissionBatch`."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded

from ..base.arguments import check_seed, flag, said, whole
from ..base.kernels import kernel
from ..mission.batch import LONGEST_STEP, MissionBatch
from ..mission.decide import Decisions
from ..mission.score import score_mission
from ..radio.link_models import DEFAULT_LINKS, radio_rules
from ..scenarios import Scenario, load_scenario
from .choices import Choices, close_choices, open_choices, read_actions
from .tables import fill_tables, new_tables

DRAWN_SEEDS = 2**31  # unseeded episodes have seeds below


@kernel
def show(seen, tables, mask, due, starts):
    """Bring tables and masks up to date with the observations of everybody who is due."""
    n_robots = tables.robots.shape[1]
    close_choices(mask, due, starts, n_robots)
    open_choices(seen, mask, due, starts, n_robots)
    fill_tables(seen, tables)


class Team:
    """Teams in missions of one scenario, side by side.

    Args:
      scenario: name, TOML file, `Scenario` or its table.
      links: a link model's name.
      limitation: "nominal", "low" or "high".
      period: seconds of every step, whoever falls due meanwhile; 0: to the next decision epoch of anybody.
      seeds: the missions that unseeded episodes are drawn from, as `range(1000)`, or as JSON has it
        `{"range": [0, 1000]}`; None: all.
      record: keep what a trace needs.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """

    def __init__(self, scenario, links=DEFAULT_LINKS, limitation="nominal", period=0, seeds=None, record=False):
        self.scenario: Scenario = load_scenario(scenario)
        radio_rules(self.scenario, links, limitation)
        self.period, self.record = whole("period", period, 0, LONGEST_STEP), flag("record", record)
        seeds = read_range(seeds)
        check_seeds(seeds)
        self.links, self.limitation, self.seeds = links, limitation, seeds
        self.choices = Choices(self.scenario)
        self._batch: MissionBatch | None = None

    def draw_seed(self, rng) -> int:
        """The seed of the next unseeded episode, from a numpy Generator."""
        if self.seeds is None:
            return int(rng.integers(DRAWN_SEEDS))
        return check_seed(self.seeds[int(rng.integers(len(self.seeds)))])

    def begin(self, seeds) -> None:
        """Begin missions with these seeds; everybody is due."""
        self._batch = MissionBatch(self.scenario, seeds, self.links, self.limitation, self.record)
        n, actors = len(self.batch.seeds), self.scenario.n_robots + self.scenario.n_operators
        self.tables = new_tables(n, self.scenario)
        self.due = np.ones((n, actors), np.int8)
        self.mask = np.zeros((n, self.choices.n_numbers), np.int8)
        self.replaced = np.zeros(n, np.int64)
        self.time, self.elapsed = np.zeros(n), np.zeros(n)
        self.rewards = np.zeros(n)
        self._no_score = blank(dataclasses.asdict(score_mission(self.batch.state, 0)))
        self._show()

    @property
    def batch(self) -> MissionBatch:
        """The missions; ResetNeeded, Gymnasium's error, before they have begun."""
        if self._batch is None:
            raise ResetNeeded("there is no mission yet: call reset first")
        return self._batch

    def check_begun(self) -> None:
        """ResetNeeded before missions have begun."""
        _ = self.batch

    def step(self, actions, draw_next=None, alone=False) -> None:
        """Decide for all who are due and advance; afterwards the attributes hold what follows from it.

        Args:
          actions: [E, 3 R + H] whole numbers (tasks/choices.py); masked ones count as staying.
          draw_next: mission e that is over begins anew with the seed draw_next(e), and is seen at its t = 0.
          alone: actions are [3 R + H], of the only mission.

        Raises:
          ValueError: an action that does not exist; nothing has changed then.
          ResetNeeded: no mission has begun.
        """
        batch, before, choices = self.batch, self.time, self.choices
        seen, over = batch.observations, batch.over
        numbers = choices.whole(actions, () if alone else over.shape)
        n, k = len(seen.robots), len(seen.operators)
        decisions = Decisions(
            np.empty(n, np.int32), np.empty(n, bool), np.empty(n, np.int32), np.empty(n, bool), np.empty(k, np.int32)
        )
        n_robots, replaced = self.scenario.n_robots, np.zeros(len(over), np.int64)
        wrong = read_actions(seen, numbers, self.mask, choices.starts, choices.sizes, n_robots, decisions, replaced)
        if wrong[0] >= 0:
            raise ValueError(choices.say_wrong(actions, *wrong))
        replaced[over] = 0
        self.replaced = replaced
        if draw_next:
            for e in np.flatnonzero(over).tolist():
                batch.restart(e, draw_next(e))
        batch.step_legal(decisions, self.period)
        self.time = batch.time.astype(float)
        self.elapsed = np.maximum(self.time - before, 0.0)  # a new mission has not elapsed yet
        self.rewards = batch.rewards.sum(axis=1)
        self._show()

    def score(self, e: int = 0) -> dict:
        """The fields of mission e's `Score`; before its end all are 0."""
        return dataclasses.asdict(score_mission(self.batch.state, e)) if self.over[e] else fresh(self._no_score)

    def _show(self):
        show(self.batch.observations, self.tables, self.mask, self.due, self.choices.starts)

    @property
    def over(self) -> np.ndarray:
        """[E] bool: missions that have ended."""
        return self.batch.over


def blank(facts: dict) -> dict:
    """The same names and types, and 0 everywhere."""
    return {name: blank(fact) if isinstance(fact, dict) else type(fact)() for name, fact in facts.items()}


def fresh(facts: dict) -> dict:
    """A copy that shares no dictionary."""
    return facts | {name: fresh(fact) for name, fact in facts.items() if isinstance(fact, dict)}


def read_range(seeds) -> Any:
    """The range that {"range": [start, stop, step]} means; anything else as it is."""
    if isinstance(seeds, dict) and list(seeds) == ["range"]:
        try:
            return range(*seeds["range"])
        except (TypeError, ValueError):
            pass
    return seeds


def check_seeds(seeds) -> None:
    """ValueError unless missions can be drawn from these seeds."""
    if seeds is None:
        return
    is_row = seeds.ndim == 1 if isinstance(seeds, np.ndarray) else isinstance(seeds, Sequence) and not isinstance(seeds, str)
    if not is_row or not len(seeds):
        raise ValueError(f"seeds must be a list or range of seeds, is {said(seeds)}")
    for seed in (seeds[0], seeds[-1]) if isinstance(seeds, range) else seeds:
        try:
            check_seed(seed)
        except ValueError as error:
            raise ValueError(f"seeds: {error}") from None
