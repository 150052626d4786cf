"""A batch of missions behind one interface: reset, step to the next decision epochs, scores.

Every API of the package and training go through this class and its kernels.
"""

import numpy as np

from ..base.arguments import flag, instance, seeds_of, whole
from ..base.kernels import ensure_compiled, kernel
from ..base.terms import IDLE, KEEP, NOBODY, REST
from ..models.world import World, make_world
from ..radio.link_models import DEFAULT_LINKS, OWN_MODELS, radio_rules
from ..scenarios import Scenario, load_scenario
from .accessors import true_operator, true_robot
from .decide import (
    ILLEGAL,
    N_ROBOT_RULES,
    Decisions,
    Masks,
    apply_decisions,
    copy_operator_masks,
    copy_robot_masks,
    find_illegal,
    new_masks,
)
from .draw import draw_mission, initialize
from .observe import Observations, new_observations, observe_operator, observe_robot
from .recorder import new_log
from .score import Score, score_missions
from .state import State, ground_of, new_state, wire, write_rules
from .tick import advance

LOWEST, HIGHEST = np.iinfo(np.int32).min, np.iinfo(np.int32).max
LONGEST_STEP = 86_400  # s: the longest mission's limit


@kernel
def advance_and_observe(missions, seconds, discount, earned, seen, masks):
    """Advance every mission until somebody in it is due or by its `seconds` [E], and observe for all who are due.

    Mission by mission, so that its arrays are still in the processor's cache when they are observed.

    Args:
      discount: a second, of what is earned.
      earned: [E, 2] is filled with the reward's two parts.
      seen, masks: room for every actor of every mission; the first rows are filled.

    Returns:
      How many robots and operators are due.
    """
    i, k = 0, 0
    for e in range(missions.shape[0]):
        m = missions[e]
        advance(m, seconds[e], discount, earned[e])
        if not m.over:
            i, k = observe_mission(m, e, False, seen, masks, i, k)
    return i, k


@kernel
def observe_mission(m, e, everyone, seen, masks, i, k):
    """Observe for who is due in mission e, or for everyone, from rows i and k on; returns the next free rows."""
    for r in range(m.n_robots):
        if true_robot(m, r).due or everyone:
            seen.robots[i].mission = e
            observe_robot(m, r, seen.robots[i], seen.robot_tasks[i], seen.robot_peers[i], seen.robot_operators[i])
            copy_robot_masks(seen, masks, i)
            i += 1
    for h in range(m.n_operators):
        if true_operator(m, h).due or everyone:
            seen.operators[k].mission = e
            observe_operator(m, h, seen.operators[k], seen.operator_reports[k])
            copy_operator_masks(seen, masks, k)
            k += 1
    return i, k


@kernel
def observe_missions(missions, seen, masks):
    """Observe for everyone in missions that are not over; returns how many robots and operators there are."""
    i, k = 0, 0
    for e in range(missions.shape[0]):
        if not missions[e].over:
            i, k = observe_mission(missions[e], e, True, seen, masks, i, k)
    return i, k


class MissionBatch:
    """Missions of one scenario side by side, one a seed.

    >>> batch = MissionBatch("small", seeds=range(8))
    >>> observations = batch.reset()
    >>> while not batch.over.all():
    ...     observations = batch.step(policy(observations))
    >>> [score.twcr for score in batch.scores()]

    Args:
      scenario: name, TOML file or `Scenario`.
      seeds: one non-negative integer a mission; a seed fixes world, tasks, hazards and packet fates.
      links: a link model's name.
      limitation: "nominal", "low" or "high".
      record: keep what a trace needs (`commhg_mj.mission.trace`).

    Attributes:
      discount: a second, of `rewards` within a step; 1 by default.
      rewards: [E, 2] of the last step, mission and coordination part (paper, eq. 4).

    Raises:
      ValueError: an argument is impossible; the message names it.
    """

    def __init__(self, scenario, seeds, links=DEFAULT_LINKS, limitation="nominal", record=False):
        self.scenario: Scenario = load_scenario(scenario)
        self.seeds = seeds_of(seeds)
        self.links, self.limitation, self.record, self.discount = links, limitation, flag("record", record), 1.0
        radio_rules(self.scenario, links, limitation)  # refuses both by name before any world is made
        ensure_compiled()
        self.worlds: list[World] = [make_world(self.scenario, seed) for seed in self.seeds]
        self.grounds = [ground_of(world, links) for world in self.worlds]
        self.reset()

    def __setstate__(self, attributes):
        """A copy or an unpickled batch has arrays of its own: its missions must find those."""
        self.__dict__.update(attributes)
        self.grounds = [ground_of(world, self.links) for world in self.worlds]
        self._wire()

    def restore(self, arrays: dict) -> Observations:
        """Put back the state, by name of its arrays, of another batch of the same missions, as it stood after a step."""
        for name, array in arrays.items():
            np.copyto(getattr(self.state, name), array)
        self._wire()
        self._is_new[:] = False
        return self._advance(0)

    def _wire(self):
        self.state.missions["rules"]["radio"]["share_at"] = OWN_MODELS.get(self.links, 0)  # in this process
        for e, ground in enumerate(self.grounds):
            wire(self.state, self.log, e, ground)

    def reset(self) -> Observations:
        """Back to t = 0 of the same missions; everybody is due."""
        n = len(self.seeds)
        self.state: State = new_state(n, self.scenario)
        self.log = new_log(n, self.scenario, self.record)
        self._wire()
        write_rules(self.state.missions, self.scenario, self.links, self.limitation)
        for e, world in enumerate(self.worlds):
            draw_mission(self.state, e, world)
        initialize(self.state)
        self._is_new = np.ones(n, bool)
        return self._advance(0)

    def restart(self, e: int, seed: int) -> None:
        """Begin another mission in the place of mission `e`, which is over; the next step observes its t = 0.

        Raises:
          ValueError: mission `e` is still under way, or the seed is impossible.
        """
        whole("e", e, 0, len(self.seeds) - 1)
        if not self.state.missions["over"][e]:
            raise ValueError(f"mission {e} is still under way")
        fresh = MissionBatch(self.scenario, [seed], self.links, self.limitation, self.record)
        for mine, new in zip((*self.state, *self.log), (*fresh.state, *fresh.log)):
            mine[e] = new[0]
        self.seeds[e], self.worlds[e], self.grounds[e] = fresh.seeds[0], fresh.worlds[0], fresh.grounds[0]
        wire(self.state, self.log, e, self.grounds[e])
        self._is_new[e] = True

    def step(self, decisions: Decisions, seconds: int = 0) -> Observations:
        """Let the decisions take effect and advance to the next decision epochs.

        Args:
          decisions: one choice for each row of the last observations.
          seconds: advance every mission by so many instead; whoever falls due meanwhile stays so until the end.

        Returns:
          The observations of everybody who is due; no rows for missions that are over.

        Raises:
          ValueError: a decision is of the wrong shape or masked, or no such seconds; nothing has changed then.
        """
        seconds = whole("seconds", seconds, 0, LONGEST_STEP)
        return self.step_legal(self._check(decisions), seconds)

    def step_legal(self, decisions: Decisions, seconds: int = 0) -> Observations:
        """`step` for who knows that the decisions are legal, and of the types that `Decisions` says."""
        apply_decisions(self.state.missions, self._masks, decisions)
        return self._advance(seconds)

    def _advance(self, seconds) -> Observations:
        """Advance and observe; a new mission stands at t = 0, where everybody is due."""
        seen, masks = new_observations(len(self.seeds), self.scenario), new_masks(len(self.seeds), self.scenario)
        lasts = np.where(self._is_new, 0, seconds)
        self.rewards = np.zeros((len(self.seeds), 2))
        n, k = advance_and_observe(self.state.missions, lasts, self.discount, self.rewards, seen, masks)
        self._is_new[:] = False
        self.observations = Observations(*(table[:rows] for table, rows in zip(seen, (n, n, n, n, k, k))))
        self._masks = Masks(*(table[:rows] for table, rows in zip(masks, (n, n, n, k, k))))
        return self.observations

    def observe_everyone(self) -> Observations:
        """What all actors of missions under way would see now, due or not; decisions go on to answer `observations`."""
        seen, masks = new_observations(len(self.seeds), self.scenario), new_masks(len(self.seeds), self.scenario)
        n, k = observe_missions(self.state.missions, seen, masks)
        return Observations(*(table[:rows] for table, rows in zip(seen, (n, n, n, n, k, k))))

    def _check(self, decisions) -> Decisions:
        instance("decisions", decisions, Decisions)
        n, k = len(self._masks.robots), len(self._masks.operators)
        wanted = {"task": (n, np.int32), "broadcast": (n, np.bool_), "query": (n, np.int32), "assist": (n, np.bool_)}
        wanted["operator"] = (k, np.int32)
        arrays = []
        for name, (length, dtype) in wanted.items():
            try:
                values = np.asarray(getattr(decisions, name))
            except ValueError as error:
                raise ValueError(f"decisions.{name}: {error}") from None
            if values.shape != (length,):
                raise ValueError(f"decisions.{name} must have shape ({length},), has {values.shape}")
            if values.dtype.kind not in ("b" if dtype is np.bool_ else "iu"):
                raise ValueError(f"decisions.{name} must be of type {np.dtype(dtype).name}, is {values.dtype}")
            if values.dtype.kind in "iu" and not np.all((values >= LOWEST) & (values <= HIGHEST)):
                raise ValueError(f"decisions.{name} holds a number out of range")
            arrays.append(np.ascontiguousarray(values, dtype))
        checked = Decisions(*arrays)
        row, rule = find_illegal(self._masks, checked)
        if row >= 0:
            raise ValueError(self._explain(checked, row, rule))
        return checked

    def _explain(self, decisions, row, rule):
        if rule < N_ROBOT_RULES:
            actor = self._masks.robots[row]
            name = self.scenario.robot_names[actor["robot"]]
            chosen = f"task {decisions.task[row]}, query {decisions.query[row]}"
        else:
            actor = self._masks.operators[row]
            name, chosen = f"operator{actor['operator']}", f"choice {decisions.operator[row]}"
        return f"{name} of mission {actor['mission']} at {actor['time']:.0f} s: {ILLEGAL[rule]} ({chosen})"

    @property
    def rules(self) -> np.ndarray:
        """[1] RULES: the scenario's public numbers, as kernels read them."""
        return self.state.missions["rules"][:1]

    @property
    def over(self) -> np.ndarray:
        """[E] bool: missions that have ended."""
        return self.state.missions["over"].astype(bool)

    @property
    def time(self) -> np.ndarray:
        """[E] seconds since each mission's start."""
        return self.state.missions["now"].copy()

    def scores(self) -> list[Score]:
        """How each mission went so far."""
        return score_missions(self.state)


def stay(observations: Observations) -> Decisions:
    """Nobody changes anything and nobody speaks: a start for decisions of one's own."""
    n = len(instance("observations", observations, Observations).robots)
    return Decisions(
        task=np.where(observations.robots["can_keep"], KEEP, IDLE).astype(np.int32),
        broadcast=np.zeros(n, bool),
        query=np.full(n, NOBODY, np.int32),
        assist=np.zeros(n, bool),
        operator=np.where(observations.operators["can_keep"], KEEP, REST).astype(np.int32),
    )
