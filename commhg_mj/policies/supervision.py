"""Operators who persist: what the auctioneer lets them do. They know delivered reports and their own sessions."""

import numpy as np

from ..base.kernels import kernel
from ..base.terms import KEEP, NOBODY, REST, Activity, Session
from .greedy import TIRED, gain, promise

RESTING, FAILED = int(Session.REST), int(Activity.FAILED)
HOLD = 2.0  # the gain of the robot that is held counts this many times: a handover costs time


@kernel
def persist(rules, observations, choices):
    """Keep a robot until its task is done, whatever becomes of the gain; then the robot that gains most. Fills in `choices`."""
    for i in range(observations.operators.shape[0]):
        operator = observations.operators[i]
        if operator.session != RESTING and not operator.exempt:
            choices[i] = KEEP
        else:
            choices[i] = best_robot(rules, operator, observations.operator_reports[i])


@kernel
def best_robot(rules, operator, reports):
    """The choice of an operator who is free, or whose robot has left its task."""
    best, choice = 0.0, REST
    if operator.session != RESTING and operator.fatigue < TIRED:
        held = reports[operator.robot]
        if held.activity != FAILED:
            # A robot without a task has just done one: its next report will name another.
            best = np.inf if held.task == NOBODY else max(0.0, HOLD * gain(rules, operator, held))
            choice = KEEP if best > 0.0 else REST
    for r in range(reports.shape[0]):
        worth = promise(rules, operator, reports[r])
        if worth > best and reports[r].legal:
            best, choice = worth, r
    return choice
