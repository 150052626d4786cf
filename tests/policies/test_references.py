"""Random is uniform over what the masks leave open; the references rank as they should."""

import numpy as np
import pytest
from flying import fly, plain

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, REST
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.mission.decide import Decisions
from commhg_mj.policies import POLICIES, PolicyInfo, find_policy, prepare
from commhg_mj.policies.random import Random


def drawn(batch, times=10):
    """What Random decides of what is seen now, with some seeds a mission, one after the other."""
    random, found = Random(batch), []
    for k in range(times):
        random.seeds = np.arange(k * len(batch.seeds), (k + 1) * len(batch.seeds), dtype=np.uint64)
        found.append(random(batch.observations))
    return Decisions(*map(np.concatenate, zip(*found)))


def test_random_is_uniform_over_open_choices():
    n = 3000
    batch = MissionBatch(plain(n_uav=1, n_operators=2, n_tasks=3, time_limit=30), range(n // 10), "abstract")
    decisions = drawn(batch)
    assert len(decisions.task) == n
    open_tasks = 2 + batch.observations.robot_tasks["legal"][0].sum()
    for j in (KEEP, IDLE):
        assert abs(np.mean(decisions.task == j) - 1 / open_tasks) < 4 * np.sqrt(0.25 / n)
    for query in (NOBODY, 0, 1):
        assert abs(np.mean(decisions.query == query) - 1 / 3) < 4 * np.sqrt(0.25 / n)
    silent = decisions.query == NOBODY
    assert not decisions.assist[~silent].any() and abs(decisions.assist[silent].mean() - 0.5) < 5 * np.sqrt(
        0.25 * 3 / n
    )
    assert not decisions.broadcast.any(), "there is nobody to hear it"
    assert np.all(decisions.operator == REST), "nobody has been heard of"
    while len(batch.observations.operators) == 0 or not batch.observations.operator_reports["legal"].all():
        batch.step(stay(batch.observations), seconds=1)
    operator = drawn(batch).operator
    for choice in (REST, 0):
        assert abs(np.mean(operator == choice) - 1 / 2) < 4 * np.sqrt(0.25 / len(operator))


def test_random_speaks_half_of_the_time():
    decisions = drawn(MissionBatch(plain(n_uav=2, time_limit=30), range(150), "abstract"))
    assert len(decisions.broadcast) == 3000 and abs(decisions.broadcast.mean() - 0.5) < 4 * np.sqrt(0.25 / 3000)


def mean_twcr(name, n=24, **kwargs):
    batch, policy = prepare(name, "small", range(n), **kwargs)
    return np.array([score.twcr for score in fly(batch, policy).scores()])


def test_omniscient_beats_greedy_and_greedy_beats_random():
    scores = {name: mean_twcr(name).mean() for name in ("random", "greedy", "omniscient")}
    assert scores["random"] + 0.1 < scores["greedy"] < scores["omniscient"] - 0.05


def test_only_the_omniscient_reference_is_privileged_and_free_to_speak():
    assert [name for name, info in POLICIES.items() if info.is_privileged] == ["omniscient"]
    batch, _ = prepare("omniscient", "small", [1])
    assert batch.links == "perfect" and batch.scenario.decisions.robot_period == 1
    assert batch.scenario.communication.telemetry_period == 1
    batch, _ = prepare("greedy", "small", [1])
    assert batch.links == "raycast" and batch.scenario.decisions.robot_period == 10


def test_a_privileged_policy_of_ones_own_has_the_same_idealised_conditions(monkeypatch):
    monkeypatch.setitem(POLICIES, "seer", PolicyInfo(POLICIES["omniscient"].make, is_privileged=True))
    (one, _), (other, _) = (prepare(name, "small", [1], links="abstract") for name in ("seer", "omniscient"))
    assert one.scenario == other.scenario and one.links == other.links == "perfect"


def test_unknown_policies_are_refused():
    known = "random, greedy, greedy.no-query, cbba, planner, omniscient"
    with pytest.raises(ValueError, match=f"unknown policy 'clever': use {known}"):
        find_policy("clever")
