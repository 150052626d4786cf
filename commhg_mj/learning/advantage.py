"""Time-aware generalised advantage estimation over the seconds between an actor's own decisions (docs/learning.md)."""

import numpy as np


def estimate_advantages(values, rows, rewards, elapsed, over, last_values, gamma, lam, trace="decision") -> np.ndarray:
    """Advantages of decisions, mission and coordination parts apart.

    A reward is discounted by the seconds since the decision: a step's own is given so (`MissionBatch.discount`), and what
    follows the step fades by gamma ** seconds. The trace decays by `lam` a decision, or by lam ** seconds.

    Args:
      values: [S] of arrays [n, 2], the critic's for the decisions of each of S steps.
      rows: [S] of (mission [n], agent [n]) of these decisions.
      rewards: [S, E, 2] of each step, discounted to its beginning. elapsed: [S, E] s. over: [S, E] bool, ended in that step.
      last_values: [E, agents, 2] after the last step.
      gamma: a second. lam: a decision, or a second, as `trace` says.

    Returns:
      [S] of arrays [n, 2].
    """
    reward = np.zeros_like(last_values)  # discounted, from here to the agent's next decision
    seconds = np.zeros(last_values.shape[:2])  # until then
    next_value, next_advantage = last_values.copy(), np.zeros_like(last_values)
    advantages = [None] * len(values)
    for s in reversed(range(len(values))):
        ended = over[s]
        reward[ended], seconds[ended], next_value[ended], next_advantage[ended] = 0.0, 0.0, 0.0, 0.0
        reward = rewards[s][:, None] + gamma ** elapsed[s][:, None, None] * reward
        seconds += elapsed[s][:, None]
        at = rows[s]
        until = seconds[at][:, None]
        fade = gamma**until
        delta = reward[at] + fade * next_value[at] - values[s]
        advantages[s] = delta + (lam if trace == "decision" else lam**until) * fade * next_advantage[at]
        reward[at], seconds[at] = 0.0, 0.0
        next_value[at], next_advantage[at] = values[s], advantages[s]
    return advantages
