"""Operators: bids, handover, leases, conflicts, switches, rest and fatigue."""

import numpy as np
import pytest
from flying import Pilot, plain

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, REST, Activity, Fate, Kind, Mode, Session
from commhg_mj.mission.batch import MissionBatch

MEAN_VALUE = 2.0  # of tasks: costs count in it


def held(pilot, h=0, r=0):
    """Whether operator h has been told that it holds robot r."""
    return pilot.operators["session"][h] == Session.HELD and pilot.operators["robot"][h] == r


def obeys(pilot, h=0, r=0):
    """Whether robot r is operator h's by its own record."""
    return pilot.robots["controller"][r] == h


def controlling(pilot, h=0, r=0):
    """Wait until operator h controls robot r after the handover, and knows it."""
    pilot.heard().step(operators={h: r})
    return pilot.wait_until(lambda: pilot.robots["mode"][r] == Mode.CONTROLLED and held(pilot, h, r), 30)


def service_under_way(**fields):
    """A pilot whose robot 0 services a hard task that lasts long."""
    fields = dict(difficulty=(1.0, 1.0), service_base=2000.0, success_autonomous=(1.0, 0.0)) | fields
    pilot = Pilot(plain(**fields))
    return pilot.wait_until(lambda: pilot.robots["activity"][0] == Activity.SERVICING)


def progress(pilot, r=0):
    return pilot.tasks["progress"][pilot.robots["task"][r]]


def test_control_takes_delivery_then_handover():
    pilot = Pilot(plain(handover=5.0)).heard()
    start = pilot.now
    pilot.step(operators={0: 0})
    assert pilot.operators["session"][0] == Session.BID and not held(pilot)
    pilot.wait_until(lambda: obeys(pilot), 5)
    accepted = pilot.now
    assert accepted - start == 2, "queued at once, sent in the next second, delivered in the one after it"
    assert pilot.robots["mode"][0] == Mode.HANDOVER and not held(pilot), "the operator has not been told"
    pilot.step()
    assert held(pilot), "the robot reports its acceptance at once"
    pilot.wait_until(lambda: pilot.robots["mode"][0] == Mode.CONTROLLED, 10)
    assert pilot.now - accepted == 5


def test_a_handover_makes_no_progress_and_then_service_goes_at_the_operators_speed():
    pilot = service_under_way(generalist=(0.5, 0.5), fatigue_rate=0.0)
    pilot.operators["proficiency"] = 0.5
    pilot.wait(1)
    before = progress(pilot)
    pilot.wait(1)
    assert progress(pilot) - before == pytest.approx(1 / 2070)
    pilot.step(operators={0: 0}).wait_until(lambda: obeys(pilot), 5)
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


def test_a_lease_counts_from_the_second_in_which_it_was_sent_at_both_ends():
    pilot = Pilot(plain(lease=12.0, renewal_period=3600.0, delay=3)).heard()
    pilot.step(operators={0: 0}).wait_until(lambda: pilot.counters[Kind.CONTROL]["sent"] == 1)
    sent = pilot.now
    pilot.wait_until(lambda: held(pilot), 9)
    pilot.wait_until(lambda: not obeys(pilot), 30)
    assert pilot.now - sent == 12 and pilot.robots["mode"][0] == Mode.AUTONOMOUS
    assert pilot.operators["session"][0] == Session.REST and pilot.batch.scores()[0].switches == 0


def test_keep_renews_the_lease():
    pilot = Pilot(plain(lease=12.0, renewal_period=5.0, time_limit=120)).heard()
    pilot.step(operators={0: 0}).wait_until(lambda: held(pilot), 5)
    for _ in range(80):
        pilot.step()
        assert held(pilot) and obeys(pilot)
    sent = pilot.counters[Kind.RENEWAL]["sent"]
    assert 80 / 6 - 1 <= sent <= 80 / 5 + 1, "renewed every renewal period, no oftener"


def test_a_renewal_lengthens_control_by_one_lease_from_its_sending_and_no_more():
    pilot = Pilot(plain(lease=12.0, renewal_period=6.0)).heard()
    pilot.step(operators={0: 0}).wait_until(lambda: pilot.counters[Kind.RENEWAL]["sent"] == 1)
    renewed = pilot.now
    pilot.batch.state.missions["rules"]["renewal_period"] = 3600.0
    pilot.wait_until(lambda: not obeys(pilot), 40)
    assert pilot.now - renewed == 12 and not held(pilot)


def lost_downlink(pilot):
    """From now on no command reaches any robot: the station's end of the link falls silent."""
    pilot.batch.state.missions["rules"]["message_bytes"][:, [Kind.CONTROL, Kind.RENEWAL, Kind.RELEASE]] = 10**6
    return pilot


def test_renewals_that_are_not_sent_renew_nothing_at_either_end():
    pilot = Pilot(plain(lease=12.0, renewal_period=5.0)).heard()
    pilot.step(operators={0: 0}).wait_until(lambda: pilot.counters[Kind.CONTROL]["sent"] == 1)
    sent = pilot.now
    lost_downlink(pilot.wait_until(lambda: held(pilot), 5)).wait_until(lambda: not obeys(pilot), 30)
    assert pilot.now - sent == 12 and pilot.counters[Kind.RENEWAL]["sent"] == 0 and not held(pilot)


def test_a_report_tells_of_a_lease_that_the_operator_believes_in_but_its_renewals_were_lost():
    pilot = Pilot(plain(lease=12.0, renewal_period=5.0)).heard()
    pilot.step(operators={0: 0}).wait_until(lambda: held(pilot), 5)
    pilot.robots["lease_until"][0] = pilot.now + 1  # as if the last command had come long ago
    pilot.step()
    assert not obeys(pilot) and held(pilot), "the robot is free and the operator has not been told"
    pilot.step()
    assert not held(pilot) and pilot.operators["session"][0] == Session.REST and pilot.operators["leased"][0] == NOBODY


def test_a_bid_that_nobody_answers_is_given_up():
    pilot = Pilot(plain(refill=0.0, bid_timeout=9.0)).heard()
    pilot.operators["tokens"] = 0.0
    pilot.step(operators={0: 0}).wait(7)
    assert pilot.operators["session"][0] == Session.BID
    pilot.wait(1)
    assert pilot.operators["session"][0] == Session.REST and pilot.operators["robot"][0] == NOBODY
    assert pilot.counters[Kind.CONTROL]["fate"][Fate.NO_TOKENS] == 1
    assert pilot.counters[Kind.RELEASE]["attempted"] == 0, "no lease was sent"


def test_acceptance_needs_a_report_that_is_newer_than_the_command():
    pilot = Pilot(plain(bid_timeout=9.0)).heard()
    pilot.batch.state.missions["rules"]["message_bytes"][:, Kind.TELEMETRY] = 10**6  # no report is sent any more
    pilot.step(operators={0: 0}).wait_until(lambda: obeys(pilot), 5)
    pilot.wait(5)
    assert pilot.operators["session"][0] == Session.BID
    pilot.wait_until(lambda: pilot.operators["session"][0] == Session.REST, 9)
    assert pilot.counters[Kind.RELEASE]["attempted"] == 1, "the robot may have accepted"
    pilot.wait_until(lambda: not obeys(pilot), 3)


def test_of_two_sessions_on_one_robot_a_stale_release_ends_none():
    """The release of the first is late and arrives after the command of the second: it is void."""
    pilot = Pilot(plain()).heard()
    pilot.step(operators={0: 0}).wait_until(lambda: held(pilot), 5)
    pilot.batch.state.missions["rules"]["delay"] = 9
    pilot.step(operators={0: REST}).wait(1)
    pilot.batch.state.missions["rules"]["delay"] = 1
    pilot.step(operators={0: 0})
    for _ in range(9):
        pilot.step()
        assert obeys(pilot)
    assert pilot.counters[Kind.RELEASE]["fate"][Fate.DELIVERED] == 1 and held(pilot)


def test_commanding_a_robot_that_another_holds_is_a_conflict_and_changes_nothing():
    pilot = Pilot(plain(n_operators=2, conflict_cost=0.25, bid_timeout=8.0))
    controlling(pilot)
    before = pilot.batch.scores()[0].reward_coordination
    pilot.step(operators={1: 0}).wait(4)
    score = pilot.batch.scores()[0]
    assert held(pilot) and obeys(pilot) and score.conflicts == 1
    assert score.reward_coordination - before == pytest.approx(-0.25 * MEAN_VALUE)
    pilot.wait(6)
    assert pilot.operators["session"][1] == Session.REST, "a report says that another holds it"


def test_of_two_bids_the_first_delivered_wins():
    pilot = Pilot(plain(n_operators=2)).heard()
    pilot.step(operators={1: 0}).step(operators={0: 0}).wait(4)
    assert held(pilot, 1, 0) and not held(pilot, 0, 0) and pilot.batch.scores()[0].conflicts == 1


def switches(pilot):
    score = pilot.batch.scores()[0]
    assert score.reward_coordination == pytest.approx(-0.5 * MEAN_VALUE * score.switches)
    return score.switches


def test_choosing_another_robot_while_holding_one_is_a_switch_and_waits_for_the_first_to_be_free():
    pilot = Pilot(plain(switch_cost=0.5))
    controlling(pilot, 0, 0)
    pilot.step(operators={0: 1})
    assert switches(pilot) == 1 and pilot.operators["session"][0] == Session.BID
    pilot.wait_until(lambda: not obeys(pilot), 3)
    assert pilot.counters[Kind.CONTROL]["attempted"] == 1, "the release has not been reported yet"
    pilot.wait_until(lambda: held(pilot, 0, 1), 6)
    assert pilot.robots["controller"].tolist() == [NOBODY, 0]


def test_a_release_that_is_lost_makes_the_next_robot_wait_for_the_end_of_the_lease():
    pilot = Pilot(plain(lease=30.0, bid_timeout=60.0))
    controlling(pilot, 0, 0)
    ends = pilot.operators["lease_sent"][0] + 30
    pilot.batch.state.missions["rules"]["message_bytes"][:, Kind.RELEASE] = 10**6
    pilot.step(operators={0: 1}).wait_until(lambda: pilot.counters[Kind.CONTROL]["sent"] == 2, 40)
    assert pilot.now == ends and pilot.robots["controller"].tolist() == [NOBODY, NOBODY]
    pilot.wait_until(lambda: obeys(pilot, 0, 1), 3)


def test_rest_is_free_and_so_is_choosing_anew_before_a_bid_is_accepted():
    pilot = Pilot(plain(switch_cost=0.5))
    controlling(pilot, 0, 0)
    pilot.step(operators={0: REST}).wait(3)
    assert not obeys(pilot) and pilot.robots["mode"][0] == Mode.AUTONOMOUS and switches(pilot) == 0
    pilot.step(operators={0: 0}).step(operators={0: 1}).wait(3)
    assert switches(pilot) == 0, "back to the same robot; then no session was held"


@pytest.mark.parametrize("rested, counted", [(5, 1), (25, 0)])
def test_rest_and_another_robot_within_the_window_is_a_switch(rested, counted):
    pilot = Pilot(plain(switch_cost=0.5, switch_window=20.0))
    controlling(pilot, 0, 0)
    pilot.step(operators={0: REST}).wait(rested)
    assert switches(pilot) == 0
    pilot.step(operators={0: 1}).wait(1)
    assert switches(pilot) == counted
    pilot.wait_until(lambda: held(pilot, 0, 1)).wait(1)
    assert switches(pilot) == counted, "once"


def test_leaving_a_robot_that_finished_its_task_is_no_switch():
    pilot = Pilot(
        plain(switch_cost=0.5, service_base=30.0, service_per_difficulty=0.0, success_controlled=(1.0, 0.0, 0.0))
    )
    pilot.heard().step(operators={0: 0}, robots={1: dict(task=IDLE)})
    pilot.wait_until(lambda: np.sum(pilot.tasks["status"] == 2) == 1)
    assert held(pilot) and not pilot.operators["exempt"][0], "no report says so yet"
    pilot.wait_until(lambda: pilot.operators["exempt"][0] == 1)
    pilot.step(operators={0: 1}).wait_until(lambda: held(pilot, 0, 1), 9)
    assert switches(pilot) == 0


def test_a_lease_is_renewed_in_time_whenever_its_operator_decides():
    """An operator is due in the second in which it may renew: by its period alone the next one may come too late."""
    pilot = Pilot(plain(operator_period=7, robot_period=60, telemetry_period=30.0, lease=15.0, renewal_period=10.0))
    pilot.heard().wait_until(lambda: bool(pilot.operators["due"][0])).step(operators={0: 0})
    pilot.wait_until(lambda: held(pilot))
    for _ in range(100):
        pilot.step()
        assert held(pilot) and pilot.now - pilot.operators["lease_sent"][0] <= 11


def test_the_exemption_is_gone_once_the_operator_keeps_on():
    pilot = Pilot(
        plain(switch_cost=0.5, service_base=1.0, service_per_difficulty=0.0, success_controlled=(1.0, 0.0, 0.0))
    )
    pilot.heard().step(operators={0: 0}, robots={1: dict(task=IDLE)})
    pilot.wait_until(lambda: pilot.operators["exempt"][0] == 1)
    pilot.step(operators={0: KEEP}, robots={0: dict(task=int(np.flatnonzero(pilot.tasks["status"] == 0)[0]))})
    pilot.step(operators={0: 1}).wait(1)
    assert switches(pilot) == 1


def broken(pilot):
    """Robot 0 fails under control in the next second."""
    pilot.batch.state.missions["rules"]["controlled_hazard"] = 1.0
    pilot.batch.state.missions["rules"]["hazard"] = 0.0
    pilot.step()
    pilot.batch.state.missions["rules"]["controlled_hazard"] = 0.0
    assert pilot.robots["activity"][0] == Activity.FAILED and pilot.robots["controller"][0] == NOBODY
    return pilot


def test_a_malfunction_is_known_by_the_robots_last_report_and_exempts_from_the_switch_cost():
    pilot = broken(controlling(Pilot(plain(switch_cost=0.5))))
    assert held(pilot), "the report is in the air"
    pilot.step()
    assert pilot.operators["session"][0] == Session.REST
    assert pilot.batch.observations.operator_reports["activity"][0, 0] == Activity.FAILED
    assert pilot.batch.observations.operator_reports["legal"][0].tolist() == [0, 1], "known as failed"
    reports = pilot.counters[Kind.TELEMETRY]["sent"]
    pilot.step(operators={0: 1}).wait_until(lambda: held(pilot, 0, 1), 9)
    assert switches(pilot) == 0
    pilot.wait(30)
    assert pilot.counters[Kind.TELEMETRY]["sent"] - reports <= 9, "silent for ever: only the other one reports"


def test_without_its_last_report_the_operator_goes_on_until_its_clock_says_otherwise():
    pilot = controlling(Pilot(plain(lease=15.0)))
    pilot.robots["tokens"][0] = -1000.0
    broken(pilot).wait(9)
    assert held(pilot) and pilot.batch.observations.operator_reports["legal"][0, 1]
    lost_downlink(pilot).wait_until(lambda: not held(pilot), 16)
    assert pilot.batch.observations.operator_reports["legal"][0, 0], "an old report is all that is known of it"


def test_a_failure_that_nobody_reported_does_not_show_in_the_operators_choices():
    pilot = Pilot(plain(n_uav=3)).heard()
    pilot.robots["activity"][1], pilot.robots["task"][1], pilot.robots["due"][1] = Activity.FAILED, NOBODY, 0
    pilot.tasks["owner"][pilot.tasks["owner"] == 1] = NOBODY
    pilot.wait(8)
    assert pilot.batch.observations.operator_reports["legal"][0].tolist() == [1, 1, 1]
    pilot.step(operators={0: 1}).wait(4)
    assert not held(pilot, 0, 1) and pilot.counters[Kind.CONTROL]["fate"][Fate.LOST] == 1
    assert pilot.batch.observations.operator_reports["legal"][0].tolist() == [1, 0, 1], "but its own bid"


def test_a_robot_that_was_never_heard_of_cannot_be_commanded():
    pilot = Pilot(plain(n_uav=3))
    assert pilot.batch.observations.operator_reports["legal"][0].tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="robot is masked"):
        pilot.step(operators={0: 0})
    assert pilot.heard().batch.observations.operator_reports["legal"][0].tolist() == [1, 1, 1]


def test_a_command_that_was_withdrawn_in_the_air_takes_effect_until_its_release_arrives():
    pilot = Pilot(plain(n_operators=2, delay=4, lease=60.0)).heard()
    pilot.step(operators={0: 0}).wait(1)
    pilot.step(operators={0: REST}).wait_until(lambda: obeys(pilot), 9)
    pilot.wait_until(lambda: not obeys(pilot), 9)
    assert pilot.counters[Kind.RELEASE]["fate"][Fate.DELIVERED] == 1 and pilot.operators["session"][0] == Session.REST
    pilot.step(operators={1: 0}).wait_until(lambda: obeys(pilot, 1, 0), 9)
    pilot.step(operators={0: 0}).wait(1).step(operators={0: REST}).wait(8)
    assert obeys(pilot, 1, 0) and pilot.batch.scores()[0].conflicts == 1


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
        pilot.wait_until(lambda: pilot.peers["activity"][-1, 0] == activity, 9)
        pilot.operators["fatigue"] = 0.0
        pilot.step()
        return pilot.operators["fatigue"][0]

    assert 0 < gained(1.0, Activity.IDLE) < gained(0.0, Activity.SERVICING) < gained(1.0, Activity.SERVICING)


def test_fatigue_follows_what_was_reported():
    """The robot begins its service; the operator works as hard as before until a report says so."""
    pilot = Pilot(plain(map_side=5000.0, difficulty=(1.0, 1.0), service_base=2000.0, n_tasks=1, n_uav=1))
    pilot.heard().step(operators={0: 0}).wait_until(lambda: held(pilot), 9)

    def gain():
        before = pilot.operators["fatigue"][0]
        return (pilot.step().operators["fatigue"][0] - before) / (1 - before)

    light = gain()
    pilot.batch.state.missions["rules"]["message_bytes"][:, Kind.TELEMETRY] = 10**6
    pilot.wait_until(lambda: pilot.robots["activity"][0] == Activity.SERVICING)
    assert held(pilot) and gain() == pytest.approx(light)
    pilot.batch.state.missions["rules"]["message_bytes"][:, Kind.TELEMETRY] = 64
    pilot.wait(9)
    assert gain() > 2 * light


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
