"""Points to learn from: what actors knew when they chose, and what their alternatives turned out to be worth, simulated.

Points of a block of missions depend on the plan and the block's number alone, so that a run can stop and go on between blocks.
"""

import zipfile
from typing import NamedTuple

import numpy as np

from ..base.files import whole_file
from ..base.terms import KEEP, REST, Session
from ..mission.batch import MissionBatch, stay
from ..mission.observe import Observations
from ..mission.state import LUCK
from ..policies.alternatives import OPERATOR, ROBOT, Alternatives, list_candidates
from ..policies.planner import WHOLE, choose, is_settled, new_desk, new_memory, talk
from ..scenarios import part_of
from .batches import join_operators, join_robots, pick_robots, shifted
from .features import REPORT
from .graphs import GraphBuilder, OperatorGraphs, RobotGraphs
from .heads import RobotChoices
from .plan_numbers import CANDIDATES
from .rollout import edges_of, from_decisions, join_choices, picks_of

FORMAT = "commhg_mj points 4"
TEAM = 4  # robots of whose missions points are made: among more, luck hides what one choice is worth, and flights cost more
N_TRIED = CANDIDATES  # robots' alternatives
N_PICKED = 5  # operators' alternatives: the planner's pick, KEEP, REST and the robots that gain most
N_SEEDS = 1  # flights of each: more decisions teach more than surer ones
NOT_TRIED = -9
# Shares of decisions that become points: whoever has no task or robot decides, whoever has one mostly keeps it.
FREE, BUSY, IMITATED = 0.9, 0.3, 0.1
OPERATOR_FREE, OPERATOR_BUSY = 0.08, 0.01
EXPLORED = 0.1  # share of points at which one of the alternatives is flown in place of the planner's pick
NEW_LUCK = 1 << 40, 1 << 50  # seeds of flights; no mission has one of them
GAIN = REPORT.index("gain")


class Trials(NamedTuple):
    """Alternatives of n decisions, the planner's pick first, and how their flights ended."""

    choice: np.ndarray  # [n, C] i8; NOT_TRIED: none
    worth: np.ndarray  # [n, C] f4 mean TWCR, times the number of tasks; nan: none
    luck: np.ndarray  # [n, C, len(LUCK)] f4 mean luck of the same flights

    @property
    def are_there(self) -> np.ndarray:
        """[n] bool: the decision's alternatives were judged."""
        return self.choice[:, 0] != NOT_TRIED


class Points(NamedTuple):
    """Decisions of N robots and K operators, what the planner chose there, and what was tried."""

    robots: RobotGraphs  # `mission` is the row of `public`
    operators: OperatorGraphs
    public: np.ndarray  # [worlds, T, PUBLIC.width]
    taught: RobotChoices  # the planner's
    taught_picks: np.ndarray  # [K] i8 likewise
    tried: Trials  # [N, N_TRIED] edges, KEEP or IDLE
    tried_picks: Trials  # [K, N_PICKED] columns of operators' logits

    @property
    def n_judged(self) -> int:
        """Decisions whose alternatives were judged."""
        return int(self.tried.are_there.sum() + self.tried_picks.are_there.sum())


TABLES = {  # of points, in their file column by column
    "robots": RobotGraphs, "operators": OperatorGraphs, "taught": RobotChoices, "tried": Trials, "tried_picks": Trials,
}  # fmt: skip


class Gatherer:
    """Flies missions of a small part of the plan's scenario by the planner, and judges alternatives on the way."""

    def __init__(self, plan, wants, first_seed: int, rng):
        scenario, n = part_of(plan.scenario, TEAM), plan.side_by_side
        self.batch = MissionBatch(scenario, range(first_seed, first_seed + n), plan.links, plan.limitation)
        self.builder, self.rng = GraphBuilder(self.batch, wants), rng
        self.public = self.builder.public(self.batch.state.tasks)
        self.desk, self.memory = new_desk(scenario), new_memory(n, scenario)
        self.alternatives = Alternatives(self.batch, N_SEEDS * max(N_TRIED, N_PICKED))
        self.found, self.n_tasks = np.zeros(scenario.n_tasks + 1, np.int64), scenario.n_tasks

    def gather(self) -> Points:
        """The points of all its missions, flown to their ends."""
        steps, batch = [], self.batch
        while not batch.over.all():
            seen = batch.observations
            graphs, operators = self.builder.robots(seen), self.builder.operators(seen)
            decisions = stay(seen)
            choose(batch.rules, WHOLE, self.desk, self.memory, seen, decisions)
            flown = decisions._replace(task=decisions.task.copy(), operator=decisions.operator.copy())
            tried = self._try_robots(seen, decisions, flown)
            picked = self._try_operators(seen, operators, decisions, flown)
            talk(WHOLE, self.memory, seen, flown)
            if self.builder.wants.plans:
                self.builder.talk(seen, flown, True)  # the same once more, for it has a memory of its own
            decisions = flown._replace(task=decisions.task, operator=decisions.operator)
            kept, kept_picks = (each.are_there | (self.rng.random(len(each.choice)) < IMITATED) for each in (tried, picked))
            steps.append(_cut(graphs, operators, decisions, (tried, kept), (picked, kept_picks)))
            batch.step_legal(flown)
        return _join(steps, self.public)

    def _try_robots(self, seen: Observations, decisions, flown) -> Trials:
        """Tasks or IDLE of some who are due; `flown` may get another than the planner's."""
        tried = _no_trials(len(seen.robots), N_TRIED)
        for i, robot in enumerate(seen.robots):
            share = FREE if robot["task"] < 0 else BUSY
            if self.rng.random() >= share or robot["stand_left"] > 0.0 or is_settled(robot):
                continue
            n_found = list_candidates(self.batch.rules, self.desk, self.memory, seen, i, self.found)
            choices = self.found[: min(N_TRIED, n_found)].copy()
            if len(choices) > 1:
                self._judge(robot, ROBOT, robot["robot"], choices, tried, i)
                if self.rng.random() < EXPLORED:
                    choice = self.rng.choice(choices)
                    flown.task[i] = KEEP if choice == robot["task"] else choice
        return tried

    def _try_operators(self, seen: Observations, graphs, decisions, flown) -> Trials:
        """Choices of some operators who are due."""
        tried = _no_trials(len(seen.operators), N_PICKED)
        for i, operator in enumerate(seen.operators):
            is_busy = operator["session"] != Session.REST and not operator["exempt"]
            if self.rng.random() >= (OPERATOR_BUSY if is_busy else OPERATOR_FREE):
                continue
            robots = np.flatnonzero(graphs.legal[i])
            best = robots[np.argsort(-graphs.report[i, robots, GAIN], kind="stable")]
            options = [decisions.operator[i], *[KEEP] * bool(operator["can_keep"]), REST, *best]
            choices = list(dict.fromkeys(map(int, options)))[:N_PICKED]
            if len(choices) > 1:
                self._judge(operator, OPERATOR, operator["operator"], choices, tried, i)
                if self.rng.random() < EXPLORED:
                    flown.operator[i] = self.rng.choice(choices)
        return tried

    def _judge(self, actor, role, number, choices, tried, row):
        """Fill in a row of trials."""
        seeds = self.rng.integers(*NEW_LUCK, N_SEEDS)
        ends = self.alternatives.judge(int(actor["mission"]), self.memory, role, int(number), choices, seeds)
        worth = self.n_tasks * ends.twcr.mean(axis=1)
        for column, values in zip(tried, (choices, worth, ends.luck.mean(axis=1))):
            column[row, : len(choices)] = values


def _no_trials(n, n_choices) -> Trials:
    shape = n, n_choices
    return Trials(np.full(shape, NOT_TRIED), np.full(shape, np.nan, np.float32), np.zeros((*shape, len(LUCK)), np.float32))


def _cut(graphs, operators, decisions, tried, picked):
    """The rows of one step that are kept, in the order of `Points`."""
    (tried, kept), (picked, kept_picks) = tried, picked
    taught, taught_picks = from_decisions(graphs, operators, decisions)
    edges, rows = edges_of(graphs, tried.choice), np.flatnonzero(kept)
    robots, shift = pick_robots(graphs, rows)
    task, *others = (column[rows] for column in taught)
    return (
        robots, OperatorGraphs(*(column[kept_picks] for column in operators)),
        RobotChoices(shifted(task, shift), *others), taught_picks[kept_picks],
        Trials(shifted(edges[rows], shift[:, None]), tried.worth[rows], tried.luck[rows]),
        Trials(picks_of(picked.choice)[kept_picks], picked.worth[kept_picks], picked.luck[kept_picks]),
    )  # fmt: skip


def _join(steps, public) -> Points:
    robots, operators, taught, taught_picks, tried, picked = zip(*steps)
    starts = np.cumsum([0] + [len(part.task) for part in robots])
    tried = [part._replace(choice=shifted(part.choice, start)) for part, start in zip(tried, starts)]
    return Points(
        join_robots(robots), join_operators(operators), public, join_choices(robots, taught), np.concatenate(taught_picks),
        *(Trials(*map(np.concatenate, zip(*parts))) for parts in (tried, picked)),
    )  # fmt: skip


def join_points(parts: list[Points]) -> Points:
    """The points of several blocks, one after the other."""
    worlds = np.cumsum([0] + [len(part.public) for part in parts])
    moved = [part.robots._replace(mission=part.robots.mission + start) for part, start in zip(parts, worlds)]
    steps = [(robots, part.operators, *part[3:]) for robots, part in zip(moved, parts)]
    return _join(steps, np.concatenate([part.public for part in parts]))


def save_points(points: Points, path, facts: dict) -> None:
    """Write points and numbers about them, whole or not at all."""
    arrays = {name: getattr(points, name) for name in Points._fields if name not in TABLES}
    for name in TABLES:
        arrays |= {f"{name}.{field}": column for field, column in getattr(points, name)._asdict().items()}
    with whole_file(path) as draft, open(draft, "wb") as file:
        np.savez(file, format=FORMAT, **arrays, **{f"facts.{name}": value for name, value in facts.items()})


def load_points(path) -> tuple[Points, dict]:
    """(points, facts) of a file that `save_points` wrote.

    Raises:
      ValueError: it is damaged; the message names it.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        if arrays.get("format") != FORMAT:
            raise KeyError("format")
        columns = {name: arrays[name] for name in Points._fields if name not in TABLES}
        for name, table in TABLES.items():
            columns[name] = table(*(arrays[f"{name}.{field}"] for field in table._fields))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path} is damaged, or holds no points of this version ({type(error).__name__})") from None
    return Points(**columns), {name[6:]: value.item() for name, value in arrays.items() if name.startswith("facts.")}
