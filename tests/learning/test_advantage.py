"""Advantages against a slow walk along every agent's own decisions."""

import numpy as np
import pytest

from commhg_mj.learning.advantage import estimate_advantages

GAMMA, LAM = 0.97, 0.9


def history(seed, n_steps=40, n_missions=3, n_agents=4, end=0.08):
    """Random (values, rows, rewards, elapsed, over, last_values): after its end a mission begins anew, idle for a step."""
    rng = np.random.default_rng(seed)
    over = rng.random((n_steps, n_missions)) < end
    fresh = np.vstack([np.zeros(n_missions, bool), over[:-1]])
    over &= ~fresh
    fresh = np.vstack([np.zeros(n_missions, bool), over[:-1]])
    elapsed = rng.integers(0, 12, (n_steps, n_missions)) * ~fresh
    rewards = rng.normal(size=(n_steps, n_missions, 2)) * ~fresh[..., None]
    decides = (rng.random((n_steps, n_missions, n_agents)) < 0.4) & ~fresh[..., None]
    rows = [np.nonzero(step) for step in decides]
    values = [rng.normal(size=(len(mission), 2)) for mission, _ in rows]
    last = rng.normal(size=(n_missions, n_agents, 2)) * ~over[-1][:, None, None]
    return values, rows, rewards, elapsed, over, last


def slowly(values, rows, rewards, elapsed, over, last, gamma, lam, trace="decision"):
    """The definition: a sum of discounted errors over the agent's later decisions of the same mission."""
    n_steps = len(values)
    decisions = [{(e, a): i for i, (e, a) in enumerate(zip(*at))} for at in rows]

    def error(s, agent):
        """(its temporal difference, its next decision's step or None, by how much what follows fades)."""
        e, total, seconds = agent[0], 0.0, 0
        for q in range(s, n_steps):
            if q > s and agent in decisions[q]:
                follows = gamma**seconds * values[q][decisions[q][agent]]
                fade = lam if trace == "decision" else lam**seconds
                return total + follows - values[s][decisions[s][agent]], q, fade * gamma**seconds
            total = total + gamma**seconds * rewards[q][e]
            seconds += elapsed[q][e]
            if over[q][e]:
                return total - values[s][decisions[s][agent]], None, 0.0
        return total + gamma**seconds * last[agent] - values[s][decisions[s][agent]], None, 0.0

    result = [np.zeros_like(v) for v in values]
    for s in range(n_steps):
        for agent, i in decisions[s].items():
            at, weight = s, 1.0
            while at is not None:
                delta, at, fade = error(at, agent)
                result[s][i] += weight * delta
                weight *= fade
    return result


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("end", [0.0, 0.08, 0.4])
@pytest.mark.parametrize("trace", ["decision", "second"])
def test_advantages_are_those_of_the_slow_walk(seed, end, trace):
    data = history(seed, end=end)
    for fast, slow in zip(estimate_advantages(*data, GAMMA, LAM, trace), slowly(*data, GAMMA, LAM, trace)):
        np.testing.assert_allclose(fast, slow, rtol=1e-9, atol=1e-12)


def test_seconds_count_not_decisions():
    values, rows, rewards, elapsed, over, last = history(0)
    by_seconds = estimate_advantages(values, rows, rewards, elapsed, over, last, GAMMA, LAM)
    by_decision = estimate_advantages(values, rows, rewards, np.ones_like(elapsed), over, last, GAMMA, LAM)
    assert not np.allclose(np.concatenate(by_seconds), np.concatenate(by_decision), rtol=0.05)


def test_a_coming_mission_pays_nothing_into_the_one_before():
    values, rows, rewards, elapsed, over, last = history(3, end=0.2)
    before = estimate_advantages(values, rows, rewards, elapsed, over, last, GAMMA, LAM)
    end = {e: int(np.flatnonzero(over[:, e])[0]) for e in range(3)}
    changed = rewards.copy()
    for e, s in end.items():
        changed[s + 1 :, e] += 100.0
    after = estimate_advantages(values, rows, changed, elapsed, over, last + 100.0, GAMMA, LAM)
    for s, (missions, _) in enumerate(rows):
        earlier = np.array([s <= end[e] for e in missions], bool)
        assert np.array_equal(before[s][earlier], after[s][earlier])
        assert not np.any(np.isclose(before[s][~earlier], after[s][~earlier]))


def test_without_a_trace_only_the_next_value_counts_and_with_a_full_one_none():
    """lam = 1: return minus value, whatever the critic says of later decisions."""
    values, rows, rewards, elapsed, over, last = history(1, end=0.0)
    full = estimate_advantages(values, rows, rewards, elapsed, over, last, GAMMA, 1.0)
    others = [v + 5.0 for v in values]
    again = estimate_advantages(others, rows, rewards, elapsed, over, last, GAMMA, 1.0)
    for one, other in zip(full, again):
        np.testing.assert_allclose(one - other, 5.0)
