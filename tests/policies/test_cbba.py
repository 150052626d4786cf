"""CBBA: what travels, who gives way, and the score it bids by."""

import itertools

import numpy as np
import pytest
from flying import fly, plain

from commhg_mj.base.terms import IDLE, NOBODY
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.policies import prepare
from commhg_mj.policies.cbba import BUNDLE, Cbba, outbids, score, with_bids
from commhg_mj.scenarios import SCENARIOS

STATIC = dict(
    n_operators=0, released_at_start=1.0, change_share=0.0, malfunction=0.0, robot_period=1, initial_phase=0.0,
    deadline=(1.0, 1.0), decay=(80.0, 240.0), time_limit=2000,
)  # fmt: skip


def bargain(seed, n_uav, n_ugv, n_tasks, rounds=15):
    """Robots that stand still under perfect links and only bid; returns (batch, policy) with the tables of the end."""
    batch = MissionBatch(with_bids(plain(n_uav=n_uav, n_ugv=n_ugv, n_tasks=n_tasks, **STATIC)), [seed], "perfect")
    policy = Cbba(batch)
    for _ in range(rounds):
        decisions = policy(batch.observations)
        batch.step(decisions._replace(task=np.full(len(decisions.task), IDLE, np.int32)), seconds=1)
    policy(batch.observations)
    return batch, policy


def value(batch, r, path):
    """What a path is worth to robot r now, by the score that bids are made of."""
    row = list(batch.observations.robots["robot"]).index(r)
    seen, order = batch.observations, np.full(BUNDLE + 1, NOBODY)
    order[: len(path)] = path
    return score(batch.rules[0], seen.robots[row], seen.robot_tasks[row], order, len(path))


def best_sum(batch, r, tasks):
    return max(value(batch, r, path) for path in itertools.permutations(tasks))


def optimum(batch):
    """The largest sum of scores over all ways to give each task to at most one robot, in any order."""
    seen = batch.observations
    n, n_tasks = len(seen.robots), seen.robot_tasks.shape[1]
    worth = {}
    for r in range(n):
        legal = [j for j in range(n_tasks) if seen.robot_tasks["legal"][list(seen.robots["robot"]).index(r), j]]
        for size in range(min(BUNDLE, len(legal)) + 1):
            for tasks in itertools.combinations(legal, size):
                worth[r, tasks] = best_sum(batch, r, tasks) if tasks else 0.0
    best = 0.0
    for owners in itertools.product(range(n + 1), repeat=n_tasks):
        parts = [tuple(j for j in range(n_tasks) if owners[j] == r) for r in range(n)]
        if all((r, part) in worth for r, part in enumerate(parts)):
            best = max(best, sum(worth[r, part] for r, part in enumerate(parts)))
    return best


@pytest.mark.parametrize("team", [(2, 0, 4), (1, 1, 5), (2, 1, 5)])
def test_on_a_static_instance_with_perfect_links_bids_agree_and_are_at_least_half_of_the_optimum(team):
    shares = []
    for seed in range(4):
        batch, policy = bargain(seed, *team)
        tables, paths = policy.auction.tables, policy.auction.path[0]
        chosen = [j for path in paths for j in path if j != NOBODY]
        assert len(chosen) == len(set(chosen)), "nobody bids for what another has won"
        assert np.all(tables.winner[0] == tables.winner[0, 0]), "consensus"
        reached = sum(value(batch, r, [j for j in path if j != NOBODY]) for r, path in enumerate(paths))
        shares.append(reached / optimum(batch))
    assert min(shares) >= 0.5 and np.mean(shares) > 0.9, shares


def test_marginal_gains_diminish_mostly_but_not_always_so_that_bids_are_bent_to_fall():
    """The half of the optimum is proven for scores whose gains diminish; this one's do in most cases, not in all."""
    batch, _ = bargain(1, 1, 0, 8, rounds=1)
    legal = np.flatnonzero(batch.observations.robot_tasks["legal"][0])
    holds = []
    for first, second, added in itertools.permutations(legal, 3):
        with_one = best_sum(batch, 0, (first, added)) - best_sum(batch, 0, (first,))
        with_two = best_sum(batch, 0, (first, second, added)) - best_sum(batch, 0, (first, second))
        holds.append(with_two <= with_one + 1e-12)
    assert 0.8 < np.mean(holds) < 1.0, np.mean(holds)


def test_bids_fall_along_a_bundle():
    batch, policy = bargain(3, 1, 0, 6, rounds=1)
    tables, path = policy.auction.tables, policy.auction.path[0, 0]
    assert (path != NOBODY).all()
    total = sum(tables.bid[0, 0, j] for j in path)
    assert 0 < total <= value(batch, 0, list(path)) * 1.1 + 1e-9


def test_the_higher_bid_wins_and_among_equals_the_lower_index():
    assert outbids(2.0, 1, 1.0, 0) and not outbids(1.0, 1, 2.0, 0)
    assert outbids(1.0, 0, 1.0, 1) and not outbids(1.0, 1, 1.0, 0)


def test_bids_take_the_room_of_half_of_the_task_records():
    batch, _ = prepare("cbba", "small", [1])
    assert batch.scenario.communication.broadcast_records == SCENARIOS["small"].communication.broadcast_records // 2
    assert prepare("greedy", "small", [1])[0].scenario == SCENARIOS["small"]
    assert Cbba(batch).auction.tasks.shape[3] == 2 * batch.scenario.communication.broadcast_records


def test_a_bid_is_known_to_whom_a_broadcast_reached_and_to_nobody_else():
    """Without any robot-robot message, nobody holds another's bid; with perfect ones, bids are held soon."""
    scenario = plain(n_uav=3, n_tasks=6, robot_period=1, initial_phase=0.0, n_operators=0, range=(1e-6, 1e-6, 1e-6))
    held = {}
    for links in ("abstract", "perfect"):
        batch = MissionBatch(with_bids(scenario), [5], links)
        policy = Cbba(batch)
        fly(batch, policy, seconds=20)
        winners = policy.auction.tables.winner[0]
        held[links] = sum(int(winners[r, j] not in (NOBODY, r)) for r in range(3) for j in range(6))
    assert held["abstract"] == 0 and held["perfect"] > 0
