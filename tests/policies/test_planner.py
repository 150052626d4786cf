"""The planner: its rules one by one, its ablations, and the whole missions of a kernel."""

import numpy as np
import pytest
from flying import Pilot, copied, fingerprint, fly, plain
from strategies import change

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, REST, Activity, Mode, Session, Status
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.policies import find_policy, prepare
from commhg_mj.policies.greedy import CLAIM_TRUST, TIRED, gain
from commhg_mj.policies.planner import ABLATIONS, ASKING_PERIOD, PERIOD, WELL_UNDER_WAY, Plan, Planner
from commhg_mj.policies.schedule import FAR
from commhg_mj.policies.whole_missions import fly_whole
from commhg_mj.scenarios import SCENARIOS

SHORT = change(SCENARIOS["small"], time_limit=200)


def two_idle():
    """Observations of two idle UAVs, robot 1 known to robot 0, before three open tasks that differ in nothing but place."""
    pilot = Pilot(plain(n_uav=2, n_operators=0, n_tasks=3, time_limit=2000))
    pilot.step(robots={r: dict(task=IDLE) for r in range(2)})
    seen = copied(pilot.batch.observations)
    robots, tasks, peers = seen.robots[:1], seen.robot_tasks[:1], seen.robot_peers[:1]
    robots["x"], robots["y"], robots["activity"], robots["task"], robots["can_keep"], robots["can_idle"] = 0, 0, 0, NOBODY, 0, 1
    for name, value in dict(
        released=1, legal=1, status=Status.OPEN, age=-1, type=2, difficulty=0.2, value=2, deadline=60, decay=100,
        claimed_by=NOBODY,
    ).items():  # fmt: skip
        tasks[name] = value
    peers["age"] = -1
    peers["mode"], peers["embodiment"], peers["task"], peers["activity"] = Mode.AUTONOMOUS, 0, NOBODY, Activity.IDLE
    set_places(tasks, [(1000, 0), (2000, 0), (0, 9000)])
    operators = seen.robot_operators[:1]
    return pilot.batch, seen._replace(robots=robots, robot_tasks=tasks, robot_peers=peers, robot_operators=operators)


def set_places(tasks, places):
    for j, (x, y) in enumerate(places):
        tasks["x"][0, j], tasks["y"][0, j] = x, y
        tasks["distance"][0, j] = np.hypot(x, y)


def hear(seen, **fields):
    """Robot 1 has reported."""
    for name, value in {"age": 1.0, "x": 1010.0, "y": 0.0, **fields}.items():
        seen.robot_peers[name][0, 1] = value


def task_of(batch, seen, plan=Plan()):  # noqa: B008
    return Planner(batch, plan)(seen).task[0]


def test_a_robot_leaves_to_a_peer_what_that_peer_does_better():
    batch, seen = two_idle()
    assert task_of(batch, seen) == 0, "alone it takes the nearest"
    hear(seen)
    assert task_of(batch, seen) == 1, "the peer stands beside the nearest one"
    assert task_of(batch, seen, ABLATIONS["no-assignment"]) == 0
    hear(seen, activity=Activity.FAILED)
    assert task_of(batch, seen) == 0, "a failed peer does nothing"


def test_a_claim_counts_and_is_forgotten():
    batch, seen = two_idle()
    hear(seen, x=0.0, y=0.0, task=0, activity=Activity.TRAVELLING, age=0.0)
    seen.robot_tasks["claimed_by"][0, 0], seen.robot_tasks["claim_age"][0, 0] = 1, 0.0
    assert task_of(batch, seen) == 1
    assert task_of(batch, seen, ABLATIONS["no-assignment"]) == 1, "Greedy's rule, too"
    old = CLAIM_TRUST + 1
    seen.robot_tasks["claim_age"][0, 0] = old
    assert task_of(batch, seen, ABLATIONS["no-assignment"]) == 0


def test_a_peer_on_its_way_is_reckoned_on():
    batch, seen = two_idle()
    set_places(seen.robot_tasks, [(1000, 0), (2000, 0), (0, 9000)])
    hear(seen, x=1010.0, task=2, activity=Activity.TRAVELLING, age=0.0)
    beside = task_of(batch, seen, Plan(heeds_claims=False))
    hear(seen, x=1010.0, task=2, activity=Activity.TRAVELLING, age=400.0)
    assert beside == 1 and task_of(batch, seen, Plan(heeds_claims=False)) == 0, "by now it is at the other end of the map"
    assert task_of(batch, seen, Plan(heeds_claims=False, reckons=False)) == 1


def test_a_service_occupies_its_robot_and_its_task():
    batch, seen = two_idle()
    hear(seen, task=0, activity=Activity.SERVICING, age=1.0)
    assert task_of(batch, seen) == 1
    hear(seen, task=0, activity=Activity.SERVICING, age=500.0)
    assert task_of(batch, seen) == 1, "it ended long ago, and the peer is free beside task 0"
    hear(seen, x=5000.0, task=0, activity=Activity.SERVICING, age=500.0)
    assert task_of(batch, seen) == 0


@pytest.mark.parametrize(
    "fields", [dict(status=Status.DONE), dict(legal=0), dict(released=0), dict(status=Status.SERVICED, age=2.0)]
)
def test_what_is_done_masked_unknown_or_at_work_is_not_planned(fields):
    batch, seen = two_idle()
    for name, value in fields.items():
        seen.robot_tasks[name][0, 0] = value
    assert task_of(batch, seen) == 1
    seen.robot_tasks["legal"][0] = 0
    assert task_of(batch, seen) == IDLE


def test_help_is_expected_and_makes_hard_tasks_worth_while():
    batch, seen = two_idle()
    set_places(seen.robot_tasks, [(100, 0), (100, 1), (5000, 5000)])
    seen.robot_tasks["difficulty"][0, :2], seen.robot_tasks["value"][0, :2] = (0.7, 0.3), (2.5, 1)
    seen.robot_tasks["deadline"] = 1500
    assert task_of(batch, seen) == 0
    assert task_of(batch, seen, ABLATIONS["no-control-expected"]) == 1


def test_settled_robots_keep_their_task():
    batch, seen = two_idle()
    seen.robots["task"], seen.robots["can_keep"], seen.robots["activity"] = 2, 1, Activity.SERVICING
    assert task_of(batch, seen) == KEEP
    seen.robots["activity"], seen.robots["can_idle"] = Activity.TRAVELLING, 0
    assert task_of(batch, seen) == KEEP
    seen.robots["can_idle"] = 1
    assert task_of(batch, seen) == 0


def test_changes_of_plan_are_told_at_once_and_the_rest_seldom():
    batch = MissionBatch("medium", [1, 2])
    planner, told, spoke, changes = Planner(batch), {}, {}, 0
    while batch.time.max() < 400 and not batch.over.any():
        seen = batch.observations
        decisions = planner(seen)
        for i, robot in enumerate(seen.robots):
            key, now = (int(robot["mission"]), int(robot["robot"])), float(robot["time"])
            plan = robot["task"] if decisions.task[i] == KEEP else decisions.task[i]
            is_news = told.get(key) != plan
            assert decisions.broadcast[i] == (robot["can_broadcast"] and (is_news or robot["since_broadcast"] >= PERIOD))
            if decisions.broadcast[i]:
                told[key], spoke[key], changes = plan, now, changes + is_news
        batch.step(decisions)
    assert changes > 50


def test_queries_go_with_far_tasks_and_once_a_minute_from_work():
    batch = MissionBatch("medium", [1, 2])
    planner, asked, from_work = Planner(batch), {}, 0
    while batch.time.max() < 400 and not batch.over.any():
        seen = batch.observations
        decisions = planner(seen)
        for i, robot in enumerate(seen.robots):
            key, now, task = (int(robot["mission"]), int(robot["robot"])), float(robot["time"]), decisions.task[i]
            is_far = task >= 0 and seen.robot_tasks[i, task]["distance"] > FAR * robot["speed"]
            is_under_way = robot["activity"] == Activity.SERVICING and robot["progress"] > WELL_UNDER_WAY
            is_at_work = is_under_way and now - asked.get(key, -np.inf) > ASKING_PERIOD
            is_open = seen.robot_operators["legal"][i].any()
            assert (decisions.query[i] != NOBODY) == (is_open and (is_far or is_at_work))
            assert not (decisions.assist[i] and decisions.query[i] != NOBODY)
            if decisions.query[i] != NOBODY:
                asked[key], from_work = now, from_work + is_at_work
        batch.step(decisions)
    assert from_work > 10


def test_a_planner_serves_a_mission_that_begins_in_the_place_of_another():
    batch = MissionBatch(SHORT, [1])
    planner = Planner(batch)
    fly(batch, planner)
    batch.restart(0, 2)
    batch.step(planner(batch.observations))
    fly(batch, planner)
    fresh = MissionBatch(SHORT, [2])
    assert fingerprint(fly(fresh, Planner(fresh)).state) == fingerprint(batch.state)


def test_tasks_that_are_urgent_or_hard_or_done_soon_come_first():
    """Of two tasks alike but for one thing, the planner takes what its worth a second alone would leave."""
    batch, seen = two_idle()
    tasks, plain_worth = seen.robot_tasks, ABLATIONS["plain-worth"]
    set_places(tasks, [(1000, 0), (0, 1000), (0, 90_000)])
    tasks["legal"][0, 2] = 0
    for name, values in dict(deadline=(60, 800), difficulty=(0.9, 0.2), decay=(1e6, 1e6)).items():
        tasks[name][0, :2] = values
    both = [task_of(batch, seen, plan) for plan in (plain_worth, Plan())]
    assert both == [1, 0], "urgent and hard before easy"
    tasks["difficulty"][0, :2], tasks["deadline"][0, :2] = 0.2, 60
    set_places(tasks, [(1000, 0), (0, 1500), (0, 90_000)])
    tasks["value"][0, :2] = 2.0, 2.6
    assert [task_of(batch, seen, plan) for plan in (plain_worth, Plan())] == [1, 0], "near before a little more value"


def test_operators_persist_and_rest_when_tired():
    pilot = Pilot(plain(telemetry_period=1.0, service_base=200.0, difficulty=(1.0, 1.0), generalist=(0.2, 0.2)))
    planner, fickle = Planner(pilot.batch), Planner(pilot.batch, ABLATIONS["fickle"])
    pilot.wait(8)
    seen = copied(pilot.batch.observations)
    first = planner(seen).operator[0]
    assert first >= 0
    seen.operators["fatigue"] = TIRED
    assert planner(seen).operator[0] == REST
    seen.operators["session"], seen.operators["robot"], seen.operators["can_keep"] = Session.HELD, first, 1
    seen.operators["since_bid"], seen.operators["proficiency"] = 1000.0, 5.0
    seen.operator_reports["legal"][0, first] = 0
    assert (planner(seen).operator[0], fickle(seen).operator[0]) == (KEEP, REST), "whatever the gain, until the task is done"
    seen.operators["exempt"], seen.operators["fatigue"], seen.operators["proficiency"] = 1, 0.0, 0.2
    assert planner(seen).operator[0] == KEEP, "its next task gains most, too"
    seen.operator_reports["task"][0, first] = NOBODY
    assert planner(seen).operator[0] not in (KEEP, first)


def test_operators_count_what_a_session_costs_beside():
    """Of two robots whose tasks gain alike by control in a second, the one whose control lasts longer is taken."""
    pilot = Pilot(plain(telemetry_period=1.0, difficulty=(1.0, 1.0)))
    planner, fickle = Planner(pilot.batch), Planner(pilot.batch, ABLATIONS["fickle"])
    pilot.wait(8)
    seen = copied(pilot.batch.observations)
    reports = seen.operator_reports
    reports[0] = reports[0, 0]
    reports["legal"][0, 2:], reports["progress"][0] = 0, 0.0
    reports["progress"][0, 0], reports["distance"][0] = 0.9, 0.0
    gained = [gain(pilot.batch.rules, seen.operators[0], reports[0, r]) for r in (0, 1)]
    reports["value"][0, 0] *= 1.01 * gained[1] / gained[0]
    assert (fickle(seen).operator[0], planner(seen).operator[0]) == (0, 1)


@pytest.mark.parametrize("name", ABLATIONS)
def test_every_ablation_flies_by_its_name_and_differs(name):
    info = find_policy(f"planner+{name}")
    assert not info.is_privileged
    ends = []
    for policy in ("planner", f"planner+{name}"):
        batch, pilot = prepare(policy, "medium", [1, 2, 3, 4])
        ends.append(fingerprint(fly(batch, pilot, seconds=600).state))
    assert ends[0] != ends[1]


def test_unknown_ablations_are_refused_with_those_there_are():
    with pytest.raises(ValueError, match="'planner.nothing'.*planner. one of no-assignment"):
        find_policy("planner+nothing")
    with pytest.raises(ValueError, match="plan"):
        Planner(MissionBatch("small", [1]), "whole")


@pytest.mark.parametrize("plan", [Plan(), ABLATIONS["clocked"]])
def test_whole_missions_inside_a_kernel_are_the_same_to_the_bit(plan):
    one, other = (MissionBatch(SHORT, [1, 2, 3]) for _ in range(2))
    fly_whole(one, plan)
    fly(other, Planner(other, plan))
    assert fingerprint(one.state) == fingerprint(other.state) and one.over.all()
    assert [score.twcr for score in one.scores()] == [score.twcr for score in other.scores()]
