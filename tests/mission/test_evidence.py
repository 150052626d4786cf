"""What is known was true at its evidence time, at its origin, and came by delivery or sensing alone."""

import numpy as np
from flying import Wanderer, WatchedBatch, fly
from hypothesis import given, settings
from strategies import change, limitations, scenarios, seeds

from commhg_mj.base.terms import Activity, Status
from commhg_mj.mission.messages import TIRED, TIRING
from commhg_mj.scenarios import SCENARIOS

OWN = ["x", "y", "task", "activity", "progress"]  # what a robot knows best of itself
SUPERVISION = ["mode", "controller"]


class Historian:
    """Keeps the true states of every second, and compares all evidence with the truth of its time."""

    def __init__(self):
        self.tasks, self.robots, self.operators = {}, {}, {}
        self.checked = 0

    def __call__(self, batch, acted):
        state, now = batch.state, int(batch.time[0])
        robots = self.see_robots(state)
        self.robots.setdefault(now, []).append(robots)
        if now == 0 or not acted:
            # Decisions change tasks and operators within a second; sensing and sending came before.
            self.tasks.setdefault(now, state.tasks[0][["type", "status", "progress"]].copy())
            self.operators.setdefault(now, state.operators[0][["session", "robot", "fatigue"]].copy())
        if not acted:
            self.check_beliefs(batch, state.beliefs[0], now)
            self.check_peers(batch, state.peers[0], now)
            self.check_resources(batch, state.resources[0], now)

    @staticmethod
    def see_robots(state):
        robots, tasks = state.robots[0], state.tasks[0]
        # On its way a robot knows nothing of its task's progress.
        progress = np.where(robots["activity"] == Activity.SERVICING, tasks["progress"][robots["task"]], 0.0)
        table = {name: robots[name].astype(np.float32) for name in ("x", "y", "task", "activity", *SUPERVISION)}
        return table | {"progress": progress.astype(np.float32)}

    def check_beliefs(self, batch, beliefs, now):
        soonest = min(batch.scenario.communication.delay, batch.scenario.communication.late_delay[0])
        for receiver, j in zip(*np.nonzero(beliefs["time"] >= 0)):
            belief, truth = beliefs[receiver, j], self.tasks[int(beliefs[receiver, j]["time"])][j]
            assert belief["type"] == truth["type"] and belief["status"] == truth["status"]
            assert belief["progress"] == np.float32(truth["progress"])
            if not belief["sensed"]:
                assert belief["time"] <= now - soonest, "evidence came faster than any message"
            assert receiver < len(beliefs) - 1 or not belief["sensed"], "the station has no sensors"
            self.checked += 1

    def check_peers(self, batch, peers, now):
        soonest = min(batch.scenario.communication.delay, batch.scenario.communication.late_delay[0])
        for receiver, r in zip(*np.nonzero(peers["time"] >= 0)):
            peer = peers[receiver, r]
            assert peer["time"] <= now - soonest and receiver != r
            moments = self.robots[int(peer["time"])]
            for names in (OWN, SUPERVISION):
                assert any(all(moment[name][r] == peer[name] for name in names) for moment in moments)
            self.checked += 1

    def check_resources(self, batch, resources, now):
        for r, h in zip(*np.nonzero(resources["time"] >= 0)):
            report, truth = resources[r, h], self.operators[int(resources[r, h]["time"])][h]
            assert report["time"] < now
            assert report["session"] == truth["session"] and report["robot"] == truth["robot"]
            assert report["fatigue_class"] == (truth["fatigue"] >= TIRING) + (truth["fatigue"] >= TIRED)
            assert 0 <= report["tokens"] <= batch.scenario.communication.bucket
            self.checked += 1


@settings(max_examples=9)
@given(scenarios(robot_period=1, operator_period=1), seeds, limitations)
def test_everything_known_was_true_at_its_evidence_time(scenario, seed, limitation):
    if scenario.n_robots == 64:
        scenario = change(scenario, time_limit=20, n_tasks=min(scenario.n_tasks, 60))
    fly(WatchedBatch(scenario, [seed], limitation=limitation, watch=Historian()), Wanderer(seed % 999, 0.05))


def test_a_medium_mission_spreads_true_evidence_of_every_kind():
    """The same on a named mission, with proof that there was something to compare."""
    scenario = change(
        SCENARIOS["medium"], robot_period=1, operator_period=1, n_tasks=24, time_limit=200, map_side=500.0
    )
    historian = Historian()
    batch = fly(WatchedBatch(scenario, [4], watch=historian), Wanderer(0, 0.02))
    beliefs, known = batch.state.beliefs[0], batch.state.beliefs[0]["time"] >= 0
    assert historian.checked > 10_000
    assert np.any(known[:-1] & (beliefs["sensed"][:-1] == 0)), "nothing was relayed to robots"
    assert np.any(known[-1]) and np.any(batch.state.resources[0]["time"] >= 0)
    assert np.any(beliefs["status"][known] == Status.DONE)


@settings(max_examples=10)
@given(scenarios(robot_period=1, operator_period=1, malfunction=0.6), seeds)
def test_age_of_information_is_the_mean_age_of_living_robots_reports(scenario, seed):
    sums = np.zeros((2, scenario.n_robots + 1))

    def add_ages(batch, acted):
        if acted or batch.time[0] == 0:
            return
        failed = batch.state.robots["activity"][0] == Activity.FAILED
        time = batch.state.peers["time"][0]
        counts = (time >= 0) & ~failed & ~np.append(failed, False)[:, None]
        if int(batch.time[0]) not in seconds:
            seconds.add(int(batch.time[0]))
            sums[0] += np.sum((batch.time[0] - time) * counts, axis=1)
            sums[1] += counts.sum(axis=1)

    seconds = set()
    batch = fly(WatchedBatch(scenario, [seed], watch=add_ages), Wanderer(seed % 99))
    np.testing.assert_allclose(batch.state.inboxes["age_sum"][0], sums[0])
    assert np.array_equal(batch.state.inboxes["samples"][0], sums[1])
