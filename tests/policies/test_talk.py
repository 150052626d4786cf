"""Rules in place of what a policy says and asks."""

import numpy as np
import pytest
from flying import fingerprint, fly

from commhg_mj.base.terms import NOBODY, Kind
from commhg_mj.policies import find_policy, prepare
from commhg_mj.policies.talk import TALKS


def decisions_of(name, seconds=200):
    """What is decided in a mission, step by step: observations and decisions."""
    batch, policy = prepare(name, "small", [3, 4])
    told = []

    def listen(seen):
        decisions = policy(seen)
        told.append((seen, decisions))
        return decisions

    fly(batch, listen, seconds)
    return batch, told


@pytest.mark.parametrize("base", ["greedy", "planner", "cbba", "random"])
def test_only_what_is_replaced_differs(base):
    batch, own = prepare(base, "small", [3])
    _, other = prepare(f"{base}+always-asks", "small", [3])
    asked = 0
    while batch.time[0] < 100:
        seen = batch.observations
        mine, theirs = own(seen), other(seen)
        for name in ("task", "broadcast", "operator"):
            assert np.array_equal(getattr(mine, name), getattr(theirs, name))
        is_open = seen.robot_operators["legal"].any(axis=1)
        assert np.array_equal(theirs.query != NOBODY, is_open) and not np.any(theirs.assist & is_open)
        asked += is_open.sum()
        batch.step(mine)
    assert asked > 0


def test_nobody_broadcasts_or_everybody_by_the_clock():
    batch, _ = decisions_of("planner+no-broadcast")
    assert batch.state.counters["attempted"][:, Kind.BROADCAST].sum() == 0
    _, told = decisions_of("planner+broadcasts-every-25")
    for seen, decisions in told:
        robots = seen.robots
        assert np.array_equal(decisions.broadcast, (robots["can_broadcast"] == 1) & (robots["since_broadcast"] >= 25))


def test_chances_are_drawn_as_often_and_by_the_mission_alone():
    _, told = decisions_of("planner+asks-at-random-0.3", 600)
    is_open = np.concatenate([seen.robot_operators["legal"].any(axis=1) for seen, _ in told])
    asks = np.concatenate([decisions.query != NOBODY for _, decisions in told])
    assert abs(asks[is_open].mean() - 0.3) < 4 * np.sqrt(0.21 / is_open.sum())
    _, told = decisions_of("planner+broadcasts-at-random-0.2", 600)
    can_speak = np.concatenate([seen.robots["can_broadcast"] == 1 for seen, _ in told])
    speaks = np.concatenate([decisions.broadcast for _, decisions in told])
    assert abs(speaks[can_speak].mean() - 0.2) < 4 * np.sqrt(0.16 / can_speak.sum()) and not speaks[~can_speak].any()
    for rule in ("asks", "broadcasts"):
        assert len({fingerprint(decisions_of(f"planner+{rule}-at-random-0.3")[0].state) for _ in range(2)}) == 1


def test_rules_follow_one_another():
    batch, _ = decisions_of("greedy+no-broadcast+no-query", 300)
    assert batch.state.counters["attempted"][:, [Kind.BROADCAST, Kind.QUERY]].sum() == 0


@pytest.mark.parametrize("rule", ["asks-at-random-2", "asks-at-random-often", "broadcasts-at-random--1", "broadcasts-every-0"])
def test_impossible_numbers_are_refused_by_name(rule):
    with pytest.raises(ValueError, match=f"{rule}: .*needs a number"):
        find_policy(f"planner+{rule}")


def test_unknown_rules_are_refused_with_those_there_are():
    with pytest.raises(ValueError, match="'planner.shouts'.*" + ".*".join(TALKS)):
        find_policy("planner+shouts")
    with pytest.raises(ValueError, match="nobody"):
        find_policy("nobody+no-query")


def test_the_privileged_stay_privileged():
    assert find_policy("omniscient+no-query").is_privileged
