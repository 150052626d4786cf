"""Every pair of radios along a recorded mission, seen by the abstract and by the ray-cast model."""

import numpy as np

from ..base.arguments import instance, whole
from ..base.terms import Activity
from ..mission.batch import LONGEST_STEP
from ..mission.trace import Trace
from ..models.world import make_world
from ..radio.world_links import WorldLinks

CLASSES = ("UAV-UAV", "UAV-UGV", "UGV-UGV", "robot-station")
STATION = 3  # index into CLASSES
PAIR = np.dtype(
    [("time", "i4"), ("a", "i2"), ("b", "i2"), ("kind", "i1"), ("in_range", "?"),
     ("planar_forest", "f4"), ("planar_mountain", "f4"), ("planar_passing", "f4"), ("planar_delivered", "f4"),
     ("fit_delivered", "f4"), ("ray_forest", "f4"), ("ray_blocked", "?"), ("ray_excess", "f4"), ("ray_delivered", "f4")]
)  # fmt: skip


def links_of(trace, period=1) -> np.ndarray:
    """[samples x pairs] PAIR of one mission, every `period` seconds, in order of time.

    Args:
      trace: a recorded mission; its positions count, its own link model does not.

    Robot `b` = R is the station. A robot that failed has no links. `in_range` is the planar distance within the
    limitation level's range; without it the abstract delivery is 0. Lengths in m, excess loss in dB.
    """
    instance("trace", trace, Trace)
    period = whole("period", period, 1, LONGEST_STEP)
    scenario, world = trace.scenario, make_world(trace.scenario, trace.seed)
    n = scenario.n_robots
    models = [WorldLinks(world, model, trace.limitation) for model in ("abstract", "abstract-fit", "raycast")]
    times = np.arange(0, len(trace.robot_xy), period)
    xy, alive = trace.robot_xy[times].astype(float), trace.robot_activity[times] != Activity.FAILED
    embodiments = np.where(np.arange(n) < scenario.n_uav, 0, 1)
    antennas = models[0].robot_antennas(xy.reshape(-1, 2), np.tile(embodiments, len(times))).reshape(len(times), n, 3)
    a, b = np.triu_indices(n + 1, 1)  # robot n: the station
    kinds = np.where(b < n, embodiments[a] + np.append(embodiments, 0)[b], STATION)
    there = alive[:, a] & np.c_[alive, np.ones(len(times), bool)][:, b]
    sample, pair = np.nonzero(there)
    rows = np.zeros(len(sample), PAIR)
    rows["time"], rows["a"], rows["b"], rows["kind"] = times[sample], a[pair], b[pair], kinds[pair]
    for is_station in (False, True):
        chosen = (rows["kind"] == STATION) == is_station
        starts, ends = antennas[sample[chosen], a[pair[chosen]]], None
        if not is_station:
            ends = antennas[sample[chosen], b[pair[chosen]]]
        rows[chosen] = _see(rows[chosen], models, starts, ends)
    return rows


def _see(rows, models, starts, ends):
    """The rows with what the models say of links between antennas; no `ends`: to the station."""
    transport = models[0].world.scenario.communication
    if ends is None:
        seen = [links.to_station(starts, transport.telemetry_bytes) for links in models]
        rows["in_range"] = True
    else:
        seen = [links.between(starts, ends, transport.broadcast_bytes) for links in models]
        rows["in_range"] = seen[0]["metres"] <= models[0].rules["range"]
    flat, fit, cast = seen
    rows["planar_forest"], rows["planar_mountain"], rows["planar_passing"] = flat["forest"], flat["mountain"], flat["passing"]
    rows["planar_delivered"] = flat["on_time"] + flat["late"]
    rows["fit_delivered"] = fit["on_time"] + fit["late"]
    rows["ray_forest"], rows["ray_blocked"] = np.nan_to_num(cast["forest"]), cast["is_blocked"] == 1
    rows["ray_excess"] = np.nan_to_num(cast["foliage"] + cast["diffraction"] + cast["shadowing"])
    rows["ray_delivered"] = cast["on_time"] + cast["late"]
    return rows
