"""What the critic alone reads: the true state, held against what flown missions hold."""

import numpy as np
import pytest
from flying import Wanderer, fly
from learners import SHORT
from strategies import change

from commhg_mj.base.terms import NOBODY, Activity, Kind, Status
from commhg_mj.learning.graphs import GraphBuilder
from commhg_mj.learning.state_features import STATE_MISSION, STATE_OPERATOR, STATE_ROBOT
from commhg_mj.learning.states import read_states
from commhg_mj.mission.batch import MissionBatch

LONG = 200.0  # s


@pytest.fixture(scope="module")
def flown():
    """(state of 30 missions that wander, their features)."""
    batch = fly(MissionBatch(change(SHORT, time_limit=200), range(30)), Wanderer(restless=0.3), seconds=70)
    return batch.state, read_states(batch, GraphBuilder(batch).scale[0], np.arange(30))


def column(table, group, name):
    return table[..., group.index(name)]


def test_the_critic_sees_what_robots_know_of_each_other(flown):
    state, states = flown
    n = state.robots.shape[1]
    known = state.peers["time"][:, :n] >= 0.0
    known[:, range(n), range(n)] = False
    wrong = known & (state.peers["task"][:, :n] != state.robots["task"][:, None])
    assert 0 < known.mean() < 1 and wrong.any()
    assert column(states.robot, STATE_ROBOT, "known_peers") == pytest.approx(known.sum(axis=2) / (n - 1))
    assert column(states.robot, STATE_ROBOT, "wrong_peers") == pytest.approx(wrong.sum(axis=2) / (n - 1))
    pending = (state.tasks["released"] == 1) & (state.tasks["status"] != Status.DONE)
    beliefs = state.beliefs[:, :n]
    mistaken = pending[:, None] & (beliefs["time"] >= 0.0) & (beliefs["status"] != state.tasks["status"][:, None])
    share = mistaken.sum(axis=2) / np.maximum(1, pending.sum(axis=1))[:, None]
    assert mistaken.any() and column(states.robot, STATE_ROBOT, "wrong_tasks") == pytest.approx(share)


def test_the_critic_sees_what_the_station_knows_of_robots(flown):
    state, states = flown
    reports, robots = state.peers[:, -1], state.robots
    heard = reports["time"] >= 0.0
    age = np.where(heard, np.exp(-(state.missions["now"][:, None] - reports["time"]) / LONG), 0.0)
    off = np.where(heard, np.hypot(reports["x"] - robots["x"], reports["y"] - robots["y"]), 0.0)
    assert heard.any() and off.any()
    assert column(states.robot, STATE_ROBOT, "station_age") == pytest.approx(age, rel=1e-5)
    assert column(states.robot, STATE_ROBOT, "station_error") == pytest.approx(off / SHORT.map_side, rel=1e-5, abs=1e-6)


def test_the_critic_sees_queues_and_messages_under_way_by_kind(flown):
    state, states = flown
    waits = state.uplinks["since"] >= 0.0
    for place, name in enumerate(("query_waits", "request_waits", "telemetry_waits")):
        assert np.array_equal(column(states.robot, STATE_ROBOT, name), waits[:, :, place])
    assert waits.any()
    in_air = [air["kind"][slots["slot"][:n]] for air, slots, n in zip(state.air, state.flying, state.missions["flying"])]
    for kind in Kind:
        flying = [np.sum(kinds == kind) for kinds in in_air]
        assert column(states.mission, STATE_MISSION, f"flying_{kind.name.lower()}") == pytest.approx(np.array(flying) / 16)
    assert state.missions["flying"].any()


def test_the_critic_sees_whom_an_operator_holds_and_what_that_robot_does(flown):
    state, states = flown
    seen = 0
    for e, h in np.ndindex(state.operators.shape):
        r = state.operators["robot"][e, h]
        held = states.operator[e, h]
        if r == NOBODY:
            assert not held[STATE_OPERATOR.columns("has_control", "robot_way", "robot_value", "report_age")].any()
            continue
        robot = state.robots[e, r]
        assert held[STATE_OPERATOR.index("has_control")] == (robot["controller"] == h)
        if robot["task"] != NOBODY and robot["activity"] == Activity.TRAVELLING:
            task, seen = state.tasks[e, robot["task"]], seen + 1
            way = np.hypot(task["x"] - robot["x"], task["y"] - robot["y"]) / SHORT.map_side
            assert held[STATE_OPERATOR.columns("robot_way", "robot_value")] == pytest.approx([way, task["value"] / 3.0], rel=1e-5)
    assert seen
