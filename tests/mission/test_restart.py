"""Missions that begin anew inside a batch, and steps of fixed length."""

import numpy as np
import pytest
from flying import Wanderer, copied, differences, fingerprint, flown, fly, plain
from strategies import change

from commhg_mj.base.terms import NOBODY
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.mission.trace import ARRAYS, make_traces
from commhg_mj.radio import LINK_MODELS
from commhg_mj.scenarios import SCENARIOS

BRIEF = change(SCENARIOS["small"], time_limit=60)


def of(batch, e):
    """Mission e alone: its state and its log."""
    return fingerprint(batch.state, slice(e, e + 1)), fingerprint(batch.log, slice(e, e + 1))


def rows_of(seen, e):
    """A hash of the rows of mission e, without its number."""
    robots, operators = seen.robots["mission"] == e, seen.operators["mission"] == e
    tables = [table[rows] for table, rows in zip(seen, [robots] * 4 + [operators] * 2)]
    tables[0]["mission"] = tables[4]["mission"] = 0
    return fingerprint(tables)


@pytest.mark.parametrize("links", LINK_MODELS)
def test_a_restarted_mission_equals_a_fresh_one(links):
    batch = flown(BRIEF, [1, 2, 3], Wanderer(1), links=links, record=True)
    others = of(batch, 0), of(batch, 2)
    batch.restart(1, 7)
    fresh = MissionBatch(BRIEF, [7], links=links, record=True)
    assert batch.seeds == [1, 7, 3] and batch.worlds[1].seed == 7
    assert batch.over.tolist() == [True, False, True] and batch.time.tolist()[1] == 0
    seen = batch.step(stay(batch.observations))
    assert len(seen.robots) == BRIEF.n_robots and batch.time.tolist()[1] == 0 and batch.rewards[1].tolist() == [0, 0]
    mine, new = Wanderer(2), Wanderer(2)
    while not fresh.over[0]:
        assert rows_of(batch.observations, 1) == rows_of(fresh.observations, 0)
        assert of(batch, 1)[0] == of(fresh, 0)[0]
        batch.step(mine(batch.observations))
        fresh.step(new(fresh.observations))
        np.testing.assert_array_equal(batch.rewards[1], fresh.rewards[0])
    assert batch.over[1] and batch.scores()[1] == fresh.scores()[0]
    assert others == (of(batch, 0), of(batch, 2)), "nobody else has noticed"
    mine, new = make_traces(batch, "wanderer")[1], make_traces(fresh, "wanderer")[0]
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(mine, name), getattr(new, name), name)


def test_others_fly_on_while_one_begins_anew():
    brittle = change(BRIEF, malfunction=0.99, n_uav=1, n_ugv=0, time_limit=120)
    batch = MissionBatch(brittle, range(6))
    while not batch.over.any():
        batch.step(stay(batch.observations))
    alone = MissionBatch(brittle, range(6))
    while not alone.over.any():
        alone.step(stay(alone.observations))
    assert not batch.over.all()
    running = [e for e in range(6) if not batch.over[e]]
    for e in np.flatnonzero(batch.over):
        batch.restart(e, 100 + e)
    fly(batch, stay)
    fly(alone, stay)
    assert [of(batch, e)[0] for e in running] == [of(alone, e)[0] for e in running]


def test_restarting_twice_and_with_the_same_seed():
    batch = flown(BRIEF, [4, 5])
    ends = of(batch, 0)[0]
    for seed in (9, 4):
        batch.restart(0, seed)
        fly(batch, Wanderer())
    assert batch.seeds == [4, 5]
    alone = flown(BRIEF, [4])
    assert of(batch, 0)[0] == of(alone, 0)[0] != ends  # the Wanderer of two missions draws otherwise


def test_a_running_mission_is_not_restarted():
    batch = MissionBatch(BRIEF, [1, 2])
    before, seen = copied(batch.state), batch.observations
    with pytest.raises(ValueError, match="mission 1 is still under way"):
        batch.restart(1, 3)
    assert differences(before, batch.state) == [] and batch.observations is seen and batch.seeds == [1, 2]


@pytest.mark.parametrize("seed", [-1, 2**63, 1.0, True, "7", None])
def test_an_impossible_seed_restarts_nothing(seed):
    batch = flown(BRIEF, [1])
    before = copied(batch.state)
    with pytest.raises(ValueError, match="seed must be a whole number"):
        batch.restart(0, seed)
    assert differences(before, batch.state) == [] and batch.seeds == [1]


def test_a_whole_batch_begins_anew_after_a_restart():
    batch = flown(BRIEF, [1, 2])
    batch.restart(0, 8)
    batch.reset()
    assert of(batch, 0) == of(MissionBatch(BRIEF, [8]), 0) and batch.time.tolist() == [0, 0]


@pytest.mark.parametrize("seconds", [1, 7, 25])
def test_steps_of_fixed_length(seconds):
    """Every running mission advances by so much, whoever falls due meanwhile."""
    batch, wanderer = MissionBatch(BRIEF, [1, 2], limitation="high"), Wanderer()
    for k in range(1, 100):
        batch.step(wanderer(batch.observations), seconds)
        assert batch.time.tolist() == [min(k * seconds, 60)] * 2
        if batch.over.all():
            break
    assert k == -(-60 // seconds)


def test_who_falls_due_within_a_step_stays_so_until_its_end():
    batch = MissionBatch(plain(robot_period=5, operator_period=3, n_operators=1), [1])
    batch.step(stay(batch.observations), 2)
    assert len(batch.observations.robots) == 0 == len(batch.observations.operators)
    batch.step(stay(batch.observations), 2)
    assert batch.observations.operators["time"].tolist() == [4.0], "due since 3 s, and sees what is true now"
    batch.step(stay(batch.observations), 2)
    assert batch.observations.robots["robot"].tolist() == [0, 1] and len(batch.observations.operators) == 0
    assert set(batch.observations.robots["time"]) == {6.0}


def test_seconds_of_a_step_are_what_epochs_add_up_to():
    """Nobody who is due in between is asked: the same mission as one whose actors all stay then."""
    steps, epochs = MissionBatch("small", [3]), MissionBatch("small", [3])
    while not steps.over[0]:
        steps.step(stay(steps.observations), 4)
    fly(epochs, stay)
    assert steps.scores() == epochs.scores()


def test_no_seconds_are_the_next_epoch():
    one, other = MissionBatch(BRIEF, [1, 2]), MissionBatch(BRIEF, [1, 2])
    mine, theirs = Wanderer(), Wanderer()
    while not one.over.all():
        one.step(mine(one.observations))
        other.step(theirs(other.observations), 0)
        assert fingerprint(one.state) == fingerprint(other.state)


def test_a_new_mission_is_seen_at_its_start_whatever_the_step():
    batch = MissionBatch(BRIEF, [1, 2])
    while not batch.over.all():
        batch.step(stay(batch.observations), 30)
    batch.restart(0, 6)
    seen = batch.step(stay(batch.observations), 30)
    assert batch.time.tolist() == [0, 60] and set(seen.robots["time"]) == {0.0} and len(seen.operators) == BRIEF.n_operators
    assert np.all(seen.robot_operators["robot"] == NOBODY)
    batch.step(stay(seen), 30)
    assert batch.time.tolist() == [30, 60]
