"""What became of a mission's messages, and how old what everybody knew was."""

import hashlib

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ...base.terms import ROUTES, Activity, Fate
from ...mission.score import Score

LONGEST = 60  # s: latencies are counted up to here
USABLE = 50  # percent delivered: a link that connects


def mission_record(score: Score, trace) -> dict:
    """One mission in numbers, lists and one digest; plain JSON."""
    robot_minutes = trace.scenario.n_robots * max(1, trace.ticks) / 60
    record = {
        "seed": trace.seed,
        "digest": digest(trace),
        "broadcast_rate": float(trace.robot_broadcast.sum() / robot_minutes),
        "query_rate": float(np.sum(trace.robot_query >= 0) / robot_minutes),
    }
    for name in (
        "twcr",
        "completion",
        "on_time",
        "control_time",
        "fatigue",
        "malfunctions",
        "refusals",
        "duration",
        "bytes_sent",
    ):
        record[name] = getattr(score, name)
    for kind, counts in score.messages.items():
        ended = counts["attempted"] - counts["underway"]
        record |= {f"{kind}_ended": ended, f"{kind}_delivered": counts["delivered"]}
    record |= ages("peer", trace.records["peer_time"][:, :-1], trace)
    record |= ages("station", trace.records["peer_time"][:, -1:], trace)
    record |= connectivity(trace)
    record["latency"] = {route: latencies(trace, kinds) for route, kinds in ROUTES.items()}
    return record


def digest(trace) -> str:
    """A fingerprint of everything that happened: equal for bit-identical missions."""
    found = hashlib.sha256()
    for name in (
        "robot_xy",
        "robot_task",
        "operator_fatigue",
        "task_done",
        "message_ended",
        "message_fate",
        "message_late",
        "reward",
    ):
        found.update(np.ascontiguousarray(getattr(trace, name)).tobytes())
    return found.hexdigest()


def ages(who: str, times, trace) -> dict:
    """Mean, 95th percentile and peak of the age of information [s] of robots' reports.

    Args:
      times: [samples, receivers, R] evidence times, -1 where nothing was received: as old as the mission.
    """
    samples, receivers, robots = times.shape
    now = np.arange(samples)[:, None, None] * trace.link_period
    age = now - np.maximum(times, 0)
    own = np.zeros((receivers, robots), bool) if who == "station" else np.eye(receivers, robots, dtype=bool)
    alive = trace.robot_activity[:: trace.link_period] != Activity.FAILED
    counted = age[~own[None] & alive[:, None, :]] if who == "station" else age[~own[None] & alive[:, None, :] & alive[:, :, None]]
    if not counted.size:
        return {f"{who}_age_{name}": 0.0 for name in ("mean", "p95", "peak")}
    return {
        f"{who}_age_mean": float(counted.mean()),
        f"{who}_age_p95": float(np.percentile(counted, 95)),
        f"{who}_age_peak": float(counted.max()),
    }


def connectivity(trace) -> dict:
    """Connected components of the robots over time, and the share of them that reaches the station."""
    alive = trace.robot_activity[:: trace.link_period] != Activity.FAILED
    components = []
    for quality, there in zip(trace.link_quality, alive):
        usable = quality[there][:, :-1][:, there] >= USABLE
        components.append(int(connected_components(csr_array(usable), directed=False, return_labels=False)) if there.any() else 0)
    reach = (trace.link_quality[:, :, -1] >= USABLE)[alive]
    return {
        "components": components,
        "components_mean": float(np.mean(components)),
        "connected_share": float(np.mean(np.array(components) <= 1)),
        "station_reach": float(reach.mean()) if reach.size else 0.0,
    }


def latencies(trace, kinds) -> dict:
    """Messages delivered after 0, 1, … LONGEST s in queue and air, and those that met another fate."""
    ours = np.isin(trace.message_kind, kinds) & (trace.message_fate != Fate.UNDERWAY)
    delivered = ours & (trace.message_fate == Fate.DELIVERED)
    seconds = trace.message_ended[delivered] - trace.message_queued[delivered]
    return {
        "delivered_after": np.bincount(seconds, minlength=LONGEST + 1)[: LONGEST + 1].tolist(),
        "expired": int(np.sum(ours & (trace.message_fate == Fate.EXPIRED))),
        "ended": int(ours.sum()),
    }
