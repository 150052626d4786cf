"""How a mission went: the paper's metric and everything reported beside it (docs/benchmark.md, section 9)."""

from dataclasses import dataclass

import numpy as np

from ..base.elementary_functions import exp
from ..base.terms import Activity, Fate, Kind
from .state import LUCK


@dataclass(frozen=True)
class Score:
    """One mission. Shares in [0, 1], times in s, `messages[kind]` counts by what happened to them."""

    twcr: float  # Timely Weighted Completion Ratio (paper, eq. 5)
    lateness_loss: float  # share of the total value that completed tasks lost to lateness
    completion: float  # completed tasks / all tasks
    on_time: float  # tasks completed by their deadline / all tasks
    mean_lateness: float  # s after the deadline, mean over late completions, 0 without any
    reward_mission: float
    reward_coordination: float
    control_time: float  # share of the mission that a mean operator controlled
    fatigue: float  # mean over operators at the end
    malfunctions: int
    switches: int
    incompatibles: int
    conflicts: int
    refusals: int
    duration: int  # s
    bytes_sent: int
    station_age: float  # s, mean age of the station's robot reports
    peer_age: float  # s, mean age of peers' reports at robots
    luck: dict  # by how much services went better than their chances; what differs by luck alone (service.py: count_luck)
    messages: dict


def twcr(value, deadline, decay, done_at) -> float:
    """Timely Weighted Completion Ratio from arrays [T]; `done_at` < 0 marks tasks never completed."""
    late = np.maximum(0.0, done_at - deadline)
    return float(np.sum(value * (done_at >= 0) * exp(-late / decay)) / np.sum(value))


def score_missions(state) -> list[Score]:
    """Scores of all missions of a batch, from the simulator's own record of completions."""
    return [score_mission(state, e) for e in range(len(state.missions))]


def score_mission(state, e: int) -> Score:
    """The score of mission e of a batch."""
    mission, tasks, operators = state.missions[e], state.tasks[e], state.operators[e]
    done = tasks["done_at"] >= 0
    late = np.maximum(0.0, tasks["done_at"] - tasks["deadline"])[done]
    ratio = twcr(tasks["value"], tasks["deadline"], tasks["decay"], tasks["done_at"])
    now = int(mission["now"])
    return Score(
        twcr=ratio,
        lateness_loss=float(tasks["value"][done].sum() / tasks["value"].sum()) - ratio,
        completion=float(done.mean()),
        on_time=float(np.sum(late == 0) / len(tasks)),
        mean_lateness=float(late[late > 0].mean()) if np.any(late > 0) else 0.0,
        reward_mission=float(mission["reward"][0]),
        reward_coordination=float(mission["reward"][1]),
        control_time=float(operators["control_time"].mean() / max(1, now)) if len(operators) else 0.0,
        fatigue=float(operators["fatigue"].mean()) if len(operators) else 0.0,
        malfunctions=int(np.sum(state.robots[e]["activity"] == Activity.FAILED)),
        switches=int(mission["switches"]),
        incompatibles=int(mission["incompatibles"]),
        conflicts=int(mission["conflicts"]),
        refusals=int(mission["refusals"]),
        duration=now,
        bytes_sent=int(state.counters[e]["bytes"].sum()),
        station_age=_mean_age(state.inboxes[e, -1:]),
        peer_age=_mean_age(state.inboxes[e, :-1]),
        luck=dict(zip(LUCK, mission["luck"].tolist())),
        messages={kind.name.lower(): _message_counts(state.counters[e, kind]) for kind in Kind},
    )


def _mean_age(inboxes):
    return float(inboxes["age_sum"].sum() / max(1, inboxes["samples"].sum()))


def _message_counts(counters):
    counts = {name: int(counters[name]) for name in ("attempted", "sent", "bytes", "late")}
    counts |= {fate.name.lower(): int(counters["fate"][fate]) for fate in Fate}
    return counts | {"mean_latency": int(counters["latency_sum"]) / max(1, counts["delivered"])}
