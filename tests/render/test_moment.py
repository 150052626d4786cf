import numpy as np
import pytest

from commhg_mj.base.terms import Activity, Fate, Kind
from commhg_mj.render.moment import Timeline


@pytest.fixture(scope="module")
def timeline(trace):
    return Timeline(trace, lag=9.0)


def test_robots_glide_between_ticks(trace, timeline):
    before, middle, after = (timeline.at(t).xy for t in (20.0, 20.5, 21.0))
    np.testing.assert_allclose(middle, (before + after) / 2, atol=1e-4)
    np.testing.assert_array_equal(after, trace.robot_xy[21])


def test_robots_face_where_they_go(timeline):
    moment = timeline.at(5.5)
    step = timeline.trace.robot_xy[6] - timeline.trace.robot_xy[5]
    moving = np.hypot(*step.T) > 1
    assert moving.any()
    np.testing.assert_allclose(moment.heading[moving], np.arctan2(step[:, 1], step[:, 0])[moving], atol=1e-3)


def test_the_camera_that_follows_never_swings(timeline):
    course = np.array([timeline.at(t).course for t in np.arange(0, 60, 0.5)])
    assert np.abs(np.diff(course, axis=0)).max() < np.radians(5)


def test_ends_of_the_mission(timeline):
    for time in (0.0, 60.0):
        assert np.isfinite(timeline.at(time).heading).all()


@pytest.mark.parametrize("time", [0.0, 31.5, 60.0])
def test_score_by_hand(trace, timeline, time):
    moment, gained, lost = timeline.at(time), 0.0, 0.0
    for task in range(len(trace.task_xy)):
        done = 0 <= trace.task_done[task] <= time
        late = max(0.0, (trace.task_done[task] if done else time) - trace.task_deadline[task])
        left = trace.task_value[task] * np.exp(-late / trace.task_decay[task]) / trace.task_value.sum()
        gained += left * done
        lost += (trace.task_value[task] / trace.task_value.sum() - left) * (trace.task_release[task] <= time)
    assert moment.gained == pytest.approx(trace.twcr_until(time), abs=1e-5)
    assert moment.gained == pytest.approx(gained, abs=1e-5) and moment.lost == pytest.approx(lost, abs=1e-5)


def test_serviced_tasks_know_their_robot(timeline):
    for time in range(60):
        moment = timeline.at(float(time))
        for robot in np.flatnonzero(moment.activity == Activity.SERVICING):
            assert moment.serviced_by[moment.task[robot]] == robot


def test_messages_of_the_last_minute(trace, timeline):
    counts = timeline.at(40.0).counts
    ended = (trace.message_ended >= 0) & (trace.message_ended <= 40)
    rr = trace.message_kind == Kind.BROADCAST
    for fate in Fate:
        assert counts[0, fate] == np.sum(ended & rr & (trace.message_fate == fate))
    assert counts.sum() == ended.sum()


def test_messages_in_flight(trace, timeline):
    flight = timeline.at(30.0).flight
    assert len(flight.phase) and np.all((flight.phase >= 0) & (flight.phase < 1))
    assert not np.any(flight.fate == Fate.UNDERWAY)
    assert np.array_equal(flight.left, ~np.isin(flight.fate, (Fate.EXPIRED, Fate.NO_TOKENS)))
