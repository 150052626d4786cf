"""The planner's numbers as features of robots and of tasks, from local records alone (features PLAN and PLAN_EDGE)."""

import numpy as np

from ..base.elementary_functions import distance
from ..base.kernels import kernel
from ..base.terms import IDLE
from ..mission.estimate import expected_seconds, expected_wait, regret
from ..mission.records import is_compatible
from ..mission.service import autonomous_seconds, autonomous_success, timeliness
from ..policies.alternatives import rank_candidates
from ..policies.assignment import reduced_cost
from ..policies.planner import WHOLE, assign_team, expected_success, is_settled, own_part, remember

MINUTE, HORIZON, CLOSE = 60.0, 200.0, 20.0  # s
CANDIDATES = 3  # the pick, and the tasks that cost the team least beside it; one's own is always one more
MOST = 3.0  # bound of shares of the best worth, and of seconds over HORIZON
NOTHING = 1e-9


@kernel
def fill_plans(rules, scale, desk, memory, seen, task_ptr, plans, edges):
    """Write the numbers of all due robots, whose task edges begin at `task_ptr`."""
    for i in range(seen.robots.shape[0]):
        robot = seen.robots[i]
        remember(robot, seen.robot_tasks[i], memory.taken[robot.mission, robot.robot])
        write_plan(rules, scale, desk, memory, seen, i, plans[i], edges, task_ptr[i])


@kernel
def write_plan(rules, scale, desk, memory, seen, i, out, edges, first):
    """Write the numbers of robot row i to `out`, and those of its open tasks to `edges` from row `first` on.

    Args:
      memory: the planner's, up to date.
    """
    robot, tasks, a = seen.robots[i], seen.robot_tasks[i], desk.assignment
    taken = memory.taken[robot.mission, robot.robot]
    n_open, rows = assign_team(rules, WHOLE, desk, taken, seen, i)
    settled = is_settled(robot)
    pick = robot.task if settled else own_part(desk)
    backlog, best = expected_wait(rules, n_open, seen.robot_peers.shape[1]), NOTHING
    for column in range(n_open):
        best = max(best, a.worth[0, column])
    out.idles, out.keeps = pick == IDLE, pick == robot.task
    out.is_news = memory.told[robot.mission, robot.robot] != pick
    if pick >= 0:
        out.seconds = min(1.0, tasks[pick].distance / robot.speed / HORIZON)
    out.best_worth = MINUTE * best / scale.value
    out.backlog, out.peers = backlog / HORIZON, rows / seen.robot_peers.shape[1]
    found = np.zeros(n_open + 1, np.int64)
    n_found = 0 if settled else min(CANDIDATES, rank_candidates(desk, robot, tasks, n_open, found))
    for column in range(n_open):
        j, edge = desk.tasks[column], edges[first + column]
        edge.is_pick = j == pick
        edge.is_candidate = j == pick or j == robot.task
        for k in range(n_found):
            if found[k] == j:
                edge.is_candidate = 1.0
        write_prospect(rules, scale, robot, tasks[j], backlog, edge)
        write_market(a, column, rows, best, edge)
        edge.rank /= seen.robot_peers.shape[1]
        edge.taken = np.exp(-(robot.time - taken[j]) / MINUTE) if taken[j] >= 0.0 else 0.0
        edge.nearby = value_near(robot, tasks, desk.tasks[:n_open], j) / (4.0 * scale.value)


@kernel
def write_prospect(rules, scale, robot, task, backlog, edge):
    """What a task promises the robot itself, with an operator's help and without."""
    travel, service = task.distance / robot.speed, autonomous_seconds(rules, task.difficulty)
    helped = expected_seconds(travel, service, expected_success(rules, task.difficulty, True))
    alone = expected_seconds(travel, service, expected_success(rules, task.difficulty, False))
    edge.worth_helped = MINUTE * regret(rules, task, helped, robot.time, backlog) / scale.value
    edge.worth_alone = MINUTE * regret(rules, task, alone, robot.time, backlog) / scale.value
    edge.seconds_helped, edge.seconds_alone = min(MOST, helped / HORIZON), min(MOST, alone / HORIZON)
    edge.success = autonomous_success(rules, task.difficulty)
    then = robot.time + helped
    edge.timely = timeliness(task.deadline, task.decay, then)
    edge.timely_later = timeliness(task.deadline, task.decay, then + backlog) if then + backlog <= rules.time_limit else 0.0
    edge.slack = np.tanh((task.deadline - then) / (0.5 * HORIZON))
    edge.time_left = max(0.0, 1.0 - (rules.time_limit - then) / HORIZON)


@kernel
def write_market(a, column, rows, best, edge):
    """What a task is worth in the assignment of the team."""
    worth = a.worth[0, column]
    edge.worth, edge.price = worth / best, min(MOST, -a.column_price[column + 1] / best)
    edge.reduced_cost = MOST
    if worth > 0.0:
        edge.reduced_cost = min(MOST, max(0.0, reduced_cost(a, 1, column + 1)) / best)
    others = 0.0
    for row in range(1, rows):
        others = max(others, a.worth[row, column])
        edge.rank += a.worth[row, column] > worth
        edge.is_others = max(edge.is_others, a.column_of[row + 1] == column + 1)
    edge.others_worth = min(MOST, others / best)


@kernel
def value_near(robot, tasks, columns, j):
    """Value of other open tasks for this robot, discounted by their way from task j."""
    total = 0.0
    for other in columns:
        if other != j and is_compatible(robot.embodiment, tasks[other].type):
            way = distance(tasks[other].x - tasks[j].x, tasks[other].y - tasks[j].y)
            total += tasks[other].value * np.exp(-way / (CLOSE * robot.speed))
    return total
