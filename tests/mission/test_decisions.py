"""The interface of a batch: what it refuses, who is due, and what decisions may not do."""

import numpy as np
import pytest
from flying import Pilot, Wanderer, copied, differences, fly, plain
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import limitations, scenarios, seeds

from commhg_mj.base.terms import IDLE, KEEP, REST, Activity, Session
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.scenarios import SCENARIOS


def refuse(batch, decisions, match):
    """The decisions are refused with that message, and nothing has changed."""
    before, seen = copied(batch.state), batch.observations
    with pytest.raises(ValueError, match=match):
        batch.step(decisions)
    assert differences(before, batch.state) == [] and batch.observations is seen


def at(batch, column, row, value):
    """`stay`, but for one choice."""
    decisions = stay(batch.observations)
    getattr(decisions, column)[row] = value
    return decisions


@pytest.mark.parametrize(
    "column, value, rule",
    [
        ("task", 22, "task is not a released task"),
        ("task", -3, "task is not a released task"),
        ("task", "unreleased", "task is masked"),
        ("task", "own", "task is masked"),
        ("query", 2, "query is not an operator"),
        ("query", -2, "query is not an operator"),
        ("assist", "with query", "assist is not open together with a query"),
        ("operator", 4, "choice is not a robot"),
        ("operator", -3, "choice is not a robot"),
        ("operator", KEEP, "there is no session to KEEP"),
    ],
)
def test_illegal_decisions_are_refused_by_actor_mission_time_and_rule(column, value, rule):
    batch = MissionBatch("small", [4, 5])
    row = np.flatnonzero(batch.observations.robots["mission"] == 1)[2] if column != "operator" else 3
    if value == "unreleased":
        value = np.flatnonzero(batch.state.tasks["released"][1] == 0)[0]
    elif value == "own":
        value = batch.observations.robots["task"][row]
    decisions = at(batch, column, row, True if column == "assist" else value)
    if value == "with query":
        decisions.query[row] = 0
    actor = "operator1" if column == "operator" else "ugv0"
    refuse(batch, decisions, f"{actor} of mission 1 at 0 s: {rule}")


def test_idle_is_refused_while_the_first_target_is_prescribed():
    batch = MissionBatch("small", [4])
    refuse(batch, at(batch, "task", 0, IDLE), "uav0 of mission 0 at 0 s: IDLE is not open")


def test_keep_without_a_task_and_a_second_broadcast_in_one_second_are_refused():
    pilot = Pilot(plain(n_operators=0, arbitration=0.0))
    pilot.step(robots={0: dict(task=IDLE), 1: dict(task=IDLE)})
    refuse(pilot.batch, at(pilot.batch, "task", 0, KEEP), "there is no task to KEEP")
    pilot.step(robots={0: dict(task=2), 1: dict(task=2, broadcast=True)})
    assert pilot.batch.observations.robots["robot"].tolist() == [1]
    refuse(pilot.batch, at(pilot.batch, "broadcast", 0, True), "uav1 .* broadcast is not open")


def test_assistance_needs_a_task_no_control_and_tokens():
    pilot = Pilot(plain())
    assert pilot.batch.observations.robots["can_assist"].tolist() == [1, 1]
    pilot.step(robots={0: dict(task=IDLE)})
    refuse(pilot.batch, at(pilot.batch, "assist", 0, True), "uav0 .* assist is not open")
    pilot.robots["tokens"], pilot.robots["next_telemetry"] = 0.0, 3600
    pilot.step()
    refuse(pilot.batch, at(pilot.batch, "assist", 1, True), "uav1 .* assist is not open")
    pilot = Pilot(plain()).heard()
    pilot.step(operators={0: 1}).wait_until(lambda: pilot.robots["controller"][1] == 0)
    refuse(pilot.batch, at(pilot.batch, "assist", 1, True), "uav1 .* assist is not open")


@pytest.mark.parametrize(
    "column, values, match",
    [
        ("task", np.zeros(1, int), r"decisions.task must have shape \(4,\)"),
        ("task", np.zeros((4, 1), int), "decisions.task must have shape"),
        ("task", np.zeros(4), "decisions.task must be of type int32, is float64"),
        ("task", np.full(4, 2**32 + 1), "decisions.task"),
        ("operator", np.full(2, -(2**40)), "decisions.operator"),
        ("broadcast", np.ones(4, int), "decisions.broadcast must be of type bool"),
        ("query", np.full(4, np.nan), "decisions.query must be of type int32"),
    ],
)
def test_decisions_of_a_wrong_shape_or_type_are_refused(column, values, match):
    batch = MissionBatch("small", [4])
    refuse(batch, stay(batch.observations)._replace(**{column: values}), match)


@settings(max_examples=10)
@given(scenarios(), seeds, limitations, st.randoms(use_true_random=False))
def test_any_masked_choice_is_refused_and_changes_nothing(scenario, seed, limitation, random):
    batch, wanderer = MissionBatch(scenario, [seed], limitation=limitation), Wanderer(seed % 99, 0.3)
    for _ in range(12):
        seen = batch.observations
        if batch.over[0]:
            break
        masked = [("task", i, j) for i, j in zip(*np.nonzero(seen.robot_tasks["legal"] == 0))]
        masked += [("query", i, j) for i, j in zip(*np.nonzero(seen.robot_operators["legal"] == 0))]
        masked += [("operator", i, j) for i, j in zip(*np.nonzero(seen.operator_reports["legal"] == 0))]
        masked += [("task", i, KEEP) for i in np.flatnonzero(seen.robots["can_keep"] == 0)]
        masked += [("task", i, IDLE) for i in np.flatnonzero(seen.robots["can_idle"] == 0)]
        masked += [("broadcast", i, True) for i in np.flatnonzero(seen.robots["can_broadcast"] == 0)]
        masked += [("assist", i, True) for i in np.flatnonzero(seen.robots["can_assist"] == 0)]
        for column, row, value in random.sample(masked, min(3, len(masked))):
            decisions = wanderer(seen)
            getattr(decisions, column)[row] = value
            refuse(batch, decisions, " of mission 0 at ")
        batch.step(wanderer(seen))


@pytest.mark.parametrize(
    "arguments, match",
    [
        (dict(scenario="tiny", seeds=[1]), "unknown scenario 'tiny': use small, medium, large"),
        (dict(scenario="small", seeds=[]), "seeds: at least one"),
        (dict(scenario="small", seeds=[-1]), "seed must be a whole number .* is -1"),
        (dict(scenario="small", seeds=[2**63]), "seed must be a whole number"),
        (dict(scenario="small", seeds=[True]), "seed must be a whole number .* is True"),
        (dict(scenario="small", seeds=[1.5]), "seed must be a whole number .* is 1.5"),
        (dict(scenario="small", seeds=[1], links="wired"), "unknown link model 'wired': use abstract"),
        (
            dict(scenario="small", seeds=[1], limitation="extreme"),
            "unknown limitation 'extreme': use nominal, low, high",
        ),
    ],
)
def test_impossible_batches_are_refused_by_name(arguments, match):
    with pytest.raises(ValueError, match=match):
        MissionBatch(**arguments)


@pytest.mark.parametrize("seconds", [2.5, -1, float("nan"), 2**63, "3", None, True])
def test_impossible_seconds_are_refused_and_nothing_changes(seconds):
    batch = MissionBatch("small", [1])
    with pytest.raises(ValueError, match="seconds must be a whole number in 0..86400, is"):
        batch.step(stay(batch.observations), seconds)
    assert batch.time[0] == 0
    batch.step(stay(batch.observations), np.int64(3))
    assert batch.time[0] == 3


def test_everybody_is_due_at_the_start_and_then_at_least_once_a_period():
    batch = MissionBatch("small", [1, 2])
    assert batch.observations.robots["robot"].tolist() == [0, 1, 2, 3] * 2
    assert batch.observations.operators["operator"].tolist() == [0, 1] * 2
    last = {}
    while batch.time.min() < 100 and not batch.over.any():
        seen = batch.observations
        for rows, name, period in ((seen.robots, "robot", 10), (seen.operators, "operator", 5)):
            for row in rows:
                who = name, int(row["mission"]), int(row[name])
                assert row["time"] - last.get(who, 0) <= period
                last[who] = row["time"]
        batch.step(stay(seen))
    assert len(last) == 12


def test_nobody_is_asked_in_missions_that_are_over_and_failed_robots_never():
    batch, wanderer = MissionBatch(plain(malfunction=0.9, time_limit=100, n_uav=3), range(8)), Wanderer()
    while not batch.over.all():
        seen = batch.step(wanderer(batch.observations))
        for actors in (seen.robots, seen.operators):
            assert not np.any(batch.over[actors["mission"]])
        assert np.all(batch.state.robots["activity"][seen.robots["mission"], seen.robots["robot"]] != Activity.FAILED)
    assert len(batch.observations.robots) == len(batch.observations.operators) == 0
    end = copied(batch.state)
    batch.step(stay(batch.observations))
    assert differences(end, batch.state) == []


def test_robots_decide_on_control_start_and_end_and_operators_on_lease_events():
    pilot = Pilot(plain(robot_period=3600, operator_period=1, lease=8.0, renewal_period=3600.0, map_side=5000.0)).heard()
    pilot.step(operators={0: 0})
    moments = {}
    while pilot.now < 20:
        seen = pilot.batch.observations
        for row in seen.robots:
            moments.setdefault(int(row["mode"]), pilot.now)
        pilot.step()
    assert set(moments) == {0, 1}, "due in the handover, and when control has ended"
    pilot = Pilot(plain(robot_period=1, operator_period=4, lease=8.0, renewal_period=3600.0, map_side=5000.0)).heard()
    pilot.wait_until(lambda: 0 in pilot.batch.observations.operators["operator"], 9).step(operators={0: 0})
    pilot.operators["next_decision"] = 3600
    sessions = []
    while pilot.now < 20:
        sessions += pilot.batch.observations.operators["session"].tolist()
        pilot.step()
    assert Session.HELD in sessions and Session.REST in sessions


def test_observations_of_different_steps_share_no_memory():
    batch = MissionBatch("small", [1])
    first = batch.observations
    frozen = copied(first)
    second = batch.step(stay(first))
    assert differences(first, frozen) == []
    for one, other in zip(first, second):
        assert not np.shares_memory(one, other)
        assert not any(np.shares_memory(other, array) for array in batch.state)


def test_bytes_of_memory_do_not_show_in_observations():
    """Two batches of the same missions observe the same, field by field."""
    one, other = MissionBatch("medium", [1, 2]), MissionBatch("medium", [1, 2])
    a, b = fly(one, Wanderer(5), 60), fly(other, Wanderer(5), 60)
    assert differences(a.observations, b.observations) == []


def test_stay_is_always_legal():
    batch = MissionBatch(SCENARIOS["small"], range(4))
    while not batch.over.all():
        batch.step(stay(batch.observations))
    assert all(score.switches == 0 for score in batch.scores())


def test_rest_is_legal_with_nothing_to_give_up():
    pilot = Pilot(plain())
    pilot.step(operators={0: REST})
    assert pilot.operators["session"][0] == Session.REST and pilot.batch.scores()[0].reward_coordination == 0
