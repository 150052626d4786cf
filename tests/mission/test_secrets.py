"""Actors see own state, public attributes, sensed tasks and records; the rest of the state is hidden."""

import copy

import numpy as np
import pytest
from flying import Wanderer, copied, differences, fly, visible_bytes
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import change, limitations, scenarios, seeds

from commhg_mj.base.terms import NOBODY, Activity, Kind
from commhg_mj.mission.batch import MissionBatch, advance_and_observe
from commhg_mj.mission.decide import new_masks
from commhg_mj.mission.observe import UNKNOWN, new_observations
from commhg_mj.policies import POLICIES, prepare
from commhg_mj.scenarios import SCENARIOS

PUBLIC = ["x", "y", "announced", "difficulty", "value", "deadline", "decay"]  # of released tasks
HIDDEN = [
    "reward",
    "tick_reward",
    "pending_value",
    "total_value",
    "switches",
    "incompatibles",
    "conflicts",
    "refusals",
    "messages",
    "seed",
]
ARRAYS = (
    "robots",
    "operators",
    "tasks",
    "beliefs",
    "peers",
    "inboxes",
    "resources",
    "commands",
    "tips",
    "uplinks",
    "downlinks",
    "air",
    "counters",
)


def overwrite(state, source):
    """Copy `source` into the arrays of `state`, which stay where they are."""
    for target, array in zip(state, source):
        target[...] = array


def scramble(state, rng):
    """Random bytes everywhere but in the missions' rules and addresses."""
    for name in ARRAYS:
        array = getattr(state, name)
        array[...] = np.frombuffer(rng.bytes(array.nbytes), array.dtype).reshape(array.shape)
    for name in HIDDEN:
        field = state.missions[name]
        field[...] = rng.integers(0, 1000, field.shape).astype(field.dtype)


def keep_public(state, truth):
    """Give the public facts back: who is aerial, which tasks are released and their announced attributes."""
    state.robots["embodiment"] = truth.robots["embodiment"]
    state.robots["due"] = state.operators["due"] = 0
    state.tasks["released"] = truth.tasks["released"]
    released = truth.tasks["released"] == 1
    for name in PUBLIC:
        state.tasks[name][released] = truth.tasks[name][released]


def keep_robot(state, truth, r):
    """Give back what robot r may know: itself, its uplink, and its tables."""
    for name in ("robots", "beliefs", "peers", "resources", "uplinks"):
        getattr(state, name)[0, r] = getattr(truth, name)[0, r]
    state.robots["due"][0, r] = 1


def keep_operator(state, truth, h):
    """Give back what operator h may know: itself, its downlink, the station's reports of robots and evidence of tasks."""
    for name in ("operators", "downlinks"):
        getattr(state, name)[0, h] = getattr(truth, name)[0, h]
    for name in ("peers", "beliefs"):
        getattr(state, name)[0, -1] = getattr(truth, name)[0, -1]
    state.operators["due"][0, h] = 1


def observe(batch, n_robots, n_operators):
    seen, masks, earned = new_observations(1, batch.scenario), new_masks(1, batch.scenario), np.zeros((1, 2))
    due = advance_and_observe(batch.state.missions, np.zeros(1, int), 1.0, earned, seen, masks)
    assert due == (n_robots, n_operators)
    return type(seen)(*(table[:n] for table, n in zip(seen, [n_robots] * 4 + [n_operators] * 2)))


def assert_nothing_leaks(batch, seed):
    """Every actor's observation stays the same when everything that it cannot know becomes noise."""
    rng, truth = np.random.default_rng(seed), copied(batch.state)
    actors = [(keep_robot, r) for r in np.flatnonzero(truth.robots["activity"][0] != Activity.FAILED)]
    actors += [(keep_operator, h) for h in range(batch.scenario.n_operators)]
    for keep, index in actors:
        shape = (1, 0) if keep is keep_robot else (0, 1)
        views = []
        for noisy in (False, True):
            overwrite(batch.state, truth)
            if noisy:
                scramble(batch.state, rng)
                keep_public(batch.state, truth)
            batch.state.robots["due"] = batch.state.operators["due"] = 0
            keep(batch.state, truth, index)
            views.append(observe(batch, *shape))
        assert differences(*views) == [], f"{keep.__name__.removeprefix('keep_')} {index} sees hidden state"
    overwrite(batch.state, truth)


@settings(max_examples=15)
@given(scenarios(malfunction=0.1), seeds, limitations, st.integers(0, 120))
def test_no_observation_depends_on_hidden_state(scenario, seed, limitation, seconds):
    batch = fly(MissionBatch(scenario, [seed], limitation=limitation), Wanderer(seed % 99), seconds)
    if not batch.over[0]:
        assert_nothing_leaks(batch, seed)


@pytest.mark.parametrize("name", POLICIES)
def test_no_observation_depends_on_hidden_state_under_any_policy(name):
    batch, policy = prepare(name, "small", [11])
    for seconds in (30, 90, 200):
        fly(batch, policy, seconds)
        assert_nothing_leaks(batch, seconds)


def cut_uplink(batch):
    """From now on nothing that a robot says reaches the station."""
    batch.state.missions["rules"]["message_bytes"][:, [Kind.TELEMETRY, Kind.QUERY, Kind.REQUEST]] = 10**6
    in_the_air = np.isin(batch.state.air["kind"], (Kind.TELEMETRY, Kind.QUERY, Kind.REQUEST))
    batch.state.air["due"][in_the_air] = 10**6


def finish(state):
    """Every task that is held is done as soon as its robot is there."""
    end_services(state, 1.0)


def fail(state):
    """Every attempt fails as soon as its robot is there."""
    end_services(state, -1.0)


def end_services(state, chance):
    held = state.tasks["owner"] != NOBODY
    state.tasks["progress"][held], state.tasks["chance"][held] = 1.0, chance


def drop(state):
    """Every lease is over."""
    state.robots["lease_until"] = 0.0


def shatter(state):
    """Every robot that is controlled breaks in the next second."""
    state.missions["rules"]["controlled_hazard"] = 1.0


@pytest.mark.parametrize("happens", [finish, fail, drop, shatter])
@pytest.mark.parametrize("name", [name for name, info in POLICIES.items() if not info.is_privileged])
def test_without_an_uplink_operators_see_the_same_whatever_their_robots_do(name, happens):
    """From a second on no report arrives: operators go on by their own records, to the last bit, for two minutes."""
    scenario = change(SCENARIOS["small"], operator_period=1, malfunction=0.0)
    teams = [prepare(name, scenario, range(12, 18)) for _ in range(2)]
    for batch, policy in teams:
        fly(batch, policy, 100)
        cut_uplink(batch)
    (batch, policy), (other, other_policy) = teams
    assert np.any(batch.state.robots["controller"] != NOBODY)
    happens(other.state)
    differ = set()
    for _ in range(120):
        decisions, other_decisions = policy(batch.observations), other_policy(other.observations)
        seen = [(each.observations.operators, each.observations.operator_reports) for each in (batch, other)]
        assert all(visible_bytes(a) == visible_bytes(b) for a, b in zip(*seen)), f"at {batch.time}"
        batch.step(decisions, seconds=1)
        other.step(other_decisions._replace(operator=decisions.operator), seconds=1)
        differ |= set(differences(batch.state, other.state))
    assert {"robots.activity", "robots.mode", "tasks.done_at"} & differ, "the missions did differ"


def test_the_noise_would_show_in_an_observation_that_used_it():
    """The check itself can fail: what an actor may know, perturbed, changes its observation."""
    batch = fly(MissionBatch("small", [2]), Wanderer(), 60)
    truth = copied(batch.state)
    batch.state.robots["due"], batch.state.operators["due"] = 1, 1
    n, k = batch.scenario.n_robots, batch.scenario.n_operators
    before = observe(batch, n, k)
    batch.state.beliefs["time"] += 1
    batch.state.peers["x"] += 1
    batch.state.operators["fatigue"] += 0.1
    found = differences(before, observe(batch, n, k))
    assert {"robot_tasks.age", "robot_peers.x", "operator_reports.x", "operators.fatigue"} <= set(found)
    overwrite(batch.state, truth)


@settings(max_examples=15)
@given(scenarios(released_at_start=0.3), seeds)
def test_unreleased_tasks_show_nothing(scenario, seed):
    batch = MissionBatch(scenario, [seed])
    wanderer = Wanderer(seed % 99)
    for _ in range(30):
        seen = batch.observations
        if batch.over[0]:
            return
        rows = seen.robot_tasks
        hidden = np.broadcast_to(batch.state.tasks["released"][0] == 0, rows.shape)
        assert np.array_equal(rows["released"] == 0, hidden)
        for name in rows.dtype.names:
            nothing = {"age": UNKNOWN, "claim_age": UNKNOWN, "claimed_by": NOBODY}.get(name, 0)
            assert np.all(rows[name][hidden] == nothing), name
        batch.step(wanderer(seen))


@settings(max_examples=15)
@given(scenarios(), seeds, limitations)
def test_masks_follow_knowledge(scenario, seed, limitation):
    """Believed done, of a believed incompatible type, refused or one's own: masked; everything else is open."""
    batch, wanderer = MissionBatch(scenario, [seed], limitation=limitation), Wanderer(seed % 99, 0.3)
    for _ in range(40):
        seen = batch.observations
        for robot, tasks in zip(seen.robots, seen.robot_tasks):
            compatible = tasks["type"] != 1 - robot["embodiment"]
            is_open = (tasks["released"] == 1) & (tasks["status"] != 2) & compatible & (tasks["refused"] == 0)
            is_open &= np.arange(len(tasks)) != robot["task"]
            assert np.array_equal(tasks["legal"] == 1, is_open & (robot["can_idle"] == 1) & (robot["stand_left"] == 0))
            assert not robot["can_assist"] or (robot["task"] != NOBODY and robot["controller"] == NOBODY)
        batch.step(wanderer(seen))


@pytest.mark.parametrize("name", [name for name, info in POLICIES.items() if not info.is_privileged])
def test_policies_decide_from_observations_alone(name):
    """Scrambled true state (but for the public rules), same observations: the same decisions."""
    batch, policy = prepare(name, "small", [3, 4])
    rng = np.random.default_rng(0)
    for _ in range(60):
        seen, truth = batch.observations, copied(batch.state)
        same = copy.deepcopy(policy)  # with all that it remembers
        decisions = policy(seen)
        scramble(batch.state, rng)
        again = same(seen)
        overwrite(batch.state, truth)
        assert all(np.array_equal(a, b) for a, b in zip(decisions, again))
        batch.step(decisions)
