"""Greedy: the best immediate estimated utility out of local records, fixed communication (paper, IV-B)."""

import numpy as np

from ..base.arguments import flag, instance
from ..base.kernels import kernel
from ..base.terms import IDLE, KEEP, NOBODY, REST, Activity, Session, Status
from ..mission.batch import MissionBatch, stay
from ..mission.decide import Decisions
from ..mission.estimate import attempt, control_gain
from ..mission.observe import Observations
from .schedule import follow_schedule

SERVICING, RESTING, HELD = int(Activity.SERVICING), int(Session.REST), int(Session.HELD)
SERVICED = int(Status.SERVICED)
CLAIM_TRUST = 60.0  # s: a peer's claim or a report of service older than this is forgotten
REPORT_TRUST = 30.0  # s: likewise for a robot's report at the station
TIME_PRICE = 0.02  # task value a second: what a mean task costs while it is pending (paper, eq. 4)
BETTER = 0.2  # task value: a robot on its way turns only for a task that promises this much more
REQUESTED = 1.5  # an operator values a robot that asked for help this many times
TIRED = 0.75  # an operator at or above this fatigue rests


class Greedy:
    """Callable policy; sees observations and the scenario's public numbers.

    Args:
      asks: operators, by the schedule's rule.
    """

    def __init__(self, batch: MissionBatch, asks: bool = True):
        instance("batch", batch, MissionBatch)
        self.rules, self.asks = batch.rules, flag("asks", asks)

    def __call__(self, observations: Observations) -> Decisions:
        decisions = stay(observations)
        choose_tasks(self.rules, observations, decisions)
        choose_robots(self.rules, observations, decisions.operator)
        follow_schedule(observations, decisions, self.asks)
        return decisions


@kernel
def choose_tasks(rules, observations, decisions):
    """Robots: the best legal task that no peer is known to work on."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        if robot.activity == SERVICING and robot.can_keep or not robot.can_idle:
            continue
        best, choice = -np.inf, IDLE
        if robot.can_keep:
            best, choice = BETTER + utility(rules, robot, observations.robot_tasks[i, robot.task]), KEEP
        for j in range(observations.robot_tasks.shape[1]):
            row = observations.robot_tasks[i, j]
            claimed = row.claimed_by != NOBODY and row.claim_age < CLAIM_TRUST
            serviced = row.status == SERVICED and row.age < CLAIM_TRUST
            if row.legal and not claimed and not serviced:
                worth = utility(rules, robot, row)
                if worth > best:
                    best, choice = worth, j
        decisions.task[i] = choice


@kernel
def utility(rules, robot, row):
    """What the next attempt at a task promises by itself, less the price of its time; whatever comes after it."""
    gain, seconds = attempt(
        rules[0], row.distance, robot.speed, row.difficulty, row.deadline, row.decay, robot.time
    )
    return row.value * gain - TIME_PRICE * seconds


@kernel
def choose_robots(rules, observations, choices):
    """Operators: the robot whose task gains most by control; what is held is kept while it gains. Fills in `choices`."""
    for i in range(observations.operators.shape[0]):
        operator = observations.operators[i]
        if operator.session != RESTING and not operator.exempt:
            held = observations.operator_reports[i, operator.robot]
            stale = held.age < 0.0 or held.age > operator.since_bid
            keeps = stale or operator.session != HELD or gain(rules, operator, held) > 0.0
            choices[i] = KEEP if keeps else REST
            continue
        best, choice = 0.0, REST
        for r in range(observations.operator_reports.shape[1]):
            report = observations.operator_reports[i, r]
            worth = promise(rules, operator, report)
            if worth > best and (report.legal or r == operator.robot):
                best, choice = worth, KEEP if r == operator.robot else r
        choices[i] = choice


@kernel
def promise(rules, operator, report):
    """What an operator may expect of a robot, more if it asked for help; -inf if tired, by an old report, or another's."""
    is_taken = report.controller != NOBODY and report.controller != operator.operator
    if report.age < 0.0 or report.age > REPORT_TRUST or is_taken or operator.fatigue >= TIRED:
        return -np.inf
    is_requested = 0.0 <= report.request_age < REPORT_TRUST
    return gain(rules, operator, report) * (REQUESTED if is_requested else 1.0)


@kernel
def gain(rules, operator, report):
    """What control of a reported robot adds per second, 0 without a task."""
    if report.task == NOBODY:
        return 0.0
    return control_gain(
        rules[0], operator.proficiency[report.embodiment], operator.fatigue, report.embodiment,
        report.distance, report.progress, report.difficulty, report.value, report.deadline, report.decay, operator.time,
    )  # fmt: skip
