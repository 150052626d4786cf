"""What a trace shows at any time: poses between ticks, the state of tasks, the score, messages in flight."""

from dataclasses import dataclass

import numpy as np

from ..base.terms import ROUTES, Activity, Fate, Kind, Mode

TURN_TO_BANK = 0.6  # rad of bank per rad/s of turning
MAX_BANK = 0.45  # rad
COURSE_WINDOW = 25  # s before and after
MINUTE = 60.0  # s: messages are counted over the last one
ROUTE_OF_KIND = np.array([[kind in kinds for kinds in ROUTES.values()].index(True) for kind in Kind])  # into terms.ROUTES


@dataclass(frozen=True)
class Flight:
    """Messages to be shown at a moment: `phase` runs from 0 at the sender to 1 at the end of its showing."""

    route: np.ndarray  # [m] index into terms.ROUTES
    sender: np.ndarray  # [m] 0..R-1 robots, then operators, then the station
    receiver: np.ndarray  # [m] the same; -1 nobody
    fate: np.ndarray  # [m] terms.Fate
    phase: np.ndarray  # [m] in [0, 1]
    left: np.ndarray  # [m] bool: it left the antenna


@dataclass(frozen=True)
class Moment:
    """One instant of a mission: R robots, H operators, T tasks."""

    time: float  # s
    xy: np.ndarray  # [R, 2] m
    heading: np.ndarray  # [R] rad from east, counterclockwise
    course: np.ndarray  # [R] rad: the heading, smoothed for a camera that follows
    bank: np.ndarray  # [R] rad, positive when turning left
    moving: np.ndarray  # [R] bool
    activity: np.ndarray  # [R] terms.Activity
    mode: np.ndarray  # [R] terms.Mode
    standing: np.ndarray  # [R] bool: its claim was refused a moment ago
    broadcast_tokens: np.ndarray  # [R] share of the bucket for broadcasts
    task: np.ndarray  # [R] assigned task, -1 none
    assigned_at: np.ndarray  # [R] tick at which the present assignment began
    controller: np.ndarray  # [R] operator, -1 none
    progress: np.ndarray  # [R] of the own task
    fatigue: np.ndarray  # [H]
    session: np.ndarray  # [H] terms.Session
    operator_robot: np.ndarray  # [H] robot held or asked for, -1 none
    link_quality: np.ndarray  # [R, R + 1] in [0, 1], the station last
    released: np.ndarray  # [T] bool
    done: np.ndarray  # [T] bool
    overdue: np.ndarray  # [T] bool: completed after the deadline, or open after it
    changed: np.ndarray  # [T] bool: its hidden change has happened
    serviced_by: np.ndarray  # [T] robot at work on it, -1 none
    gained: float  # TWCR so far
    lost: float  # share of the mission's value that lateness has destroyed so far
    flight: Flight
    counts: np.ndarray  # [routes, fates] messages that ended in the last minute


class Timeline:
    """Moments of one trace. `lag` [s of the mission] is how long a message is shown at least."""

    def __init__(self, trace, lag: float):
        self.trace, self.lag = trace, lag
        self.ticks = len(trace.robot_xy) - 1
        self._heading = _headings(trace.robot_xy)
        self._course = _smooth(np.unwrap(self._heading, axis=0), COURSE_WINDOW)
        self._assigned_at = _run_starts(trace.robot_task)
        left = trace.message_sent >= 0
        self._start = np.where(left, trace.message_sent, trace.message_ended)
        self._stop = np.maximum(trace.message_ended, self._start + lag)
        self._route = ROUTE_OF_KIND[trace.message_kind]

    def at(self, time: float) -> Moment:
        """The moment at `time` [s] in [0, ticks]."""
        trace = self.trace
        tick = min(int(time), self.ticks)
        after, part = min(tick + 1, self.ticks), time - tick
        heading, turn = self._heading_at(tick, part)
        activity, task = trace.robot_activity[tick], trace.robot_task[tick]
        step = trace.robot_xy[after] - trace.robot_xy[tick]
        moving = np.hypot(*step.T) > 1e-3
        return Moment(
            time=time,
            xy=trace.robot_xy[tick] + step * part,
            heading=heading,
            course=self._course[tick] * (1 - part) + self._course[after] * part,
            bank=np.where(moving, np.clip(TURN_TO_BANK * turn, -MAX_BANK, MAX_BANK), 0.0),
            moving=moving,
            activity=activity,
            mode=np.where(trace.robot_controller[tick] >= 0, trace.robot_mode[tick], Mode.AUTONOMOUS),
            standing=trace.robot_stand_left[tick] > 0,
            broadcast_tokens=trace.robot_broadcast_tokens[tick] / trace.scenario.communication.broadcast_bucket,
            task=task,
            assigned_at=self._assigned_at[tick],
            controller=trace.robot_controller[tick],
            progress=self._progress(tick, after, part),
            fatigue=trace.operator_fatigue[tick] * (1 - part) + trace.operator_fatigue[after] * part,
            session=trace.operator_session[tick],
            operator_robot=trace.operator_robot[tick],
            link_quality=trace.link_quality[min(tick // trace.link_period, len(trace.link_quality) - 1)] / 100.0,
            flight=self._flight(time),
            counts=self._counts(time),
            **_task_states(trace, time, activity, task),
        )

    def _heading_at(self, tick, part):
        """(heading, turn rate [rad/s]) between the middles of two ticks."""
        first = max(0, min(tick - 1 if part < 0.5 else tick, len(self._heading) - 1))
        second = min(first + 1, len(self._heading) - 1)
        turn = np.angle(np.exp(1j * (self._heading[second] - self._heading[first])))
        return self._heading[first] + turn * ((part + 0.5) % 1.0), turn

    def _progress(self, tick, after, part):
        now, later = self.trace.robot_progress[tick], self.trace.robot_progress[after]
        grows = (later > now) & (self.trace.robot_task[after] == self.trace.robot_task[tick])
        return np.where(grows, now + (later - now) * part, now)

    def _flight(self, time):
        trace = self.trace
        shown = np.flatnonzero((self._start <= time) & (time < self._stop) & (trace.message_fate != Fate.UNDERWAY))
        return Flight(
            route=self._route[shown],
            sender=trace.message_sender[shown].astype(int),
            receiver=trace.message_receiver[shown].astype(int),
            fate=trace.message_fate[shown],
            phase=(time - self._start[shown]) / (self._stop[shown] - self._start[shown]),
            left=trace.message_sent[shown] >= 0,
        )

    def _counts(self, time):
        ended = (self.trace.message_ended <= time) & (self.trace.message_ended > max(time - MINUTE, -1))
        counts = np.zeros((len(ROUTES), len(Fate)), int)
        np.add.at(counts, (self._route[ended], self.trace.message_fate[ended]), 1)
        return counts


def _headings(xy):
    """Heading [N, R] from each tick to the next; one that stands keeps its last, north at first."""
    step = np.diff(xy, axis=0) if len(xy) > 1 else np.zeros_like(xy)
    moves = np.hypot(step[..., 0], step[..., 1]) > 1e-3
    last = np.maximum.accumulate(np.where(moves, np.arange(len(step))[:, None], -1), axis=0)
    angle = np.arctan2(step[..., 1], step[..., 0])
    return np.where(last >= 0, np.take_along_axis(angle, np.maximum(last, 0), axis=0), np.pi / 2)


def _smooth(values, window):
    """Means [N + 1, R] of values [N, R] over `window` neighbours on both sides."""
    n = len(values)
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    ticks = np.arange(n + 1)
    first, last = np.clip(ticks - window, 0, n - 1), np.clip(ticks + window, 1, n)
    return (total[last] - total[first]) / (last - first)[:, None]


def _run_starts(values):
    """For values [N, R], the index at which the present run of equal values began."""
    fresh = np.ones(values.shape, bool)
    fresh[1:] = values[1:] != values[:-1]
    return np.maximum.accumulate(np.where(fresh, np.arange(len(values))[:, None], 0), axis=0)


def _task_states(trace, time, activity, task):
    released = trace.task_release <= time
    done = (trace.task_done >= 0) & (trace.task_done <= time)
    late_by = np.where(done, trace.task_done, time) - trace.task_deadline
    worth = trace.task_value / trace.task_value.sum()
    left = worth * np.exp(-np.clip(late_by, 0, None) / trace.task_decay)
    serviced_by = np.full(len(worth), -1)
    at_work = np.flatnonzero((activity == Activity.SERVICING) & (task >= 0))
    serviced_by[task[at_work]] = at_work
    return {
        "released": released,
        "done": done,
        "overdue": released & (late_by > 0),
        "changed": (trace.task_changed_at >= 0) & (trace.task_changed_at <= time) & ~done,
        "serviced_by": serviced_by,
        "gained": float(left[done].sum()),
        "lost": float((worth - left)[released].sum()),
    }
