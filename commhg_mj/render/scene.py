"""How things stand in a mission at one second, as maps show it."""

from typing import NamedTuple

import numpy as np

from ..base.terms import NOBODY, Status
from .moment import Timeline


class Scene(NamedTuple):
    """R robots, H operators, T tasks."""

    task_xy: np.ndarray  # [T, 2] m
    released: np.ndarray  # [T] bool
    kind: np.ndarray  # [T] terms.TaskType by now
    status: np.ndarray  # [T] terms.Status
    progress: np.ndarray  # [T]
    robot_xy: np.ndarray  # [R, 2] m
    robot_task: np.ndarray  # [R] task, -1 none
    activity: np.ndarray  # [R] terms.Activity
    session: np.ndarray  # [H] terms.Session
    operator_robot: np.ndarray  # [H] robot held or called, -1 none


def scene_of_trace(trace, second: int) -> Scene:
    """The start of a second of a trace, before anybody's choice."""
    moment = Timeline(trace, 0.0).at(second)
    worker = moment.serviced_by
    status = np.where(moment.done, Status.DONE, np.where(worker == NOBODY, Status.OPEN, Status.SERVICED))
    has_changed = (trace.task_changed_at >= 0) & (trace.task_changed_at <= second)
    kind = np.where(has_changed, trace.task_changed_to, trace.task_type)
    return Scene(
        trace.task_xy, moment.released, kind, status, moment.progress[worker], moment.xy, moment.task, moment.activity,
        moment.session, moment.operator_robot,
    )  # fmt: skip


def scene_of_state(tasks, robots, operators) -> Scene:
    """The simulator's records TASK [T], ROBOT [R] and OPERATOR [H] of one mission."""
    task_xy, robot_xy = (np.stack([rows["x"], rows["y"]], axis=-1) for rows in (tasks, robots))
    return Scene(
        task_xy, tasks["released"] != 0, tasks["type"], tasks["status"], tasks["progress"], robot_xy, robots["task"],
        robots["activity"], operators["session"], operators["robot"],
    )  # fmt: skip
