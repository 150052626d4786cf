"""Operators: bids, handover, leases, conflicts, switches, rest and fatigue."""

import numpy as np
import pytest
from flying import Pilot, plain

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, REST, Activity, Fate, Kind, Mode, Session
from commhg_mj.mission.batch import MissionBatch


def held(pilot, h=0, r=0):
    """Whether operator h holds robot r, as both of them see it."""
    is_held = pilot.operators["session"][h] == Session.HELD and pilot.operators["robot"][h] == r
    assert is_held == (pilot.robots["controller"][r] == h)
    return is_held


def controlling(pilot, h=0, r=0):
    """Wait until operator h controls robot r after the handover."""
    pilot.step(operators={h: r})
    return pilot.wait_until(lambda: pilot.robots["mode"][r] == Mode.CONTROLLED, 30)


def service_under_way(**fields):
    """A pilot whose robot 0 services a hard task that lasts long."""
    fields = dict(difficulty=(1.0, 1.0), service_base=2000.0, success_autonomous=(1.0, 0.0)) | fields
    pilot = Pilot(plain(**fields))
    return pilot.wait_until(lambda: pilot.robots["activity"][0] == Activity.SERVICING)


def progress(pilot, r=0):
    return pilot.tasks["progress"][pilot.robots["task"][r]]


def test_control_takes_delivery_then_handover():
    pilot = Pilot(plain(handover=5.0))
    pilot.step(operators={0: 0})
    assert pilot.operators["session"][0] == Session.BID and not held(pilot)
    pilot.wait_until(lambda: held(pilot), 5)
    accepted = pilot.now
    assert accepted >= 2, "queued at 0, sent at 1, delivered at 2"
    assert pilot.robots["mode"][0] == Mode.HANDOVER
    pilot.wait_until(lambda: pilot.robots["mode"][0] == Mode.CONTROLLED, 10)
    assert pilot.now - accepted == 5


def test_a_handover_makes_no_progress_and_then_service_goes_at_the_operators_speed():
    pilot = service_under_way(generalist=(0.5, 0.5), fatigue_rate=0.0)
    pilot.operators["proficiency"] = 0.5
    pilot.wait(1)
    before = progress(pilot)
    pilot.wait(1)
    assert progress(pilot) - before == pytest.approx(1 / 2070)
    pilot.step(operators={0: 0}).wait_until(lambda: held(pilot), 5)
    pilot.wait(1)
    before = progress(pilot)
    while pilot.robots["mode"][0] == Mode.HANDOVER:
        assert progress(pilot) == before
        pilot.wait(1)
    before = progress(pilot)
    pilot.wait(10)
    assert progress(pilot) - before == pytest.approx(10 / (2070 * 0.5))


def test_fatigue_slows_controlled_service():
    pilot = service_under_way(fatigue_rate=0.0, recovery_rate=0.0, fatigue_slowdown=0.5)
    pilot.operators["proficiency"], pilot.operators["fatigue"] = 0.9, 0.4
    controlling(pilot)
    before = progress(pilot)
    pilot.wait(1)
    assert progress(pilot) - before == pytest.approx(1 / (2070 * 0.9 * 1.2))


def test_proficiency_goes_by_the_robots_embodiment():
    pilot = Pilot(plain(n_uav=1, n_ugv=1, service_base=1000.0, difficulty=(0.0, 0.0), fatigue_rate=0.0))
    pilot.operators["proficiency"] = [[0.5, 2.0]]
    for r, seconds in ((0, 500), (1, 2000)):
        pilot.wait_until(lambda r=r: pilot.robots["activity"][r] == Activity.SERVICING)
        controlling(pilot, 0, r)
        before = progress(pilot, r)
        pilot.wait(1)
        assert progress(pilot, r) - before == pytest.approx(1 / seconds)
        pilot.step(operators={0: REST}).wait(1)


def test_a_lease_lapses_without_delivered_renewals():
    pilot = Pilot(plain(lease=12.0, renewal_period=3600.0))
    pilot.step(operators={0: 0}).wait_until(lambda: held(pilot), 5)
    accepted = pilot.now
    pilot.wait_until(lambda: not held(pilot), 30)
    assert pilot.now - accepted == 12 and pilot.robots["mode"][0] == Mode.AUTONOMOUS
    assert pilot.operators["session"][0] == Session.REST and pilot.batch.scores()[0].switches == 0


def test_keep_renews_the_lease():
    pilot = Pilot(plain(lease=12.0, renewal_period=5.0, time_limit=120))
    pilot.step(operators={0: 0}).wait_until(lambda: held(pilot), 5)
    for _ in range(80):
        pilot.step()
        assert held(pilot)
    sent = pilot.counters[Kind.RENEWAL]["sent"]
    assert 80 / 6 <= sent <= 80 / 5 + 1, "renewed every renewal period, no oftener"


def test_a_renewal_lengthens_control_by_one_lease_and_no_more():
    pilot = Pilot(plain(lease=12.0, renewal_period=6.0))
    pilot.step(operators={0: 0}).wait_until(lambda: pilot.counters[Kind.RENEWAL]["fate"][Fate.DELIVERED] == 1)
    renewed = pilot.now
    pilot.batch.state.missions["rules"]["renewal_period"] = 3600.0
    pilot.wait_until(lambda: not held(pilot), 40)
    assert pilot.now - renewed == 12


def test_renewals_that_are_not_delivered_renew_nothing():
    pilot = Pilot(plain(lease=12.0, renewal_period=5.0, refill=0.0))
    pilot.operators["tokens"] = 48.0
    pilot.step(operators={0: 0}).wait_until(lambda: held(pilot), 5)
    accepted = pilot.now
    pilot.wait_until(lambda: not held(pilot), 30)
    assert pilot.now - accepted == 12 and pilot.counters[Kind.RENEWAL]["sent"] == 0


def test_a_bid_that_is_not_accepted_is_given_up():
    pilot = Pilot(plain(refill=0.0, bid_timeout=9.0))
    pilot.operators["tokens"] = 0.0
    pilot.step(operators={0: 0}).wait(7)
    assert pilot.operators["session"][0] == Session.BID
    pilot.wait(1)
    assert pilot.operators["session"][0] == Session.REST and pilot.operators["robot"][0] == NOBODY
    assert pilot.counters[Kind.CONTROL]["fate"][Fate.NO_TOKENS] == 1


def test_commanding_a_robot_that_another_holds_is_a_conflict_and_changes_nothing():
    pilot = Pilot(plain(n_operators=2, conflict_cost=0.25, bid_timeout=8.0))
    controlling(pilot)
    before = pilot.batch.scores()[0].reward_coordination
    pilot.step(operators={1: 0}).wait(4)
    score = pilot.batch.scores()[0]
    assert held(pilot) and score.conflicts == 1
    assert score.reward_coordination - before == pytest.approx(-0.25)
    pilot.wait(6)
    assert pilot.operators["session"][1] == Session.REST, "the bid times out"


def test_of_two_bids_the_first_delivered_wins():
    pilot = Pilot(plain(n_operators=2))
    pilot.step(operators={1: 0}).step(operators={0: 0}).wait(4)
    assert held(pilot, 1, 0) and not held(pilot, 0, 0) and pilot.batch.scores()[0].conflicts == 1


def switches(pilot):
    score = pilot.batch.scores()[0]
    assert score.reward_coordination == pytest.approx(-0.5 * score.switches)
    return score.switches


def test_choosing_another_robot_while_holding_one_is_a_switch_and_frees_the_first():
    pilot = Pilot(plain(switch_cost=0.5))
    controlling(pilot, 0, 0)
    pilot.step(operators={0: 1}).wait(1)
    assert switches(pilot) == 1 and pilot.robots["controller"][0] == NOBODY
    pilot.wait_until(lambda: held(pilot, 0, 1), 5)


def test_rest_is_free_and_so_is_choosing_anew_before_a_bid_is_accepted():
    pilot = Pilot(plain(switch_cost=0.5))
    controlling(pilot, 0, 0)
    pilot.step(operators={0: REST}).wait(2)
    assert not held(pilot) and pilot.robots["mode"][0] == Mode.AUTONOMOUS and switches(pilot) == 0
    pilot.step(operators={0: 1}).step(operators={0: 0}).wait(3)
    assert switches(pilot) == 0


def test_leaving_a_robot_that_finished_its_task_is_no_switch():
    pilot = Pilot(
        plain(switch_cost=0.5, service_base=1.0, service_per_difficulty=0.0, success_controlled=(1.0, 0.0, 0.0))
    )
    pilot.step(operators={0: 0}, robots={1: dict(task=IDLE)})
    pilot.wait_until(lambda: pilot.operators["exempt"][0] == 1)
    assert held(pilot) and np.sum(pilot.tasks["status"] == 2) == 1
    pilot.step(operators={0: 1}).wait(4)
    assert switches(pilot) == 0 and held(pilot, 0, 1)


def test_the_exemption_is_gone_once_the_operator_keeps_on():
    pilot = Pilot(
        plain(switch_cost=0.5, service_base=1.0, service_per_difficulty=0.0, success_controlled=(1.0, 0.0, 0.0))
    )
    pilot.step(operators={0: 0}, robots={1: dict(task=IDLE)})
    pilot.wait_until(lambda: pilot.operators["exempt"][0] == 1)
    pilot.step(operators={0: KEEP}, robots={0: dict(task=int(np.flatnonzero(pilot.tasks["status"] == 0)[0]))})
    pilot.step(operators={0: 1}).wait(1)
    assert switches(pilot) == 1


def test_a_malfunction_ends_control_and_exempts_from_the_switch_cost():
    pilot = Pilot(plain(switch_cost=0.5))
    controlling(pilot)
    pilot.batch.state.missions["rules"]["controlled_hazard"] = 1.0
    pilot.batch.state.missions["rules"]["hazard"] = 0.0
    pilot.step()
    pilot.batch.state.missions["rules"]["controlled_hazard"] = 0.0
    assert pilot.robots["activity"][0] == Activity.FAILED and pilot.robots["controller"][0] == NOBODY
    assert pilot.operators["session"][0] == Session.REST
    pilot.step(operators={0: 1}).wait(4)
    assert switches(pilot) == 0 and held(pilot, 0, 1)


def test_a_failure_that_nobody_reported_does_not_show_in_the_operators_choices():
    pilot = Pilot(plain(n_uav=3))
    pilot.robots["activity"][1], pilot.robots["task"][1], pilot.robots["due"][1] = Activity.FAILED, NOBODY, 0
    pilot.tasks["owner"][pilot.tasks["owner"] == 1] = NOBODY
    pilot.wait(8)
    assert pilot.batch.observations.operator_reports["legal"][0].tolist() == [1, 1, 1]
    pilot.step(operators={0: 1}).wait(4)
    assert not held(pilot, 0, 1) and pilot.counters[Kind.CONTROL]["fate"][Fate.LOST] == 1
    assert pilot.batch.observations.operator_reports["legal"][0].tolist() == [1, 0, 1], "but its own bid"


def test_a_command_that_was_withdrawn_in_the_air_does_nothing():
    pilot = Pilot(plain(n_operators=2, delay=4))
    pilot.step(operators={0: 0}).wait(1)
    pilot.step(operators={0: REST}).wait(8)
    assert pilot.robots["controller"][0] == NOBODY and pilot.counters[Kind.CONTROL]["fate"][Fate.DELIVERED] == 1
    pilot.step(operators={1: 0}).wait_until(lambda: held(pilot, 1, 0), 9)
    pilot.step(operators={0: 0}).wait(1).step(operators={0: REST}).wait(8)
    assert held(pilot, 1, 0) and pilot.batch.scores()[0].conflicts == 0


def test_controlled_robots_travel_faster():
    pilot = Pilot(plain(map_side=5000.0, n_uav=1, n_tasks=1))
    pilot.tasks["x"], pilot.tasks["y"] = 2500.0, 4900.0
    pilot.batch.reset()
    x, y = pilot.robots["x"][0], pilot.robots["y"][0]
    pilot.step(robots={0: dict(task=IDLE)}).step(robots={0: dict(task=0)})
    assert np.hypot(pilot.robots["x"][0] - x, pilot.robots["y"][0] - y) == pytest.approx(18)
    controlling(pilot)
    x, y = pilot.robots["x"][0], pilot.robots["y"][0]
    pilot.step()
    assert np.hypot(pilot.robots["x"][0] - x, pilot.robots["y"][0] - y) == pytest.approx(25)


def test_ten_minutes_of_hard_control_tire_a_mean_operator_and_five_of_rest_halve_it():
    pilot = service_under_way(time_limit=2000, service_base=1e5)
    controlling(pilot)
    pilot.operators["fatigue"] = 0.0
    pilot.wait(600)
    tired = pilot.operators["fatigue"][0]
    assert held(pilot) and tired == pytest.approx(0.6, abs=0.01)
    pilot.step(operators={0: REST}).wait(299)
    assert pilot.operators["fatigue"][0] == pytest.approx(tired / 2, abs=0.005)


def test_capacity_slows_fatigue_and_speeds_recovery():
    def after(capacity, rest):
        pilot = service_under_way()
        pilot.operators["capacity"] = capacity
        controlling(pilot)
        pilot.operators["fatigue"] = 0.2
        if rest:
            pilot.step(operators={0: REST})
        pilot.wait(1)
        return pilot.operators["fatigue"][0]

    assert 0.2 < after(1.3, False) < after(0.7, False)
    assert after(1.3, True) < after(0.7, True) < 0.2


def test_workload_is_light_on_the_way_and_grows_with_difficulty():
    def gained(difficulty, activity):
        pilot = Pilot(plain(difficulty=(difficulty, difficulty), service_base=2000.0))
        if activity == Activity.SERVICING:
            pilot.wait_until(lambda: pilot.robots["activity"][0] == activity)
        controlling(pilot)
        if activity == Activity.IDLE:
            pilot.step(robots={0: dict(task=IDLE)})
        pilot.operators["fatigue"] = 0.0
        pilot.step()
        return pilot.operators["fatigue"][0]

    assert 0 < gained(1.0, Activity.IDLE) < gained(0.0, Activity.SERVICING) < gained(1.0, Activity.SERVICING)


def test_profiles_go_round_robin_and_a_pair_is_drawn_per_mission():
    rules = plain().operators
    table = [list(rules.generalist), list(rules.uav_specialist), list(rules.ugv_specialist)]
    batch = MissionBatch(plain(n_operators=7), range(2))
    for operators in batch.state.operators:
        assert operators["proficiency"].tolist() == [table[h % 3] for h in range(7)]
    pairs = MissionBatch(plain(n_operators=2), range(30)).state.operators["proficiency"]
    assert np.all(pairs[:, 0] == rules.generalist)
    specialists = {tuple(pair) for pair in pairs[:, 1]}
    assert specialists == {rules.uav_specialist, rules.ugv_specialist}
    capacity = MissionBatch(plain(n_operators=24, capacity=(0.7, 1.3)), range(20)).state.operators["capacity"]
    assert np.all((capacity >= 0.7) & (capacity <= 1.3)) and abs(capacity.mean() - 1) < 0.05
