"""Helpers that fly missions: a test policy, a batch that is watched, decisions by name, state comparison."""

import hashlib

import numpy as np
from strategies import change

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, REST
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.mission.state import ADDRESSES
from commhg_mj.scenarios import SCENARIOS


def plain(**fields):
    """A bare scenario: no obstacles, failures, changes, late releases or losses; everybody decides every second."""
    calm = dict(
        map_side=500.0, time_limit=300, n_uav=2, n_ugv=0, n_operators=1, n_tasks=4,
        forest_share=0.0, mountain_share=0.0, malfunction=0.0, change_share=0.0, released_at_start=1.0,
        type_shares=(0.0, 0.0, 1.0), unavailable_or_delayed=(0.0, 0.0, 0.0), robot_period=1, operator_period=1,
        initial_phase=0.0, capacity=(1.0, 1.0),
        # What calibration may change, as the tests' figures want it:
        deadline=(90.0, 420.0), service_base=20.0, service_per_difficulty=70.0, success_autonomous=(0.95, 0.85),
        success_controlled=(0.97, 0.15, 0.20), handover=5.0, lease=15.0, renewal_period=10.0, bid_timeout=20.0,
        refill=16.0,
    )  # fmt: skip
    return change(SCENARIOS["small"], **(calm | fields))


class Wanderer:
    """Random legal decisions of any batch, restless with a given probability (else KEEP)."""

    def __init__(self, seed=0, restless=0.1):
        self.rng, self.restless = np.random.default_rng(seed), restless

    def _any(self, legal):
        """(choice, whether there is one) among the legal columns of each row."""
        if legal.shape[1] == 0:
            return np.zeros(len(legal), int), np.zeros(len(legal), bool)
        noise = self.rng.random(legal.shape) * (legal != 0)
        return noise.argmax(axis=1), (legal != 0).any(axis=1)

    def __call__(self, seen):
        decisions, rng = stay(seen), self.rng
        robots, n, k = seen.robots, len(seen.robots), len(seen.operators)
        choice, possible = self._any(seen.robot_tasks["legal"])
        moves = (rng.random(n) < self.restless) | (robots["can_keep"] == 0)
        decisions.task[:] = np.where(moves & possible, choice, decisions.task)
        idles = (rng.random(n) < 0.2 * self.restless) & (robots["can_idle"] != 0)
        decisions.task[:] = np.where(idles, IDLE, decisions.task)
        decisions.broadcast[:] = (robots["can_broadcast"] != 0) & (rng.random(n) < 0.3)
        asked, possible = self._any(seen.robot_operators["legal"])
        decisions.query[:] = np.where(possible & (rng.random(n) < 0.2), asked, NOBODY)
        assists = (decisions.query == NOBODY) & (robots["can_assist"] != 0) & (rng.random(n) < 0.2)
        decisions.assist[:] = assists
        bids, possible = self._any(seen.operator_reports["legal"])
        rests, held = rng.random(k) < 0.1 * self.restless, seen.operators["can_keep"] != 0
        moves = possible & ((rng.random(k) < self.restless) | ~held)
        decisions.operator[:] = np.where(rests, REST, np.where(moves, bids, np.where(held, KEEP, REST)))
        return decisions


class WatchedBatch(MissionBatch):
    """Calls `watch(batch, acted)` on every state: acted is True between the decisions and the next second."""

    def __init__(self, *args, watch, **kwargs):
        self.watch = watch
        super().__init__(*args, **kwargs)

    def _advance(self, seconds):
        self.watch(self, True)
        observations = super()._advance(seconds)
        self.watch(self, False)
        return observations


def fly(batch, policy, seconds=None):
    """Step until every mission is over, or until `seconds`."""
    observations = batch.observations
    while not batch.over.all() and (seconds is None or batch.time.min() < seconds):
        observations = batch.step(policy(observations))
    return batch


def flown(scenario, seeds=(0,), policy=None, **kwargs):
    """A batch after its whole mission with a Wanderer (or `policy`)."""
    return fly(MissionBatch(scenario, seeds, **kwargs), policy or Wanderer())


class Pilot:
    """One mission, steered second by second; who is not mentioned stays as he is.

    >>> pilot = Pilot(plain())
    >>> pilot.step(robots={0: dict(task=3, query=0)}, operators={0: 1})
    """

    def __init__(self, scenario, seed=0, **kwargs):
        self.batch = MissionBatch(scenario, [seed], **kwargs)

    def __getattr__(self, name):
        """`pilot.robots`, `pilot.tasks`, …: the mission's part of the state."""
        return getattr(self.batch.state, name)[0]

    @property
    def now(self):
        return int(self.batch.time[0])

    def step(self, robots=None, operators=None):
        """One round of decisions, and on to the next."""
        seen, robots, operators = self.batch.observations, dict(robots or {}), dict(operators or {})
        decisions = stay(seen)
        for i, row in enumerate(seen.robots):
            for name, value in robots.pop(int(row["robot"]), {}).items():
                getattr(decisions, name)[i] = value
        for i, row in enumerate(seen.operators):
            decisions.operator[i] = operators.pop(int(row["operator"]), decisions.operator[i])
        assert not robots and not operators, f"not due: robots {list(robots)}, operators {list(operators)}"
        self.batch.step(decisions)
        return self

    def heard(self):
        """Wait until the station has a report of every robot: before that none can be commanded."""
        return self.wait_until(lambda: np.all(self.peers["time"][-1] >= 0), 30)

    def wait(self, seconds):
        """Let that many seconds pass; everybody stays as he is."""
        until = self.now + seconds
        while self.now < until and not self.batch.over[0]:
            self.step()
        return self

    def wait_until(self, condition, seconds=300):
        """Let time pass until the condition holds; fails when it does not within `seconds`."""
        until = self.now + seconds
        while not condition():
            assert self.now < until and not self.batch.over[0], "the condition never came true"
            self.step()
        return self


def visible_bytes(array):
    """The bytes of a record array without padding, addresses of memory and room for the log."""
    names = array.dtype.names
    if names is None:
        return np.ascontiguousarray(array).tobytes()
    return b"".join(visible_bytes(array[name]) for name in names if name not in ELSEWHERE)


ELSEWHERE = {*ADDRESSES, "n_log_ticks", "n_log_messages"}  # where a mission lies, not what it is


def fingerprint(arrays, missions=slice(None)):
    """A hash of a named tuple of record arrays (state, log or observations), for some missions."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(visible_bytes(array[missions]))
    return digest.hexdigest()


def differences(one, other):
    """Names of the fields that differ between two named tuples of record arrays."""
    found = []
    for name, a, b in zip(one._fields, one, other):
        for field in a.dtype.names or [None]:
            if visible_bytes(a[field] if field else a) != visible_bytes(b[field] if field else b):
                found.append(f"{name}.{field}")
    return found


def copied(arrays):
    """A deep copy of a named tuple of arrays."""
    return type(arrays)(*(array.copy() for array in arrays))


def history(batch):
    """The state, but for where its arrays lie and what its link model reads."""
    state = copied(batch.state)
    for name in (*ELSEWHERE, "n_canopies", "n_mountains"):
        state.missions[name] = 0
    state.missions["rules"]["radio"] = 0
    return state
