"""First targets by a method: in turn, none twice, and as likely as the turns say."""

import numpy as np
import pytest
import torch
from flying import fly
from learners import SHORT, run, shaken
from strategies import change

from commhg_mj.base.terms import IDLE
from commhg_mj.learning.first_targets import TIME, assign, beginners, take_turns, without_initializer
from commhg_mj.learning.graphs import GraphBuilder
from commhg_mj.learning.learned_policy import LearnedPolicy
from commhg_mj.learning.registry import METHODS, find_method
from commhg_mj.learning.weights import save_weights
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.policies import POLICIES, conditions_of
from commhg_mj.scenarios import SCENARIOS, load_scenario

OWN = without_initializer(change(SHORT, initial_phase=0.5))
PICKING = [name for name in METHODS if METHODS[name].picks_first]


def graphs_of(scenario, seeds=(1, 2)):
    batch = MissionBatch(scenario, seeds)
    return batch, GraphBuilder(batch).robots(batch.observations)


def test_nobody_takes_what_was_taken_and_masks_say_what_was_open():
    _, graphs = graphs_of(OWN)
    rng = np.random.default_rng(0)
    fresh, picks = take_turns(graphs, rng.random(len(graphs.task)))
    assert len(beginners(graphs)) == len(picks) == len(graphs.itself) and (picks >= 0).all()
    for mission in (0, 1):
        rows = np.flatnonzero(graphs.mission == mission)
        tasks = graphs.task[picks[rows]]
        assert len(set(tasks)) == len(rows)
        for i, row in enumerate(rows):
            edges = slice(graphs.task_ptr[row], graphs.task_ptr[row + 1])
            left = graphs.task_legal[edges] & ~np.isin(graphs.task[edges], tasks[:i])
            assert np.array_equal(fresh.task_legal[edges], left) and fresh.keep_idle[row].tolist() == [False, False]


def test_who_finds_nothing_left_idles():
    _, graphs = graphs_of(change(OWN, n_tasks=2, n_uav=4, n_ugv=0, released_at_start=1.0, n_operators=0))
    fresh, picks = take_turns(graphs, np.zeros(len(graphs.task)))
    assert (picks[graphs.mission == 0] == IDLE).sum() == 2 and fresh.keep_idle[picks == IDLE].tolist() == [[False, True]] * 4


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_assignment_to_imitate_is_the_initializers(name):
    """Where the public types are the true ones, as they are at t = 0 but for what robots see at the station."""
    scenario = SCENARIOS[name]
    batch, graphs = graphs_of(without_initializer(scenario), range(4))
    _, picks = take_turns(graphs, assign(graphs))
    with_one = MissionBatch(scenario, range(4))
    targets = with_one.state.robots["task"].flatten()
    assert np.mean(graphs.task[picks] == targets) > 0.9
    assert np.all(batch.state.robots["task"] < 0)


def test_a_robots_own_first_target_is_prescribed_like_the_initializers():
    batch = MissionBatch(OWN, [1, 2])
    assert (batch.state.robots["task"] < 0).all() and not batch.observations.robots["can_keep"].any()
    policy = POLICIES["greedy"].make(batch)
    batch.step(policy(batch.observations))
    everyone = batch.observe_everyone().robots
    holders = everyone[everyone["task"] >= 0]
    assert len(holders) > 2 and holders["prescribed"].all() and not holders["can_idle"].any()
    ends = MissionBatch(without_initializer(change(SHORT, initial_phase=0.0)), [1, 2])
    fly(ends, POLICIES["greedy"].make(ends), seconds=5)
    assert not ends.state.robots["prescribed"].any()


@pytest.mark.parametrize("name", PICKING)
def test_a_method_that_picks_is_flown_without_the_initializer_and_learns_from_its_picks(name, tmp_path):
    torch.manual_seed(0)
    method, path = shaken(find_method(name)()), str(tmp_path / "weights.safetensors")
    save_weights(method, path, {})
    assert conditions_of(path, load_scenario("small"), "raycast")[0].decisions.first_targets == "policy"
    batch = MissionBatch(OWN, range(8))
    LearnedPolicy(method, batch)
    batch.step(LearnedPolicy(method, batch)(batch.observations))
    tasks = batch.state.robots["task"]
    assert (tasks >= 0).all() and all(len(set(row)) == len(row) for row in tasks), "a task was picked twice"
    assert len({tuple(row) for row in tasks}) > 1
    training = run(tmp_path / "run", name, SHORT, first_updates=0)
    shaken(training.method)
    parts = training.method.critic, training.method.scale
    data = training.collector.collect(60, *parts, 0.99, 0.95)
    begins = data.robots.itself[:, TIME] == 0.0
    assert begins.sum() >= 6 and data.free[0][begins].any() and (data.robot_choices.task[begins] != -1).any()
    assert (data.log_probs[0][begins & data.free[0]] < 0).all()
    with_one = LearnedPolicy(method, other := MissionBatch(SHORT, range(4)))
    other.step(with_one(other.observations))  # where the initializer is at work its targets stay
