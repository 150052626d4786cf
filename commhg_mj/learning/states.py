"""The full true state as features of robots, operators and tasks, for the critic alone."""

from typing import NamedTuple

import numpy as np

from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity, Embodiment, Mode, Session, Status
from ..mission.accessors import belief_of, operator_of, robot_of, task_of
from ..mission.batch import MissionBatch
from ..mission.estimate import attempt
from .graphs import LONG, MINUTE

UGV, FAILED, SERVICED, DONE = int(Embodiment.UGV), int(Activity.FAILED), int(Status.SERVICED), int(Status.DONE)
TRAVELLING, SERVICING = int(Activity.TRAVELLING), int(Activity.SERVICING)
HANDOVER, CONTROLLED = int(Mode.HANDOVER), int(Mode.CONTROLLED)
BID, HELD = int(Session.BID), int(Session.HELD)
N_STATE_ROBOT, N_STATE_OPERATOR, N_STATE_TASK, N_GLOBAL = 24, 11, 15, 4
OWN_TIME = 2  # the first global features are the clock


class States(NamedTuple):
    """S states of missions with R robots, H operators and T tasks."""

    robot: np.ndarray  # [S, R, N_STATE_ROBOT] f4
    operator: np.ndarray  # [S, H, N_STATE_OPERATOR] f4
    task: np.ndarray  # [S, T, N_STATE_TASK] f4
    is_open: np.ndarray  # [S, T] bool: released and not done
    mission: np.ndarray  # [S, N_GLOBAL] f4


def read_states(batch: MissionBatch, scale, missions: np.ndarray) -> States:
    """The states of some missions [S]."""
    s, scenario = len(missions), batch.scenario
    r, h, t = scenario.n_robots, scenario.n_operators, scenario.n_tasks
    shapes = (s, r, N_STATE_ROBOT), (s, h, N_STATE_OPERATOR), (s, t, N_STATE_TASK), (s, t), (s, N_GLOBAL)
    kinds = np.float32, np.float32, np.float32, bool, np.float32
    states = States(*(np.zeros(shape, kind) for shape, kind in zip(shapes, kinds)))
    fill_states(batch.state.missions, missions, scale, states)
    return states


@kernel
def fill_states(missions, which, scale, states):
    """Write the features of some missions."""
    for s in range(which.shape[0]):
        m = missions[which[s]]
        for r in range(m.n_robots):
            write_state_robot(m, r, scale, states.robot[s, r])
        for h in range(m.n_operators):
            write_state_operator(m, h, scale, states.operator[s, h])
        for j in range(m.n_tasks):
            task = task_of(m, j)
            if task.released and task.status != DONE:
                states.is_open[s, j] = True
                write_state_task(m, task, scale, states.task[s, j])
        out = states.mission[s]
        out[0], out[1] = m.now / scale.limit, np.exp(-(scale.limit - m.now) / LONG)
        out[2] = m.pending_value / m.total_value
        out[3] = m.flying / 64.0


@kernel
def write_state_robot(m, r, scale, out):
    """A robot as it is."""
    robot, now = robot_of(m, r), m.now
    out[0], out[1] = robot.embodiment == UGV, robot.embodiment != UGV
    out[2], out[3] = robot.x / scale.side, robot.y / scale.side
    out[4], out[5], out[6] = robot.activity == FAILED, robot.activity == TRAVELLING, robot.activity == SERVICING
    out[7], out[8] = robot.mode == HANDOVER, robot.mode == CONTROLLED
    out[9] = robot.tokens / scale.bucket
    out[10] = min(1.0, (now - robot.last_broadcast) / MINUTE)
    out[11], out[12] = robot.prescribed, robot.due
    if robot.controller != NOBODY:
        out[13] = (robot.lease_until - now) / scale.lease
    if robot.task != NOBODY:
        task = task_of(m, robot.task)
        speed = m.rules.speed[1 if robot.mode == CONTROLLED else 0, robot.embodiment]
        dx, dy = task.x - robot.x, task.y - robot.y
        way = np.sqrt(dx * dx + dy * dy)
        gain, seconds = attempt(m.rules, way, speed, task.difficulty, task.deadline, task.decay, float(now))
        out[14], out[15], out[16] = 1.0, way / scale.side, task.progress
        out[17], out[18], out[19] = task.difficulty, task.value / scale.value, task.value * gain / scale.value
        out[20], out[21] = seconds / LONG, np.tanh((task.deadline - now) / LONG)
        out[22] = task.type != 2 and (task.type == 1) != (robot.embodiment == UGV)
        out[23] = belief_of(m, r, robot.task).time >= 0.0


@kernel
def write_state_operator(m, h, scale, out):
    """An operator as it is."""
    operator = operator_of(m, h)
    out[0], out[1], out[2], out[3] = operator.proficiency[0], operator.proficiency[1], operator.capacity, operator.fatigue
    out[4], out[5] = operator.session == BID, operator.session == HELD
    out[6], out[7] = operator.tokens / scale.bucket, operator.exempt
    if operator.robot != NOBODY:
        robot = robot_of(m, operator.robot)
        out[8], out[9] = robot.embodiment == UGV, robot.activity == SERVICING
        out[10] = task_of(m, robot.task).difficulty if robot.task != NOBODY else 0.0


@kernel
def write_state_task(m, task, scale, out):
    """An open task as it is."""
    now = m.now
    late = max(0.0, now - task.deadline)
    out[0], out[1] = task.x / scale.side, task.y / scale.side
    out[2], out[3] = task.difficulty, task.value / scale.value
    out[4], out[5] = np.tanh((task.deadline - now) / LONG), late > 0.0
    out[6], out[7] = np.exp(-late / task.decay) * task.value / scale.value, task.decay / scale.decay
    out[8], out[9], out[10] = task.type == 0, task.type == 1, task.type == 2
    out[11], out[12], out[13] = task.status == SERVICED, task.progress, task.owner != NOBODY
    out[14] = np.exp(-max(0.0, now - task.release) / LONG)
