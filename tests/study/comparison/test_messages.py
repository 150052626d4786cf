"""What a mission's record says of its messages, ages and connectivity, recounted from its trace."""

import dataclasses
import json

import numpy as np
import pytest
from flying import Wanderer, flown
from strategies import change

from commhg_mj.base.terms import Activity, Fate, Kind
from commhg_mj.mission.trace import make_traces
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.study.comparison.message_counts import LONGEST, ROUTES, ages, connectivity, digest, latencies, mission_record

SCENARIO = change(
    SCENARIOS["small"], n_tasks=8, time_limit=100, n_uav=3, malfunction=0.6, forest_share=0.3, range=(0.2, 0.15, 0.1)
)  # fmt: skip
OWN = ("twcr", "completion", "on_time", "control_time", "fatigue", "malfunctions", "refusals", "duration", "bytes_sent")


@pytest.fixture(scope="module")
def batch():
    return flown(SCENARIO, [2], Wanderer(1), links="raycast", record=True)


@pytest.fixture(scope="module")
def trace(batch):
    return make_traces(batch, "wanderer")[0]


@pytest.fixture(scope="module")
def record(batch, trace):
    return mission_record(batch.scores()[0], trace)


def test_it_is_plain_json(record):
    assert json.loads(json.dumps(record)) == record


def test_scores_are_taken_over(batch, trace, record):
    score = batch.scores()[0]
    for name in OWN:
        assert record[name] == getattr(score, name)
    assert record["seed"] == 2 and record["malfunctions"] > 0


def test_messages_are_counted(trace, record):
    for kind in Kind:
        ours = trace.message_kind == kind
        name = kind.name.lower()
        assert record[f"{name}_ended"] == np.sum(ours & (trace.message_fate != Fate.UNDERWAY))
        assert record[f"{name}_delivered"] == np.sum(ours & (trace.message_fate == Fate.DELIVERED))
    assert 0 < record["telemetry_delivered"] < record["telemetry_ended"] and record["query_ended"] > 0


def test_rates_are_per_robot_minute(trace, record):
    broadcasts = queries = 0
    for second in range(trace.ticks + 1):
        for robot in range(5):
            broadcasts += trace.robot_broadcast[second, robot]
            queries += trace.robot_query[second, robot] != -1
    minutes = trace.ticks * 5 / 60
    assert record["broadcast_rate"] == pytest.approx(broadcasts / minutes) and broadcasts > 0
    assert record["query_rate"] == pytest.approx(queries / minutes) and queries > 0


def test_every_kind_takes_one_route():
    assert sorted(kind for kinds in ROUTES.values() for kind in kinds) == sorted(Kind)


@pytest.mark.parametrize("route", ROUTES)
def test_latencies_against_counting(trace, record, route):
    found, kinds = record["latency"][route], ROUTES[route]
    within, expired, ended = np.zeros(LONGEST + 1, int), 0, 0
    for kind, queued, end, fate in zip(trace.message_kind, trace.message_queued, trace.message_ended, trace.message_fate):
        if kind in kinds and fate != Fate.UNDERWAY:
            ended += 1
            expired += fate == Fate.EXPIRED
            if fate == Fate.DELIVERED:
                within[end - queued :] += 1
    np.testing.assert_array_equal(np.cumsum(found["delivered_after"]), within)
    assert (found["expired"], found["ended"]) == (expired, ended)
    assert sum(found["delivered_after"]) == sum(record[f"{kind.name.lower()}_delivered"] for kind in kinds) > 0
    assert ended == sum(record[f"{kind.name.lower()}_ended"] for kind in kinds)


def test_later_than_the_longest_is_not_within_it():
    """Possible with a time to live of more than a minute."""
    later = SimpleTrace([Kind.TELEMETRY] * 2, [0, 0], [3, LONGEST + 40], [Fate.DELIVERED] * 2)
    found = latencies(later, ROUTES["uplink"])
    assert found["ended"] == 2 and sum(found["delivered_after"]) == 1


class SimpleTrace:
    """Only messages."""

    def __init__(self, kinds, queued, ended, fates):
        self.message_kind, self.message_fate = np.array(kinds, np.int8), np.array(fates, np.int8)
        self.message_queued, self.message_ended = np.array(queued, np.int32), np.array(ended, np.int32)


def test_latencies_of_no_messages():
    found = latencies(SimpleTrace([], [], [], []), ROUTES["robots"])
    assert found == {"delivered_after": [0] * (LONGEST + 1), "expired": 0, "ended": 0}


def brute_force_ages(trace, is_station):
    """Every age of a report of a living robot, at living receivers other than itself."""
    found, robots = [], trace.scenario.n_robots
    for sample in range(len(trace.records["peer_time"])):
        second = sample * trace.link_period
        alive = [trace.robot_activity[second, robot] != Activity.FAILED for robot in range(robots)]
        for receiver in [robots] if is_station else range(robots):
            for robot in range(robots):
                if robot != receiver and alive[robot] and (is_station or alive[receiver]):
                    time = trace.records["peer_time"][sample, receiver, robot]
                    found.append(second - time if time >= 0 else second)
    return np.array(found)


@pytest.mark.parametrize("who", ["peer", "station"])
def test_ages_against_brute_force(trace, record, who):
    expected = brute_force_ages(trace, who == "station")
    assert record[f"{who}_age_mean"] == pytest.approx(expected.mean())
    assert record[f"{who}_age_p95"] == pytest.approx(np.percentile(expected, 95))
    assert record[f"{who}_age_peak"] == expected.max() > 5


def test_never_heard_is_as_old_as_the_mission():
    trace = dataclasses.make_dataclass("T", ["robot_activity", "link_period"])(np.zeros((11, 2), np.int8), 5)
    times = np.array([[[9, -1], [-1, 9]], [[9, -1], [3, 9]], [[9, 10], [3, 9]]])  # a robot's own report does not count
    found = ages("peer", times, trace)
    assert found == {
        "peer_age_mean": np.mean([0, 0, 5, 2, 0, 7]), "peer_age_p95": pytest.approx(np.percentile([0, 0, 5, 2, 0, 7], 95)),
        "peer_age_peak": 7,
    }  # fmt: skip
    trace.robot_activity[5:, 0] = Activity.FAILED
    assert ages("peer", times, trace)["peer_age_peak"] == 0 and ages("station", times[:, :1], trace)["station_age_peak"] == 5


def test_a_lonely_robot_has_no_peers():
    trace = dataclasses.make_dataclass("T", ["robot_activity", "link_period"])(np.zeros((6, 1), np.int8), 5)
    assert ages("peer", np.zeros((2, 1, 1), int), trace)["peer_age_mean"] == 0
    assert ages("station", np.zeros((2, 1, 1), int), trace)["station_age_peak"] == 5


def mission(quality, activity):
    """A trace with nothing but links, sampled every second."""
    names = ["link_quality", "robot_activity", "link_period"]
    return dataclasses.make_dataclass("T", names)(np.array(quality, np.uint8), np.array(activity, np.int8), 1)


def matrix(n, links, station=()):
    """[n, n + 1] percent from {(a, b): percent}."""
    quality = np.zeros((n, n + 1), int)
    for (a, b), percent in links.items():
        quality[a, b] = quality[b, a] = percent
    for robot, percent in station:
        quality[robot, n] = percent
    return quality


def test_components_of_hand_made_links():
    dead = Activity.FAILED
    found = connectivity(mission(
        [
            matrix(4, {(0, 1): 95, (1, 2): 50, (2, 3): 95}, [(0, 95), (1, 49), (2, 50), (3, 0)]),  # a chain
            matrix(4, {(0, 1): 95, (2, 3): 49}, [(0, 95)]),  # a pair and two alone
            matrix(4, {(0, 1): 95, (1, 2): 95, (2, 3): 95}, [(3, 95)]),  # robot 1, in the middle, has failed
            matrix(4, {(0, 3): 95}),  # and all but 0 and 3
        ],
        [[0, 0, 0, 0], [0, 0, 0, 0], [0, dead, 0, 0], [0, dead, dead, 0]],
    ))  # fmt: skip
    assert found["components"] == [1, 3, 2, 1] and found["components_mean"] == 7 / 4 and found["connected_share"] == 2 / 4
    assert found["station_reach"] == pytest.approx((2 + 1 + 1 + 0) / (4 + 4 + 3 + 2))


def test_components_of_one_robot_and_of_none():
    assert connectivity(mission([matrix(1, {}, [(0, 95)])], [[0]])) == {
        "components": [1], "components_mean": 1, "connected_share": 1, "station_reach": 1,
    }  # fmt: skip
    assert connectivity(mission([matrix(2, {(0, 1): 95})], [[Activity.FAILED] * 2]))["components"] == [0]


def test_components_of_a_mission_by_walking(trace, record):
    for sample, count in enumerate(record["components"]):
        alive = [r for r in range(5) if trace.robot_activity[5 * sample, r] != Activity.FAILED]
        groups = []
        for robot in alive:
            near = [g for g in groups if any(trace.link_quality[sample, robot, other] >= 50 for other in g)]
            groups = [g for g in groups if g not in near] + [[robot, *(r for g in near for r in g)]]
        assert count == len(groups)
    assert max(record["components"]) > 1


def test_digests_tell_missions_apart(batch, trace):
    again = make_traces(flown(SCENARIO, [2], Wanderer(1), links="raycast", record=True), "wanderer")[0]
    assert digest(again) == digest(trace)
    late = trace.message_late.copy()
    late[len(late) // 2] ^= 1
    assert digest(dataclasses.replace(trace, message_late=late)) != digest(trace)
    assert digest(dataclasses.replace(trace, robot_xy=np.nextafter(trace.robot_xy, 1e9))) != digest(trace)
