"""Greedy and its fixed communication schedule."""

import numpy as np
import pytest
from flying import Pilot, copied, plain

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, Activity, Status
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.policies.greedy import CLAIM_TRUST, TIRED, Greedy
from commhg_mj.policies.schedule import BROADCAST_PERIOD, FAR, HARD, REQUEST_PERIOD
from commhg_mj.scenarios import SCENARIOS


def idle_team(**fields):
    """Two idle UAVs at the station, in their second 1."""
    pilot = Pilot(plain(**fields))
    pilot.step(robots={r: dict(task=IDLE) for r in range(pilot.batch.scenario.n_robots)})
    return pilot, Greedy(pilot.batch)


def choice(policy, seen, r=0):
    return policy(seen).task[list(seen.robots["robot"]).index(r)]


def set_tasks(seen, r=0, **fields):
    rows = seen.robot_tasks[list(seen.robots["robot"]).index(r)]
    for name, values in fields.items():
        rows[name] = values
    return rows


def alike(seen, r=0, difficulty=0.1):
    """Four tasks that differ in nothing yet."""
    return set_tasks(
        seen, r, distance=100.0, value=1.0, difficulty=difficulty, deadline=500.0, decay=100.0, legal=1, status=0,
        claimed_by=NOBODY,
    )  # fmt: skip


@pytest.mark.parametrize("difficulty", [0.1, 0.6])
@pytest.mark.parametrize(
    "field, good, bad", [("distance", 50, 400), ("value", 3, 1), ("difficulty", 0.05, 0.9), ("deadline", 900, 5)]
)
def test_greedy_prefers_the_near_the_valuable_the_easy_and_what_is_in_time(field, good, bad, difficulty):
    for best in (0, 3):
        pilot, greedy = idle_team(n_operators=0)
        seen = pilot.batch.observations
        rows = alike(seen, difficulty=difficulty)
        rows[field] = bad
        rows[field][best] = good
        assert choice(greedy, seen) == best


def test_greedy_leaves_masked_claimed_and_serviced_tasks_alone():
    for spoil in (dict(legal=0), dict(claimed_by=1, claim_age=1.0), dict(status=Status.SERVICED, age=1.0)):
        pilot, greedy = idle_team(n_operators=0)
        seen = pilot.batch.observations
        rows = alike(seen)
        rows["value"][2] = 3
        assert choice(greedy, seen) == 2
        for name, value in spoil.items():
            rows[name][2] = value
        assert choice(greedy, seen) != 2, spoil


def test_greedy_forgets_old_claims():
    pilot, greedy = idle_team(n_operators=0)
    seen = pilot.batch.observations
    rows = alike(seen)
    rows["value"][2], rows["claimed_by"][2], rows["claim_age"][2] = 3, 1, CLAIM_TRUST + 1
    assert choice(greedy, seen) == 2


def test_greedy_idles_only_when_nothing_is_open():
    pilot, greedy = idle_team(n_operators=0)
    seen = pilot.batch.observations
    alike(seen)["legal"] = 0
    assert choice(greedy, seen) == IDLE


def test_greedy_finishes_a_service_and_keeps_a_prescribed_target():
    pilot = Pilot(plain(n_operators=0, service_base=100.0))
    greedy = Greedy(pilot.batch)
    pilot.wait_until(lambda: pilot.robots["activity"][0] == Activity.SERVICING)
    seen = pilot.batch.observations
    alike(seen)["value"] = 1000.0
    assert choice(greedy, seen) == KEEP
    batch = MissionBatch(SCENARIOS["small"], [1])
    batch.observations.robot_tasks["value"] = np.arange(22) * 100.0
    assert np.all(Greedy(batch)(batch.observations).task == KEEP)


def test_greedy_decides_the_same_on_equal_observations_and_leaves_them_alone():
    batch = MissionBatch("medium", [1, 2])
    greedy = Greedy(batch)
    for _ in range(30):
        seen = batch.observations
        frozen = copied(seen)
        one, other = greedy(seen), greedy(frozen)
        assert all(np.array_equal(a, b) for a, b in zip(one, other))
        assert all(np.array_equal(a[name], b[name]) for a, b in zip(seen, frozen) for name in a.dtype.names)
        batch.step(one)


def test_the_schedule_broadcasts_every_period_and_requests_help_on_hard_tasks():
    pilot = Pilot(
        plain(n_operators=1, robot_period=1, service_base=100.0, difficulty=(0.9, 0.9), n_tasks=12, time_limit=250)
    )
    batch, greedy = pilot.batch, Greedy(pilot.batch)
    spoke, asked = {}, {}
    while not batch.over[0]:
        seen = batch.observations
        decisions = greedy(seen)
        for i, robot in enumerate(seen.robots):
            r, now = int(robot["robot"]), float(robot["time"])
            if decisions.broadcast[i]:
                assert now - spoke.get(r, -99) >= BROADCAST_PERIOD
                spoke[r] = now
            assert now - spoke.get(r, now - 20) <= 2 * BROADCAST_PERIOD
            if decisions.assist[i]:
                assert robot["activity"] == Activity.SERVICING
                assert seen.robot_tasks["difficulty"][i, robot["task"]] > HARD
                assert now - asked.get(r, -99) >= REQUEST_PERIOD
                asked[r] = now
        batch.step(decisions)
    assert len(spoke) == 2 and asked


def test_the_schedule_asks_whoever_was_not_heard_of_for_longest_once_a_far_task_is_chosen():
    batch = MissionBatch("medium", [1, 2])
    asking, silent, asked = Greedy(batch), Greedy(batch, asks=False), 0
    while batch.time.max() < 1200:
        seen = batch.observations
        decisions, quiet = asking(seen), silent(seen)
        assert np.all(quiet.query == NOBODY)
        assert all(np.array_equal(a, b) for a, b in zip(decisions._replace(query=quiet.query), quiet)), "else the same"
        for i, robot in enumerate(seen.robots):
            rows = seen.robot_operators[i]
            unheard = np.where(rows["age"] < 0, np.inf, rows["age"])
            task = decisions.task[i]
            is_far = task >= 0 and seen.robot_tasks[i, task]["distance"] > FAR * robot["speed"]
            if not is_far or not rows["legal"].any():
                assert decisions.query[i] == NOBODY
            else:
                assert unheard[decisions.query[i]] == unheard.max()
                asked += 1
        batch.step(decisions)
    assert asked > 50
    with pytest.raises(ValueError, match="asks"):
        Greedy(batch, asks="no")


def test_operators_take_the_robot_that_gains_most_and_rest_when_tired():
    pilot = Pilot(plain(telemetry_period=1.0, service_base=200.0, difficulty=(1.0, 1.0), generalist=(0.2, 0.2)))
    greedy = Greedy(pilot.batch)
    pilot.wait(8)
    seen = pilot.batch.observations
    assert np.all(seen.operator_reports["age"] >= 0) and greedy(seen).operator[0] >= 0
    seen.operator_reports["activity"][0, 0] = Activity.IDLE
    seen.operator_reports["task"][0, 0] = NOBODY
    assert greedy(seen).operator[0] == 1
    seen.operators["fatigue"] = TIRED
    assert greedy(seen).operator[0] == -2
    seen.operators["fatigue"] = 0.0
    seen.operator_reports["age"] = -1
    assert greedy(seen).operator[0] == -2, "nobody is known"
