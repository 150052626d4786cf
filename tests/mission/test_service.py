"""Robots at work: speeds, arrival, service, success, incompatible tasks and the resolver."""

import numpy as np
import pytest
from flying import Pilot, Wanderer, fly, plain

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, Activity, Kind, Mode, Status, TaskType
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.mission.score import twcr
from commhg_mj.policies import prepare


def alone(**fields):
    """One UAV, one task due north of it."""
    pilot = Pilot(
        plain(**(dict(n_uav=1, n_operators=0, n_tasks=1, difficulty=(0.5, 0.5), sensing_radius=0.02) | fields))
    )
    return pilot


def test_service_starts_on_arrival_and_takes_the_time_that_the_rules_say():
    pilot = alone(service_base=20.0, service_per_difficulty=60.0, success_autonomous=(1.0, 0.0))
    way = np.hypot(pilot.tasks["x"][0] - pilot.robots["x"][0], pilot.tasks["y"][0] - pilot.robots["y"][0])
    pilot.wait_until(lambda: pilot.robots["activity"][0] == Activity.SERVICING)
    assert pilot.now == int(np.ceil(way / 18.0 - 1e-9)) and pilot.tasks["status"][0] == Status.SERVICED
    arrived = pilot.now
    pilot.wait_until(lambda: pilot.batch.over[0])
    assert pilot.tasks["done_at"][0] == arrived + 50 and pilot.tasks["done_by"][0] == 0
    assert pilot.batch.scores()[0].completion == 1 and pilot.now == arrived + 50, "nothing is left to do"


@pytest.mark.parametrize("n_uav, speed", [(1, 18.0), (0, 5.0)])
def test_autonomous_speed(n_uav, speed):
    pilot = alone(n_uav=n_uav, n_ugv=1 - n_uav)
    x, y = pilot.robots["x"][0], pilot.robots["y"][0]
    pilot.wait(1)
    assert np.hypot(pilot.robots["x"][0] - x, pilot.robots["y"][0] - y) == pytest.approx(speed)


def test_a_failed_attempt_leaves_the_task_open_without_progress():
    pilot = alone(service_base=3.0, service_per_difficulty=0.0, success_autonomous=(0.0, 0.0))
    pilot.step(robots={0: dict(task=0)})
    pilot.wait_until(lambda: pilot.tasks["progress"][0] > 0.5).wait_until(lambda: pilot.tasks["progress"][0] == 0)
    assert pilot.tasks["status"][0] != Status.DONE and pilot.tasks["done_at"][0] < 0
    pilot.wait_until(lambda: pilot.tasks["progress"][0] > 0.5)
    assert pilot.batch.scores()[0].completion == 0


def test_progress_of_a_task_that_is_left_stays():
    pilot = alone(service_base=40.0)
    pilot.wait_until(lambda: pilot.tasks["progress"][0] > 0.2).step(robots={0: dict(task=IDLE)})
    left = pilot.tasks["progress"][0]
    pilot.wait(3)
    assert left > 0.2 and pilot.tasks["progress"][0] == left and pilot.tasks["status"][0] == Status.OPEN
    pilot.step(robots={0: dict(task=0)}).wait(2)
    assert pilot.tasks["progress"][0] > left


@pytest.mark.parametrize("difficulty, expected", [(0.0, 0.9), (1.0, 0.4)])
def test_success_comes_as_often_as_difficulty_says(difficulty, expected):
    scenario = plain(
        n_uav=1, n_operators=0, n_tasks=1, difficulty=(difficulty, difficulty), service_base=1.0,
        service_per_difficulty=0.0, success_autonomous=(0.9, 0.5), autonomous_speed=(1000.0, 1000.0), time_limit=30,
    )  # fmt: skip
    n = 600
    batch = MissionBatch(scenario, range(n), "abstract")
    while not batch.over.all():
        batch.step(stay(batch.observations))
    # One second to arrive, one for every attempt: the first attempts end at 2.
    first = np.sum(batch.state.tasks["done_at"] == 2)
    assert abs(first - n * expected) < 4 * np.sqrt(n * expected * (1 - expected))
    second = np.sum(batch.state.tasks["done_at"] == 3)
    share = expected * (1 - expected)
    assert abs(second - n * share) < 4 * np.sqrt(n * share * (1 - share))


def test_control_and_fatigue_change_the_odds_of_success():
    def share(fatigue, n=500):
        scenario = plain(
            n_uav=1, n_tasks=1, difficulty=(1.0, 1.0), service_base=60.0, service_per_difficulty=0.0, handover=0.0,
            success_autonomous=(0.5, 0.0), success_controlled=(0.9, 0.2, 0.4), fatigue_rate=0.0, recovery_rate=0.0,
            time_limit=70, autonomous_speed=(1000.0, 1000.0), fatigue_slowdown=0.0, generalist=(1.0, 1.0),
        )  # fmt: skip
        batch = MissionBatch(scenario, range(n), "abstract")  # whose worlds are drawn fastest
        batch.state.operators["fatigue"] = fatigue
        while not batch.over.all():
            decisions = stay(batch.observations)
            seen = batch.observations
            bids = (seen.operators["session"] == 0) & (seen.operator_reports["legal"][:, 0] == 1)
            decisions.operator[bids] = 0
            batch.step(decisions)
        return np.mean(batch.state.tasks["done_at"] >= 0), 4 * np.sqrt(0.25 / n)

    for fatigue in (0.0, 0.75):
        observed, slack = share(fatigue)
        assert abs(observed - (0.9 - 0.2 - 0.4 * fatigue)) < slack + 0.05 * (0.2 - 0.4 * fatigue), "3 of 60 s were autonomous"


def test_success_goes_by_the_share_of_the_service_that_was_controlled():
    """A quarter autonomous, three quarters controlled: whose mode the last second has does not matter."""
    for controlled_last in (False, True):
        pilot = alone(
            n_operators=1, service_base=40.0, service_per_difficulty=0.0, difficulty=(0.0, 0.0), handover=0.0,
            success_autonomous=(0.4, 0.0), success_controlled=(1.0, 0.0, 0.0), fatigue_slowdown=0.0, generalist=(1.0, 1.0),
            fatigue_rate=0.0,
        )  # fmt: skip
        pilot.operators["proficiency"] = 1.0
        pilot.heard().wait_until(lambda p=pilot: p.robots["activity"][0] == Activity.SERVICING)
        first, last = (Mode.AUTONOMOUS, Mode.CONTROLLED) if controlled_last else (Mode.CONTROLLED, Mode.AUTONOMOUS)
        shares = {first: 0.25 if controlled_last else 0.75, last: 0.75 if controlled_last else 0.25}
        for mode in (first, last):
            pilot.robots["mode"], pilot.robots["lease_until"] = mode, 1e9
            pilot.robots["controller"] = 0 if mode == Mode.CONTROLLED else NOBODY
            pilot.wait(int(round(40 * shares[mode])) - (mode == last))
        assert pilot.tasks["chance"][0] == pytest.approx(0.25 * 0.4 + 0.75 * 1.0, abs=0.04)


def test_choosing_an_incompatible_task_costs_by_its_true_type_of_that_second():
    pilot = alone(incompatible_cost=0.3, sensing_radius=0.0, n_tasks=2)
    other = 1 - pilot.robots["task"][0]
    pilot.tasks["type"][other] = TaskType.UGV_ONLY
    pilot.step(robots={0: dict(task=other)})
    score = pilot.batch.scores()[0]
    assert score.incompatibles == 1 and score.reward_coordination == pytest.approx(-0.3 * 2.0), "of a mean task's value"
    pilot.wait_until(lambda: pilot.robots["task"][0] == NOBODY)
    assert pilot.batch.scores()[0].incompatibles == 1, "the way in vain is the price of finding out"


def test_a_refused_claim_of_an_incompatible_task_costs_nothing():
    pilot = alone(incompatible_cost=0.3, sensing_radius=0.0, n_uav=2, n_tasks=2)
    other = int(pilot.robots["task"][1])
    pilot.tasks["type"][other] = TaskType.UGV_ONLY
    pilot.step(robots={0: dict(task=other)})
    assert pilot.batch.scores()[0].incompatibles == 0 and pilot.batch.scores()[0].refusals == 1


def test_a_task_that_turned_incompatible_under_way_is_discovered_on_arrival_at_no_further_cost():
    pilot = alone(incompatible_cost=0.3, sensing_radius=0.0)
    pilot.tasks["type"] = TaskType.UGV_ONLY
    pilot.wait_until(lambda: pilot.robots["task"][0] == NOBODY)
    score = pilot.batch.scores()[0]
    assert score.incompatibles == 0 and score.reward_coordination == 0
    assert pilot.beliefs["type"][0, 0] == TaskType.UGV_ONLY, "sensed where it stands"
    assert pilot.robots["activity"][0] == Activity.IDLE and pilot.batch.observations.robot_tasks["legal"][0, 0] == 0


def test_a_robot_turns_away_as_soon_as_it_senses_that_its_task_is_incompatible():
    """The way was in vain: that is the price, wherever it is discovered; the task is masked from then on."""
    pilot = alone(sensing_radius=0.2, robot_period=3600)
    pilot.tasks["type"] = TaskType.UGV_ONLY
    pilot.step()
    robot, task = pilot.robots[0], pilot.tasks[0]
    assert np.hypot(task["x"] - robot["x"], task["y"] - robot["y"]) > 50, "still on its way"
    assert robot["task"] == NOBODY and robot["due"] == 1 and task["owner"] == NOBODY
    assert pilot.batch.observations.robot_tasks["legal"][0, 0] == 0
    assert pilot.batch.scores()[0].incompatibles == 0


def test_a_delivered_contradiction_asks_the_robot_to_decide_and_masks_keep():
    pilot = alone(sensing_radius=0.0, n_uav=2, n_tasks=3, robot_period=3600)
    j = pilot.robots["task"][0]
    belief = pilot.beliefs[1, j : j + 1]
    belief["time"], belief["type"] = 0, TaskType.UGV_ONLY
    pilot.step(robots={1: dict(broadcast=True)}).wait_until(lambda: pilot.robots["due"][0] == 1, 9)
    with pytest.raises(ValueError, match="uav0 of mission 0 .*there is no task to KEEP"):
        pilot.step(robots={0: dict(task=KEEP)})
    pilot.step(robots={0: dict(task=IDLE)})
    assert pilot.batch.scores()[0].incompatibles == 0, "leaving on others' word costs nothing"


def test_arriving_at_a_task_that_is_done_ends_the_assignment_at_no_cost():
    pilot = Pilot(plain(n_operators=0, n_tasks=2, sensing_radius=0.0))
    j = pilot.robots["task"][0]
    pilot.tasks["status"][j], pilot.tasks["done_at"][j], pilot.tasks["progress"][j] = Status.DONE, 0, 1
    pilot.wait_until(lambda: pilot.robots["task"][0] != j)
    assert pilot.beliefs["status"][0, j] == Status.DONE and pilot.batch.scores()[0].reward_coordination == 0


def test_robots_sense_within_their_radius_and_where_they_stand():
    pilot = Pilot(plain(n_tasks=40, sensing_radius=0.1, n_uav=1, n_operators=0))
    pilot.wait(5)
    robot, tasks = pilot.robots[0], pilot.tasks
    near = np.hypot(tasks["x"] - robot["x"], tasks["y"] - robot["y"]) <= 50
    assert np.array_equal(pilot.beliefs["time"][0] == pilot.now, near)
    pilot = alone(sensing_radius=0.0)
    pilot.wait_until(lambda: pilot.robots["activity"][0] == Activity.SERVICING)
    assert pilot.beliefs["time"][0, 0] == pilot.now


def test_the_first_claim_wins_and_the_later_robot_stands_until_it_knows():
    """Idle, with every task masked, free to speak and to ask; then due, with that task masked for a while longer."""
    pilot = Pilot(plain(n_uav=2, arbitration=6.0, refusal=7.0))
    pilot.step(robots={r: dict(task=IDLE) for r in range(2)})
    start = pilot.now
    pilot.step(robots={0: dict(task=2), 1: dict(task=2)})
    assert pilot.now == start + 1 and pilot.batch.scores()[0].refusals == 1
    for second in range(1, 6):
        robot, tasks = pilot.batch.observations.robots[1], pilot.batch.observations.robot_tasks[1]
        assert robot["stand_left"] == 6 - second and not tasks["legal"].any()
        assert pilot.robots["task"][1] == NOBODY and pilot.robots["activity"][1] == Activity.IDLE
        asks = {1: dict(query=0)} if second == 1 else {}
        pilot.step(robots=asks)
    assert pilot.counters[Kind.QUERY]["sent"] == 1
    robot, tasks = pilot.batch.observations.robots[1], pilot.batch.observations.robot_tasks[1]
    assert robot["stand_left"] == 0 and tasks["legal"].tolist() == [1, 1, 0, 1], "the refused one is masked for longer"
    pilot.wait(7)
    assert pilot.batch.observations.robot_tasks["legal"][1, 2] == 1


def test_a_robot_that_stood_is_due():
    pilot = Pilot(plain(n_operators=0, arbitration=6.0, robot_period=3600, service_base=3000.0))
    one, other = pilot.robots["task"].tolist()
    pilot.step(robots={0: dict(task=other)})
    assert pilot.now == 6 and pilot.batch.observations.robots[["robot", "stand_left"]].tolist() == [(0, 0)]


def test_where_arbitration_takes_no_time_the_later_robot_decides_again_at_once():
    pilot = Pilot(plain(n_uav=3, n_operators=0, refusal=7.0, arbitration=0.0))
    pilot.step(robots={r: dict(task=IDLE) for r in range(3)})
    now = pilot.now
    pilot.step(robots={0: dict(task=2), 1: dict(task=2), 2: dict(task=1)})
    assert pilot.tasks["owner"].tolist() == [NOBODY, 2, 0, NOBODY] and pilot.robots["task"][1] == NOBODY
    assert pilot.now == now and pilot.batch.observations.robots["robot"].tolist() == [1], "no second has passed"
    assert pilot.batch.observations.robot_tasks["legal"][0, 2] == 0 and pilot.batch.scores()[0].refusals == 1
    pilot.step(robots={1: dict(task=3)}).wait(7)
    row = list(pilot.batch.observations.robots["robot"]).index(1)
    assert pilot.batch.observations.robot_tasks["legal"][row, 2] == 1, "open again after a while"


def test_tasks_that_are_given_up_are_free_before_any_claim_is_heard():
    pilot = Pilot(plain(n_operators=0, n_tasks=2))
    one, other = pilot.robots["task"].tolist()
    pilot.step(robots={0: dict(task=other), 1: dict(task=one)})
    assert pilot.robots["task"].tolist() == [other, one] and pilot.batch.scores()[0].refusals == 0


def test_the_initializer_sends_robots_to_different_compatible_tasks():
    batch = MissionBatch(plain(n_uav=3, n_ugv=3, n_tasks=12, type_shares=(0.3, 0.3, 0.4)), range(10))
    for robots, tasks in zip(batch.state.robots, batch.state.tasks):
        chosen = robots["task"][robots["task"] >= 0]
        assert len(set(chosen)) == len(chosen) >= 4
        types = tasks["type"][robots["task"]]
        assert np.all((types != 1 - robots["embodiment"]) | (robots["task"] < 0))


def test_a_first_target_is_prescribed_until_it_ends_or_time_runs_out():
    pilot = Pilot(plain(initial_phase=0.1, map_side=5000.0, n_operators=0))
    first = pilot.robots["task"][0]
    while pilot.now < 30:
        i = list(pilot.batch.observations.robots["robot"]).index(0)
        row, tasks = pilot.batch.observations.robots[i], pilot.batch.observations.robot_tasks[i]
        assert row["prescribed"] == 1 and row["can_idle"] == 0 and not tasks["legal"].any()
        pilot.step(robots={0: dict(broadcast=bool(row["can_broadcast"]))})
    row, tasks = pilot.batch.observations.robots[0], pilot.batch.observations.robot_tasks[0]
    assert row["prescribed"] == 0 and row["can_idle"] == 1 and tasks["legal"].sum() == 3
    assert pilot.robots["task"][0] == first
    pilot = Pilot(
        plain(
            initial_phase=1.0,
            n_operators=0,
            service_base=1.0,
            service_per_difficulty=0.0,
            success_autonomous=(1.0, 0.0),
        )
    )
    pilot.wait_until(lambda: pilot.robots["task"][0] == NOBODY)
    assert pilot.robots["prescribed"][0] == 0


def test_a_type_changes_only_while_nobody_works_on_the_task():
    for serviced in (False, True):
        pilot = alone(service_base=100.0, n_tasks=2)
        j = pilot.robots["task"][0]
        pilot.wait_until(lambda p=pilot: p.robots["activity"][0] == Activity.SERVICING)
        task = pilot.tasks[j : j + 1] if serviced else pilot.tasks[1 - j : 2 - j]
        task["change_at"], task["changes_to"] = pilot.now + 2, TaskType.UGV_ONLY
        pilot.wait(3)
        assert task["type"][0] == (TaskType.GENERAL if serviced else TaskType.UGV_ONLY)


def test_a_type_does_not_change_in_a_handover_without_progress_either():
    pilot = alone(n_operators=1, handover=100.0, lease=200.0)
    pilot.heard().step(operators={0: 0}).wait_until(lambda: pilot.robots["activity"][0] == Activity.SERVICING)
    assert pilot.robots["mode"][0] == Mode.HANDOVER and pilot.tasks["progress"][0] == 0
    pilot.tasks["change_at"], pilot.tasks["changes_to"] = pilot.now + 2, TaskType.UGV_ONLY
    pilot.wait(4)
    assert pilot.tasks["type"][0] == TaskType.GENERAL and pilot.tasks["progress"][0] == 0


def test_a_partly_serviced_task_does_not_change_even_when_left():
    pilot = alone(service_base=100.0)
    pilot.wait_until(lambda: pilot.tasks["progress"][0] > 0).step(robots={0: dict(task=IDLE)})
    pilot.tasks["change_at"], pilot.tasks["changes_to"] = pilot.now + 2, TaskType.UGV_ONLY
    pilot.wait(4)
    assert pilot.tasks["type"][0] == TaskType.GENERAL


def test_malfunctions_come_as_often_as_the_scenario_says():
    scenario = plain(n_uav=8, n_operators=0, malfunction=0.3, time_limit=80)
    batch = fly(MissionBatch(scenario, range(100), "abstract"), Wanderer())
    failed, n = np.mean(batch.state.robots["activity"] == Activity.FAILED), 800
    assert abs(failed - 0.3) < 4 * np.sqrt(0.21 / n) + 0.02
    lucky = fly(MissionBatch(plain(malfunction=0.0, time_limit=80), range(5)), Wanderer())
    assert not np.any(lucky.state.robots["activity"] == Activity.FAILED)


def test_a_malfunction_ends_the_mission_when_nobody_is_left():
    pilot = alone()
    pilot.batch.state.missions["rules"]["hazard"] = 1.0
    pilot.step()
    assert pilot.batch.over[0] and pilot.now == 1 and pilot.tasks["owner"][0] == NOBODY


def test_late_completion_is_worth_less():
    pilot = alone(deadline=(5.0, 5.0), decay=(50.0, 50.0), success_autonomous=(1.0, 0.0))
    pilot.wait_until(lambda: pilot.batch.over[0])
    late = pilot.tasks["done_at"][0] - 5
    score = pilot.batch.scores()[0]
    assert score.twcr == pytest.approx(np.exp(-late / 50)) and score.mean_lateness == late and score.on_time == 0
    assert score.lateness_loss == pytest.approx(1 - score.twcr)


def test_twcr_of_hand_made_completions():
    value, deadline, decay = np.array([1.0, 2.0, 3.0, 4.0]), np.full(4, 100.0), np.full(4, 50.0)
    done = np.array([100.0, 150.0, -1.0, 20.0])
    assert twcr(value, deadline, decay, done) == pytest.approx((1 + 2 * np.exp(-1) + 4) / 10)


def test_releases_are_announced_in_their_second():
    batch, policy = prepare("random", plain(released_at_start=0.5, last_release=0.5, n_tasks=40, time_limit=60), [1])
    assert batch.state.tasks["released"].sum() == 20
    while not batch.over[0]:
        tasks = batch.state.tasks[0]
        assert np.array_equal(tasks["released"] == 1, tasks["release"] <= batch.time[0])
        batch.step(policy(batch.observations))
    assert np.all(batch.state.tasks["release"] <= 30) and np.all(batch.state.tasks["release"] >= 0)


def test_a_controlled_robot_services_in_controlled_mode_only():
    pilot = alone(n_operators=1, service_base=500.0, handover=20.0)
    pilot.wait_until(lambda: pilot.robots["activity"][0] == Activity.SERVICING)
    pilot.step(operators={0: 0}).wait_until(lambda: pilot.robots["mode"][0] == Mode.HANDOVER)
    pilot.wait(1)
    before = pilot.tasks["progress"][0]
    pilot.wait(10)
    assert pilot.tasks["progress"][0] == before
