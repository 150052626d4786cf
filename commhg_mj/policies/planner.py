"""Planner: every robot assigns the team as it knows it and takes its own part (docs/planner.md).

Decentralised assignment on beliefs, also called implicit coordination: robots that know the same choose what fits together
without a word about it. A policy without privileges: it reads observations and the scenario's public numbers.
"""

from typing import NamedTuple

import numpy as np

from ..base.arguments import instance
from ..base.elementary_functions import distance, exp, log
from ..base.kernels import kernel
from ..base.terms import IDLE, KEEP, NOBODY, Activity, Embodiment, Mode, Status
from ..mission.batch import MissionBatch, stay
from ..mission.decide import Decisions
from ..mission.estimate import expected_seconds, expected_wait, regret
from ..mission.observe import Observations
from ..mission.records import is_compatible
from ..mission.service import autonomous_seconds, autonomous_success, controlled_success
from ..mission.state import NEVER
from .assignment import Assignment, assign, new_assignment
from .greedy import CLAIM_TRUST, choose_robots
from .schedule import follow_schedule, longest_unheard
from .supervision import persist

UAV, CONTROLLED = int(Embodiment.UAV), int(Mode.CONTROLLED)
SERVICING, TRAVELLING, FAILED = int(Activity.SERVICING), int(Activity.TRAVELLING), int(Activity.FAILED)
DONE, SERVICED = int(Status.DONE), int(Status.SERVICED)
FATIGUE = 0.3  # of the operator who may help
LOYALTY = 2.0  # a robot's own task counts this many times: plans do not flicker
HASTE = 0.5  # a task that takes e times as long counts exp(-HASTE) times, beside its worth a second: its robot is free later
URGENCY = 0.3  # one that is done long before its deadline counts exp(-URGENCY) times, one that is late by far exp(URGENCY)
HARDNESS = 0.5  # the hardest count exp(HARDNESS) times: they need an operator, and time for another attempt
SLACK = 50.0  # s before or after a deadline that are long
CLAIM = 3.0  # a peer's reported task counts this many times for that peer
DETOUR = 1.15  # ground robots drive so much farther than the straight way; a robot's own way is measured
REPEATS = 1.3  # a service that a peer began is believed to last so many of its attempts
AT_WORK = 1e3  # a service under way is finished
PERIOD = 60.0  # s between broadcasts while the plan stays the same
TAKEN = 0.2  # worth of a task that another is known to have taken: by now it is at work there, or has done it
WELL_UNDER_WAY = 0.4  # progress of a service from which its robot asks for news that its next choice may need
ASKING_PERIOD = 60.0  # s since a robot's last query, before it asks at work
UNTOLD = -9  # no plan has been told yet


class Plan(NamedTuple):
    """What the planner does; each switch is one rule, and `ABLATIONS` leaves one out."""

    assigns: bool = True  # the team to the tasks; else each robot takes its best task that nobody claims
    expects_control: bool = True  # in every service: hope sends robots to hard tasks, and then operators come
    heeds_claims: bool = True  # the task that a peer reported lately counts more for that peer
    remembers: bool = True  # who has taken what, by claims, reports of service and refusals, until it is seen open
    reckons: bool = True  # peers on their way on from where they reported
    speaks_up: bool = True  # broadcasts a change of plan at once; else by the clock of the fixed schedule
    weighs: bool = True  # what is done soon, urgent or hard counts more than its worth a second
    persists: bool = True  # operators keep a robot until its task is done, and count what a session costs; else Greedy's
    asks: bool = True  # operators, by the fixed schedule's rule and from work


WHOLE = Plan()
ABLATIONS = {
    "no-assignment": Plan(assigns=False),
    "no-memory": Plan(remembers=False),
    "no-dead-reckoning": Plan(reckons=False),
    "no-control-expected": Plan(expects_control=False),
    "no-claims": Plan(heeds_claims=False),
    "clocked": Plan(speaks_up=False),
    "no-query": Plan(asks=False),
    "plain-worth": Plan(weighs=False),
    "fickle": Plan(persists=False),
}


class Desk(NamedTuple):
    """Scratch of one decision."""

    tasks: np.ndarray  # [T] open ones, a column of the assignment each
    assignment: Assignment


def new_desk(scenario) -> Desk:
    """Room for the decisions of any robot of a scenario."""
    return Desk(np.zeros(scenario.n_tasks, np.int64), new_assignment(scenario.n_robots, scenario.n_tasks))


class Memory(NamedTuple):
    """What robots keep in mind from one decision to the next."""

    told: np.ndarray  # [E, R] the plan that each told last
    taken: np.ndarray  # [E, R, T] s: when each knew another robot last to have a task, NEVER: not, or seen open since
    asked: np.ndarray  # [E, R] s: when each asked last, -inf: not yet


def new_memory(n_missions, scenario) -> Memory:
    """Room for all robots of a batch; it is empty where a mission begins."""
    e, r = n_missions, scenario.n_robots
    return Memory(np.full((e, r), UNTOLD), np.full((e, r, scenario.n_tasks), NEVER), np.full((e, r), -np.inf))


class Planner:
    """Callable policy, with a memory."""

    def __init__(self, batch: MissionBatch, plan: Plan = WHOLE):
        instance("batch", batch, MissionBatch)
        self.rules, self.plan, self.desk = batch.rules, instance("plan", plan, Plan), new_desk(batch.scenario)
        self.memory = new_memory(len(batch.seeds), batch.scenario)

    def __call__(self, observations: Observations) -> Decisions:
        decisions = stay(observations)
        decide(self.rules, self.plan, self.desk, self.memory, observations, decisions)
        return decisions


@kernel
def decide(rules, plan, desk, memory, observations, decisions):
    """Fill in the decisions of all who are due.

    Args:
      rules: [1] RULES.
      memory: brought up to date.
    """
    choose(rules, plan, desk, memory, observations, decisions)
    talk(plan, memory, observations, decisions)


@kernel
def choose(rules, plan, desk, memory, observations, decisions):
    """Robots' tasks and operators' robots."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        taken = memory.taken[robot.mission, robot.robot]
        if plan.remembers:
            remember(robot, observations.robot_tasks[i], taken)
        decisions.task[i] = KEEP if is_settled(robot) else choose_task(rules[0], plan, desk, taken, observations, i)
    supervise(rules, plan, observations, decisions.operator)


@kernel
def supervise(rules, plan, observations, choices):
    """Fill in whom operators control."""
    if plan.persists:
        persist(rules, observations, choices)
    else:
        choose_robots(rules, observations, choices)


@kernel
def talk(plan, memory, observations, decisions):
    """What all say and ask whose choices are made."""
    follow_schedule(observations, decisions, plan.asks)
    if plan.asks:
        ask_at_work(memory.asked, observations, decisions)
    if plan.speaks_up:
        tell_changes(memory.told, observations, decisions)


@kernel
def remember(robot, tasks, taken):
    """Bring up to date when robot knew each task last to be another's: a claim, a service or a refusal says so."""
    if robot.time == 0.0:
        taken[:] = NEVER
    for j in range(tasks.shape[0]):
        task, evidence = tasks[j], robot.time - tasks[j].age
        if j == robot.task or task.age >= 0.0 and task.status != SERVICED and evidence > taken[j]:
            taken[j] = NEVER
        elif task.age >= 0.0 and task.status == SERVICED:
            taken[j] = max(taken[j], evidence)
        if task.claimed_by != NOBODY:
            taken[j] = max(taken[j], robot.time - task.claim_age)
        if task.refused:
            taken[j] = robot.time


@kernel
def is_settled(robot):
    """Whether a robot is at work on its task, or has a prescribed one: it does not choose."""
    return robot.activity == SERVICING and robot.can_keep or not robot.can_idle


@kernel
def ask_at_work(asked, observations, decisions):
    """A service that is well under way leaves time to ask: news from around its task comes before the next choice."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        e, r = robot.mission, robot.robot
        if robot.time == 0.0:
            asked[e, r] = -np.inf
        is_at_work = robot.activity == SERVICING and robot.progress > WELL_UNDER_WAY
        if is_at_work and robot.time - asked[e, r] > ASKING_PERIOD:
            decisions.query[i] = longest_unheard(observations.robot_operators[i])
            decisions.assist[i] = decisions.assist[i] and decisions.query[i] == NOBODY
        if decisions.query[i] != NOBODY:
            asked[e, r] = robot.time


@kernel
def tell_changes(told, observations, decisions):
    """A plan that nobody was told of is broadcast at once: what peers assume of a robot is what it told last."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        e, r, plan = robot.mission, robot.robot, own_plan(robot, decisions.task[i])
        if robot.time == 0.0:
            told[e, r] = UNTOLD
        decisions.broadcast[i] = robot.can_broadcast and (told[e, r] != plan or robot.since_broadcast >= PERIOD)
        if decisions.broadcast[i]:
            told[e, r] = plan


@kernel
def own_plan(robot, choice):
    """The task that a robot has after its choice, or IDLE."""
    return robot.task if choice == KEEP else choice


@kernel
def choose_task(rules, plan, desk, taken, observations, i):
    """KEEP, IDLE or the task that falls to robot row i."""
    robot, tasks = observations.robots[i], observations.robot_tasks[i]
    n_open, _ = assign_team(rules, plan, desk, taken, observations, i)
    best, choice = 0.0, IDLE
    if plan.assigns:
        choice = own_part(desk)
    else:
        for column in range(n_open):
            task, worth = tasks[desk.tasks[column]], desk.assignment.worth[0, column]
            is_claimed = task.claimed_by != NOBODY and task.claim_age < CLAIM_TRUST
            if worth > best and not is_claimed:
                best, choice = worth, desk.tasks[column]
    return KEEP if choice == robot.task else choice


@kernel
def assign_team(rules, plan, desk, taken, observations, i):
    """Rate open tasks for robot row i and, if the plan assigns, for the peers that it knows, who gets which; (tasks, robots).

    The robot itself is the first row of the assignment on the desk.
    """
    robot, tasks, peers = observations.robots[i], observations.robot_tasks[i], observations.robot_peers[i]
    n_open = list_open(tasks, desk.tasks)
    backlog = expected_wait(rules, n_open, peers.shape[0])
    worth, rows = desk.assignment.worth, 1
    rate_own(rules, plan, robot, tasks, taken, desk.tasks[:n_open], backlog, worth[0])
    if plan.assigns:
        for k in range(peers.shape[0]):
            if k != robot.robot and peers[k].age >= 0.0 and peers[k].activity != FAILED:
                rate_peer(rules, plan, robot.time, peers[k], tasks, desk.tasks[:n_open], backlog, worth[rows])
                rows += 1
        assign(desk.assignment, rows, n_open)
    return n_open, rows


@kernel
def own_part(desk):
    """The task that the assignment on the desk gives to the robot that decides, or IDLE."""
    column = desk.assignment.column_of[1]
    return desk.tasks[column - 1] if column > 0 else IDLE


@kernel
def list_open(tasks, found):
    """Fill in the released tasks that the robot does not know as done; returns how many."""
    n = 0
    for j in range(tasks.shape[0]):
        if tasks[j].released and tasks[j].status != DONE:
            found[n] = j
            n += 1
    return n


@kernel
def rate_own(rules, plan, robot, tasks, taken, columns, backlog, worth):
    """Fill in the worths of open tasks to the robot itself, which knows its way and its masks."""
    for column in range(columns.shape[0]):
        j = columns[column]
        task, is_held = tasks[j], j == robot.task
        worth[column] = 0.0
        is_taken = task.status == SERVICED and task.age < CLAIM_TRUST
        if is_held and robot.can_keep or task.legal and not is_taken:
            way = 0.0 if is_held and robot.activity == SERVICING else task.distance
            saved = task_worth(rules, plan, task, way / robot.speed, robot.mode, robot.time, backlog)
            worth[column] = saved * (LOYALTY if is_held else 1.0)
            if not is_held and taken[j] >= 0.0:
                worth[column] *= TAKEN


@kernel
def rate_peer(rules, plan, now, peer, tasks, columns, backlog, worth):
    """Fill in the worths of open tasks to a peer, as far as its last report tells."""
    worth[: columns.shape[0]] = 0.0
    held, x, y = peer.task, float(peer.x), float(peer.y)
    speed = rules.speed[1 if peer.mode == CONTROLLED else 0, peer.embodiment]
    if peer.activity == SERVICING:
        is_at_work = peer.age < REPEATS * autonomous_seconds(rules, tasks[held].difficulty)
        if is_at_work:
            for column in range(columns.shape[0]):
                if columns[column] == held:
                    worth[column] = AT_WORK
            return
        held = NOBODY
    elif peer.activity == TRAVELLING and plan.reckons:
        goal = tasks[held]
        share = min(1.0, peer.age * speed / max(1e-6, distance(goal.x - x, goal.y - y)))
        x, y = x + share * (goal.x - x), y + share * (goal.y - y)
    for column in range(columns.shape[0]):
        j = columns[column]
        task = tasks[j]
        if is_compatible(peer.embodiment, task.type):
            way = distance(task.x - x, task.y - y) * (1.0 if peer.embodiment == UAV else DETOUR)
            saved = task_worth(rules, plan, task, way / speed, peer.mode, now, backlog)
            is_claimed = plan.heeds_claims and j == held and peer.age < CLAIM_TRUST
            worth[column] = saved * (CLAIM if is_claimed else 1.0)


@kernel
def task_worth(rules, plan, task, travel, mode, now, backlog):
    """What going for a task now saves a second, and what beside it makes a task one to do first; not negative."""
    seconds = task_seconds(rules, plan, task, travel, mode)
    saved = max(0.0, regret(rules, task, seconds, now, backlog))
    if not plan.weighs:
        return saved
    slack = (task.deadline - now - seconds) / SLACK
    return saved * exp(HARDNESS * task.difficulty - URGENCY * slack / (1.0 + abs(slack)) - HASTE * log(seconds))


@kernel
def task_seconds(rules, plan, task, travel, mode):
    """Expected seconds until a task is done, with the help that is expected."""
    success = expected_success(rules, task.difficulty, plan.expects_control or mode == CONTROLLED)
    return expected_seconds(travel, autonomous_seconds(rules, task.difficulty), success)


@kernel
def expected_success(rules, difficulty, is_helped):
    """Chance of one attempt, by an operator of mean fatigue if one helps."""
    success = autonomous_success(rules, difficulty)
    return max(success, controlled_success(rules, difficulty, FATIGUE)) if is_helped else success
