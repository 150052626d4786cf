"""Transport: priorities, budgets, expiry, neighbours, replies, and the shares of losses and delays."""

import numpy as np
import pytest
from flying import Pilot, Wanderer, flown, fly, plain
from strategies import change

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, REST, Activity, Fate, Kind, Status, TaskType
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.models.layout import inside_any, unit_frame
from commhg_mj.scenarios import LIMITATIONS, SCENARIOS

QUERY, REQUEST, TELEMETRY = 0, 1, 2  # places of an uplink
COMMAND = 0  # place of a downlink


def count(pilot, kind):
    return pilot.counters[kind]


def fates(pilot, kind):
    """The fates that messages of a kind have met, {fate: count}."""
    return {fate: int(n) for fate, n in zip(Fate, count(pilot, kind)["fate"]) if n}


def waits(queue):
    return queue["since"] >= 0


def test_a_query_displaces_waiting_telemetry_and_goes_first():
    pilot = Pilot(plain(refill=8.0, telemetry_period=3600.0))
    pilot.robots["tokens"], pilot.robots["next_telemetry"][0] = 20.0, 2
    pilot.wait(2)
    assert waits(pilot.uplinks[0])[TELEMETRY] and pilot.robots["tokens"][0] == 36
    pilot.step(robots={0: dict(query=0)})
    assert not waits(pilot.uplinks[0])[TELEMETRY], "displaced"
    assert fates(pilot, Kind.TELEMETRY) == {Fate.NO_TOKENS: 1}
    assert count(pilot, Kind.QUERY)["sent"] == 1 and pilot.robots["tokens"][0] == 36 + 8 - 32


def test_a_request_displaces_telemetry_too():
    pilot = Pilot(plain(refill=8.0, telemetry_period=3600.0))
    pilot.robots["tokens"], pilot.robots["next_telemetry"][0] = 20.0, 2
    pilot.wait(2).step(robots={0: dict(assist=True)})
    assert fates(pilot, Kind.TELEMETRY) == {Fate.NO_TOKENS: 1} and count(pilot, Kind.REQUEST)["sent"] == 1


def test_telemetry_that_falls_due_yields_to_a_waiting_query():
    pilot = Pilot(plain(refill=0.0, telemetry_period=3600.0))
    pilot.robots["tokens"], pilot.robots["next_telemetry"][0] = 10.0, 3
    pilot.step(robots={0: dict(query=0)}).wait(3)
    assert waits(pilot.uplinks[0])[QUERY] and not waits(pilot.uplinks[0])[TELEMETRY]
    assert fates(pilot, Kind.TELEMETRY) == {Fate.NO_TOKENS: 1}


def test_a_request_waits_behind_a_query():
    pilot = Pilot(plain(refill=0.0, telemetry_period=3600.0))
    pilot.robots["tokens"] = 24.0
    pilot.step(robots={0: dict(query=0)}).step(robots={0: dict(assist=True)})
    assert waits(pilot.uplinks[0])[REQUEST] and count(pilot, Kind.REQUEST)["sent"] == 0


def test_every_queued_message_expires_at_its_time_to_live():
    """Also one that stands behind another without tokens."""
    pilot = Pilot(plain(refill=0.0, telemetry_period=3600.0, time_to_live=6.0))
    pilot.robots["tokens"] = 24.0
    pilot.step(robots={0: dict(assist=True)})
    assert pilot.robots["tokens"][0] == 0
    pilot.robots["tokens"] = 24.0
    pilot.step(robots={0: dict(query=0)})  # queued at 1, expires at 7
    pilot.step(robots={0: dict(assist=True)})  # queued at 2, expires at 8
    pilot.robots["tokens"] = 0.0
    pilot.wait(4)
    assert pilot.now == 7 and fates(pilot, Kind.QUERY) == {Fate.EXPIRED: 1}
    pilot.step(robots={0: dict(query=0)})
    assert pilot.now == 8 and fates(pilot, Kind.REQUEST).get(Fate.EXPIRED) == 1
    pilot.wait(4)
    assert waits(pilot.uplinks[0])[QUERY]


def test_what_expired_is_never_sent_and_costs_nothing():
    pilot = Pilot(plain(refill=0.0, telemetry_period=3600.0, time_to_live=3.0))
    pilot.robots["tokens"] = 31.0
    pilot.step(robots={0: dict(query=0)}).wait(5)
    assert fates(pilot, Kind.QUERY) == {Fate.EXPIRED: 1}
    assert (
        count(pilot, Kind.QUERY)["sent"] == count(pilot, Kind.QUERY)["bytes"] == 0 and pilot.robots["tokens"][0] == 31
    )


def test_new_telemetry_supersedes_what_still_waits():
    pilot = Pilot(plain(refill=0.0, telemetry_period=4.0))
    pilot.robots["tokens"], pilot.robots["next_telemetry"] = 0.0, [2, 3600]
    pilot.wait(7)
    assert count(pilot, Kind.TELEMETRY)["attempted"] == 2 and fates(pilot, Kind.TELEMETRY) == {Fate.NO_TOKENS: 1}


def test_only_one_query_may_wait():
    pilot = Pilot(plain(refill=0.0, n_operators=2))
    pilot.robots["tokens"] = 0.0
    pilot.step(robots={0: dict(query=0)})
    assert not pilot.batch.observations.robot_operators["legal"][0].any()
    with pytest.raises(ValueError, match="uav0 of mission 0 .* query is masked"):
        pilot.step(robots={0: dict(query=1)})


def test_a_bucket_fills_to_its_capacity_and_no_further():
    pilot = Pilot(plain(refill=50.0, telemetry_period=3600.0))
    pilot.robots["tokens"], pilot.robots["next_telemetry"] = 100.0, 3600
    pilot.wait(1)
    assert np.all(pilot.robots["tokens"] == 150)
    pilot.wait(2)
    assert np.all(pilot.robots["tokens"] == 192)


def test_a_control_command_goes_before_replies():
    pilot = Pilot(plain(refill=10.0, n_uav=3, telemetry_period=3600.0)).heard()
    pilot.robots["tokens"] = 192.0
    pilot.operators["tokens"], pilot.operators["next_decision"] = 0.0, 0
    pilot.step(robots={0: dict(query=0), 1: dict(query=0)}).wait(1)
    pilot.step(operators={0: 2})
    assert waits(pilot.downlinks[0]).tolist() == [True, True, True, False]
    pilot.operators["tokens"] = 55.0
    pilot.wait(1)
    assert waits(pilot.downlinks[0]).tolist() == [False, True, True, False]
    assert pilot.operators["tokens"][0] == 55 + 10 - 48
    assert count(pilot, Kind.CONTROL)["sent"] == 1 and count(pilot, Kind.REPLY)["sent"] == 0
    pilot.wait(6)
    assert count(pilot, Kind.REPLY)["sent"] == 1, "the next as soon as there are 56 B"


def test_no_reply_overtakes_a_command_that_lacks_tokens():
    pilot = Pilot(plain(refill=0.0, telemetry_period=3600.0, control_bytes=100)).heard()
    pilot.operators["tokens"] = 70.0
    pilot.step(robots={0: dict(query=0)}, operators={0: 1}).wait(4)
    assert waits(pilot.downlinks[0])[COMMAND] and count(pilot, Kind.REPLY)["sent"] == 0


def test_replies_leave_the_oldest_first():
    pilot = Pilot(plain(refill=0.0, n_uav=3, telemetry_period=3600.0))
    pilot.operators["tokens"] = 0.0
    pilot.step(robots={2: dict(query=0)}).step(robots={0: dict(query=0)}).wait(2)
    pilot.operators["tokens"] = 64.0
    pilot.wait(2)
    assert pilot.resources["time"][2, 0] >= 0 and pilot.resources["time"][0, 0] < 0


def test_a_broadcast_reaches_the_best_neighbours_in_range_and_no_more():
    pilot = Pilot(plain(n_uav=8, out_degree=4, map_side=1000.0, time_limit=60))
    robots = pilot.robots
    robots["x"], robots["y"] = [500, 510, 900, 480, 520, 530, 560, 500], [500] * 7 + [799]
    pilot.step(robots={r: dict(task=IDLE) for r in range(8)} | {0: dict(task=IDLE, broadcast=True)}).wait(2)
    heard = np.flatnonzero(pilot.peers["time"][:8, 0] >= 0)
    assert heard.tolist() == [1, 3, 4, 5], "equal links: the nearest four of six in range"
    assert count(pilot, Kind.BROADCAST)["bytes"] == 4 * 160


def test_the_best_neighbours_are_those_with_the_least_terrain_between():
    scenario = change(
        SCENARIOS["medium"], n_uav=8, n_ugv=0, malfunction=0.0, unavailable_or_delayed=(0.0, 0.0, 0.0), out_degree=2,
        range=(2.0, 2.0, 2.0), robot_period=1, initial_phase=0.0, forest_decay=1e4, mountain_decay=1e4,
    )  # fmt: skip
    pilot = Pilot(scenario, seed=3, record=True, links="abstract")
    rng = np.random.default_rng(0)
    places = rng.uniform(0, 1000, (8, 2))
    pilot.robots["x"], pilot.robots["y"] = places.T
    pilot.step(robots={r: dict(task=IDLE) for r in range(8)} | {0: dict(task=IDLE, broadcast=True)}).wait(4)
    rows = pilot.batch.log.messages[0]
    heard = set(rows["receiver"][(rows["kind"] == Kind.BROADCAST) & (rows["sent"] >= 0)][:2].tolist())
    shares = [terrain_metres(pilot.batch.worlds[0], places[0], place) for place in places]
    best = sorted(range(1, 8), key=lambda r: shares[r])
    assert heard == set(best[:2]) or shares[best[1]] == pytest.approx(max(shares[r] for r in heard), abs=1.0)


def terrain_metres(world, a, b, n=20_001):
    """Planar metres of a-b inside footprints, by dense sampling."""
    points = a + np.linspace(0, 1, n)[:, None] * (np.asarray(b) - a)
    return sum(
        np.mean(inside_any(unit_frame(parts), points)) for parts in (world.layout.forests, world.layout.mountains)
    ) * np.hypot(*(np.asarray(b) - a))


def test_a_broadcast_without_anybody_in_range_ends_out_of_range():
    pilot = Pilot(plain(map_side=1000.0))
    pilot.robots["x"], pilot.robots["y"] = [100, 900], [500, 500]
    pilot.step(robots={r: dict(task=IDLE, broadcast=r == 0) for r in range(2)})
    assert fates(pilot, Kind.BROADCAST) == {Fate.OUT_OF_RANGE: 1}
    assert count(pilot, Kind.BROADCAST)["sent"] == count(pilot, Kind.BROADCAST)["bytes"] == 0


@pytest.mark.parametrize("limitation", LIMITATIONS)
def test_the_range_shrinks_with_the_limitation_level(limitation):
    share = SCENARIOS["small"].communication.range[LIMITATIONS.index(limitation)]
    for metres, is_heard in ((share * 1000 - 1, True), (share * 1000 + 1, False)):
        pilot = Pilot(plain(map_side=1000.0), limitation=limitation)
        pilot.robots["x"], pilot.robots["y"] = [100, 100 + metres], [500, 500]
        pilot.step(robots={r: dict(task=IDLE, broadcast=r == 0) for r in range(2)}).wait(2)
        assert (pilot.peers["time"][1, 0] >= 0) == is_heard


def test_failed_robots_neither_speak_nor_hear():
    pilot = Pilot(plain(n_uav=3, malfunction=0.0))
    pilot.step(robots={0: dict(broadcast=True)})
    pilot.robots["activity"][1], pilot.robots["task"][1], pilot.robots["due"][1] = 3, NOBODY, 0
    pilot.tasks["owner"][pilot.tasks["owner"] == 1] = NOBODY
    before = pilot.counters["attempted"].copy()
    pilot.wait(2)
    pilot.step(robots={0: dict(broadcast=True)}).wait(2)
    assert count(pilot, Kind.BROADCAST)["attempted"] == before[Kind.BROADCAST] + 1
    assert pilot.peers["time"][1, 0] < 1


def asker(**fields):
    """A pilot whose tasks are far from everybody and whose station knows nothing yet."""
    pilot = Pilot(plain(telemetry_period=3600.0, n_uav=2, sensing_radius=0.0, **fields))
    pilot.robots["next_telemetry"] = 3600
    pilot.tasks["x"], pilot.tasks["y"] = [100, 200, 300, 400], 400
    return pilot


def station_learns(pilot, task, status=Status.OPEN, task_type=TaskType.GENERAL, time=None):
    belief = pilot.beliefs[-1, task : task + 1]
    belief["time"], belief["status"], belief["type"] = pilot.now if time is None else time, status, task_type


def test_a_reply_reports_the_operators_resources():
    pilot = asker(n_operators=2)
    pilot.operators["fatigue"], pilot.operators["tokens"] = [0.1, 0.5], [192, 100]
    pilot.peers["time"][-1, 1] = 0  # heard of
    pilot.step().step(operators={1: 1}).wait(2)
    pilot.step(robots={0: dict(query=1)}).wait(3)
    report = pilot.resources[0, 1]
    assert report["time"] >= 3 and report["fatigue_class"] == 1 and report["robot"] == 1 and report["queue"] == 0
    assert report["tokens"] < 192 and pilot.resources["time"][0, 0] < 0, "only the one who was asked"
    assert np.all(pilot.resources["time"][1] < 0), "only the one who asked"


def test_a_reply_may_be_empty():
    pilot = asker().step(robots={0: dict(query=0)}).wait(3)
    assert pilot.resources["time"][0, 0] >= 0 and np.all(pilot.beliefs["time"][0] < 0)
    pilot = asker()
    station_learns(pilot, 1)  # open and of the announced type: nothing that helps
    pilot.step(robots={0: dict(query=0)}).wait(3)
    assert np.all(pilot.beliefs["time"][0] < 0)


def tips_of(pilot, *choices):
    """The tasks that robot 0 hears of by its queries, one with each of these choices of a task."""
    tips = []
    for choice in choices:
        known = set(np.flatnonzero(pilot.beliefs["time"][0] >= 0))
        pilot.step(robots={0: dict(query=0, task=choice)}).wait(4)
        tips.append(sorted(set(np.flatnonzero(pilot.beliefs["time"][0] >= 0)) - known))
    return tips


def test_a_tip_is_the_task_that_the_query_named_first_then_the_nearest_news_to_it():
    """The named task is the one that is held when the query leaves, chosen in the same decision or before."""
    pilot = asker(broadcast_records=0)
    pilot.step(robots={0: dict(task=IDLE), 1: dict(task=IDLE)}).wait(1)
    station_learns(pilot, 0, Status.DONE, time=1)
    station_learns(pilot, 1, Status.DONE, time=1)
    station_learns(pilot, 3, task_type=TaskType.UAV_ONLY, time=1)
    assert tips_of(pilot, 3, KEEP, KEEP, KEEP) == [[3], [1], [0], []]
    assert np.all(pilot.beliefs["time"][0][[0, 1, 3]] == 1), "relaying does not refresh the evidence"


def test_a_query_that_names_no_task_is_answered_with_the_nearest_news_to_where_the_robot_was():
    pilot = asker(broadcast_records=0)
    pilot.step(robots={0: dict(task=IDLE), 1: dict(task=IDLE)})
    report = pilot.peers[-1, 0:1]
    report["time"], report["x"], report["y"] = 1, 290, 400
    pilot.wait(1)
    for task in (0, 1, 3):
        station_learns(pilot, task, Status.DONE, time=1)
    assert tips_of(pilot, IDLE, IDLE, IDLE, IDLE) == [[1], [3], [0], []]


def claims(pilot, robot, task):
    """(claimer, age of the claim) as a robot sees it."""
    seen = pilot.batch.observe_everyone().robot_tasks[robot, task]
    return int(seen["claimed_by"]), float(seen["claim_age"])


def test_a_reply_tells_of_anothers_claim_by_whom_and_when():
    pilot = asker(broadcast_records=0, range=(2.0,) * 3)
    pilot.step(robots={0: dict(task=IDLE), 1: dict(task=2)}).wait(1)
    report = pilot.peers[-1, 1:2]
    report["time"], report["task"], report["activity"] = 2, 2, Activity.TRAVELLING
    assert claims(pilot, 0, 2) == (NOBODY, -1.0)
    pilot.step(robots={0: dict(query=0)}).wait(4)
    assert claims(pilot, 0, 2) == (1, pilot.now - 2) and pilot.beliefs["time"][0, 2] < 0, "of the task itself nothing is known"
    assert pilot.peers["time"][0, 1] < 0, "no record of the robot travels along"
    report["time"] = 5  # the same claim, hardly newer
    pilot.step(robots={0: dict(query=0)}).wait(4)
    assert claims(pilot, 0, 2) == (1, pilot.now - 2), "is no news"
    report["time"] = 23
    pilot.wait(15).step(robots={0: dict(query=0)}).wait(4)
    assert claims(pilot, 0, 2) == (1, pilot.now - 23), "much newer, it is"
    pilot.step(robots={1: dict(task=IDLE, broadcast=True)}).wait(1)
    assert claims(pilot, 0, 2) == (NOBODY, -1.0), "the claimer itself says otherwise since"


def test_a_claim_that_nobody_confirmed_for_a_minute_is_no_news():
    pilot = asker(broadcast_records=0)
    pilot.step(robots={0: dict(task=IDLE), 1: dict(task=2)}).wait(70)
    report = pilot.peers[-1, 1:2]
    report["time"], report["task"], report["activity"] = 2, 2, Activity.TRAVELLING
    pilot.step(robots={0: dict(query=0)}).wait(4)
    assert claims(pilot, 0, 2) == (NOBODY, -1.0)


def test_broadcasts_are_paid_out_of_a_bucket_of_their_own():
    pilot = Pilot(plain(broadcast_bytes=160, broadcast_bucket=400.0, broadcast_refill=16.0))
    robots = lambda: pilot.batch.observations.robots
    assert robots()["broadcast_tokens"].tolist() == [400, 400], "full at first"
    pilot.robots["next_telemetry"], uplink = 3600, pilot.robots["tokens"].copy()
    pilot.step(robots={0: dict(broadcast=True)})
    assert robots()["broadcast_tokens"].tolist() == [400 - 160 + 16, 400] and np.array_equal(pilot.robots["tokens"], uplink)
    pilot.step(robots={0: dict(broadcast=True)})
    assert robots()["can_broadcast"].tolist() == [0, 1], "112 B are too few"
    pilot.wait(3)
    assert robots()["can_broadcast"].tolist() == [1, 1] and pilot.robots["broadcast_tokens"][0] == 160
    pilot.wait(30)
    assert robots()["broadcast_tokens"].tolist() == [400, 400], "and no fuller"


def test_ideal_links_fill_every_bucket_in_every_second():
    for links in ("perfect", "known"):
        pilot = Pilot(plain(broadcast_refill=0.0, refill=0.0), links=links)
        pilot.step(robots={0: dict(broadcast=True, query=0)})
        assert pilot.robots["broadcast_tokens"][0] == pilot.batch.scenario.communication.broadcast_bucket
        assert pilot.robots["tokens"][0] == 192 - 32, "what was queued has left"


def test_silent_links_deliver_nothing_and_known_ones_make_all_records_true():
    scenario = change(SCENARIOS["small"], time_limit=200)
    batch = flown(scenario, range(3), links="silent")
    assert batch.state.counters["sent"].sum() > 0 and batch.state.counters["fate"][..., Fate.DELIVERED].sum() == 0
    assert np.all(batch.state.peers["time"] < 0) and np.all(batch.state.resources["time"] < 0)
    batch = MissionBatch(scenario, range(3), links="known")
    fly(batch, Wanderer(1), seconds=100)
    seen, state = batch.observe_everyone(), batch.state
    e, r = seen.robots["mission"], seen.robots["robot"]
    others = np.arange(scenario.n_robots) != r[:, None]
    assert np.all(seen.robot_peers["age"][others] == 0)
    assert np.array_equal(seen.robot_peers["task"][others], np.broadcast_to(state.robots["task"][e], others.shape)[others])
    released = state.tasks["released"][e] == 1
    for column in ("type", "status"):
        assert np.array_equal(seen.robot_tasks[column][released], state.tasks[column][e][released])
    assert np.all(seen.robot_operators["age"] == 0)
def test_no_tip_tells_a_robot_its_own_news():
    pilot = asker()
    pilot.step(robots={r: dict(task=IDLE) for r in range(2)}).wait(2)
    belief = pilot.beliefs[0, 2:3]
    belief["time"], belief["status"], belief["sensed"] = 2, Status.DONE, 1
    pilot.robots["next_telemetry"][0] = pilot.now + 1
    pilot.wait(3)
    assert pilot.beliefs[-1, 2]["status"] == Status.DONE and pilot.tips["time"][0, 2] == 2
    station_learns(pilot, 0, Status.DONE, time=1)
    pilot.step(robots={0: dict(query=0)}).wait(4)
    assert pilot.beliefs[0, 0]["status"] == Status.DONE, "the other's news at once"
    pilot.step(robots={1: dict(query=0)}).wait(4)
    assert np.sum(pilot.beliefs["time"][1] >= 0) == 1, "the other robot is told either"


def test_a_changed_type_is_worth_a_tip_and_so_is_fresher_evidence_of_it():
    pilot = asker()
    pilot.wait(2)
    station_learns(pilot, 2, task_type=TaskType.UAV_ONLY, time=1)
    pilot.step(robots={0: dict(query=0)}).wait(4)
    assert pilot.beliefs[0, 2]["type"] == TaskType.UAV_ONLY and pilot.beliefs[0, 2]["time"] == 1
    station_learns(pilot, 2, task_type=TaskType.UAV_ONLY, time=5)
    pilot.step(robots={0: dict(query=0)}).wait(4)
    assert pilot.beliefs[0, 2]["time"] == 5


def test_a_stale_reply_does_not_overwrite_newer_evidence():
    pilot = asker()
    pilot.wait(5)
    station_learns(pilot, 2, task_type=TaskType.UAV_ONLY, time=1)
    pilot.beliefs["time"][0, 2], pilot.beliefs["type"][0, 2] = 4, TaskType.UGV_ONLY
    pilot.step(robots={0: dict(query=0)}).wait(4)
    assert pilot.beliefs[0, 2]["time"] == 4 and pilot.beliefs[0, 2]["type"] == TaskType.UGV_ONLY


def test_completion_is_terminal_in_records():
    pilot = asker()
    pilot.wait(5)
    station_learns(pilot, 2, task_type=TaskType.UAV_ONLY, time=4)
    pilot.beliefs["time"][0, 2], pilot.beliefs["status"][0, 2] = 1, Status.DONE
    pilot.step(robots={0: dict(query=0)}).wait(4)
    assert pilot.beliefs[0, 2]["status"] == Status.DONE


def test_a_query_reserves_nothing_and_a_request_reaches_the_operators_as_one_bit():
    pilot = asker()
    pilot.step(robots={0: dict(query=0), 1: dict(assist=True)}).wait(2)
    assert pilot.operators["session"][0] == 0 and np.all(pilot.robots["controller"] == NOBODY)
    reports = pilot.batch.observations.operator_reports[0]
    assert reports["request_age"].tolist() == [-1, pilot.now] and np.all(reports["age"] == -1)


def test_a_broadcast_carries_state_assignment_and_the_freshest_records():
    pilot = Pilot(plain(n_tasks=20, sensing_radius=0.0, telemetry_period=3600.0, n_operators=0))
    pilot.step(robots={r: dict(task=IDLE) for r in range(2)}).wait(19)
    pilot.beliefs["time"][0] = np.arange(20)
    pilot.step(robots={0: dict(broadcast=True, task=5)}).wait(1)
    assert np.flatnonzero(pilot.beliefs["time"][1] >= 0).tolist() == list(range(16, 20))
    peer = pilot.peers[1, 0]
    assert peer["task"] == 5 and peer["time"] == 20
    assert np.all(pilot.beliefs["sensed"][1] == 0)


def test_telemetry_carries_sensed_records_only():
    pilot = Pilot(plain(n_tasks=6, sensing_radius=0.0, telemetry_period=3600.0, n_operators=0))
    pilot.wait(10)
    pilot.beliefs["time"][0], pilot.beliefs["sensed"][0] = np.arange(1, 7), [1, 0, 1, 1, 0, 1]
    pilot.robots["next_telemetry"][0] = pilot.now + 1
    pilot.wait(2)
    assert np.flatnonzero(pilot.beliefs["time"][-1] >= 0).tolist() == [0, 2, 3, 5]
    assert pilot.peers["time"][-1, 0] >= 0


def test_losses_and_delays_come_in_equal_shares_of_the_limitation_level():
    for limitation, share in (("nominal", 0.1), ("low", 0.2), ("high", 0.3)):
        scenario = plain(
            n_uav=8,
            broadcast_refill=160.0,
            unavailable_or_delayed=(0.1, 0.2, 0.3),
            robot_period=1,
            time_limit=250,
            map_side=200.0,
            range=(2.0,) * 3,
        )
        batch = flown(scenario, range(4), Wanderer(0), limitation=limitation, record=True)
        counters = batch.state.counters
        n, lost, late = counters["sent"].sum(), counters["fate"][..., Fate.LOST].sum(), counters["late"].sum()
        slack = 4 * np.sqrt(n * share / 2)
        assert n > 5000 and counters["fate"][..., Fate.TERRAIN].sum() == 0
        assert abs(lost - n * share / 2) < slack and abs(late - n * share / 2) < slack
        rows = batch.log.messages[(batch.log.messages["late"] == 1) & (batch.log.messages["fate"] == Fate.DELIVERED)]
        delays = np.bincount(rows["ended"] - rows["sent"], minlength=9)
        assert np.all(delays[:3] == 0) and np.all(np.abs(delays[3:] - delays.sum() / 6) < 5 * np.sqrt(delays.sum() / 6))


def test_terrain_loses_the_share_that_the_metres_say():
    """Two robots on both sides of a forest: the share of packets that pass is exp(-metres / l)."""
    scenario = change(
        SCENARIOS["small"], n_uav=2, n_ugv=0, n_operators=0, malfunction=0.0, robot_period=1, initial_phase=0.0,
        range=(2.0,) * 3, time_limit=500, mountain_share=0.0, forest_share=0.2, n_forests=3, broadcast_refill=160.0,
    )  # fmt: skip
    batch = MissionBatch(scenario, range(12), links="abstract")
    metres = []
    rng = np.random.default_rng(1)
    for e, world in enumerate(batch.worlds):
        a, b = rng.uniform(0, 500, (2, 2))
        batch.state.robots["x"][e], batch.state.robots["y"][e] = [a[0], b[0]], [a[1], b[1]]
        metres.append(terrain_metres(world, a, b))
    while not batch.over.all():
        decisions = stay(batch.observations)
        decisions.task[:] = IDLE
        decisions.broadcast[:] = True
        batch.step(decisions)
    counters = batch.state.counters[:, Kind.BROADCAST]
    sent, blocked = counters["sent"], counters["fate"][:, Fate.TERRAIN]
    clear = np.exp(-np.array(metres) / 73.0)
    expected = sent * (1 - clear) * 0.95  # what the level would have lost over clear ground counts as lost by it
    assert np.all(sent > 900) and np.ptp(clear) > 0.5
    assert np.all(np.abs(blocked - expected) <= 4.5 * np.sqrt(expected) + 2)
    lost = counters["fate"][:, Fate.LOST]
    assert np.all(np.abs(lost - 0.05 * sent) < 4.5 * np.sqrt(0.05 * sent))


def test_station_links_know_neither_range_nor_terrain():
    scenario = plain(map_side=5000.0, n_operators=1)
    pilot = Pilot(scenario)
    pilot.robots["x"], pilot.robots["y"] = 4990.0, 4990.0
    pilot.wait(8)
    assert np.all(pilot.peers["time"][-1] >= 0)


def test_perfect_links_lose_and_wait_for_nothing_but_the_limitation_level():
    scenario = plain(
        refill=0.0, bucket=192.0, map_side=5000.0, unavailable_or_delayed=(0.0, 0.0, 0.0), forest_share=0.2
    )
    pilot = Pilot(scenario, links="perfect")
    pilot.robots["x"], pilot.robots["y"] = [0, 5000], [0, 5000]
    for _ in range(20):
        pilot.step(robots={0: dict(broadcast=True, query=0, task=IDLE), 1: dict(task=IDLE)})
    pilot.wait(2)
    for kind in (Kind.BROADCAST, Kind.QUERY):
        assert fates(pilot, kind) == {Fate.DELIVERED: 20}


def test_an_operator_that_rests_takes_its_waiting_command_back():
    pilot = Pilot(plain(refill=0.0)).heard()
    pilot.operators["tokens"] = 0.0
    pilot.step(operators={0: 1}).step(operators={0: REST})
    assert fates(pilot, Kind.CONTROL) == {Fate.NO_TOKENS: 1} and pilot.operators["robot"][0] == NOBODY
