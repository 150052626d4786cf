"""Operators who persist, for planner and auctioneer. They know delivered reports and their own sessions."""

from ..base.kernels import kernel
from ..base.terms import KEEP, REST, Session
from ..mission.estimate import session_seconds
from .greedy import promise

RESTING = int(Session.REST)
HOLD = 1.5  # the robot that is held counts this many times: another costs a handover
OVERHEAD = 50.0  # s that a session costs its operator beside: the command's way, the report, another robot to be looked for


@kernel
def persist(rules, observations, choices):
    """Keep a robot until its task is done, whatever becomes of the gain; then the one that gains most. Fills in `choices`."""
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
    for r in range(reports.shape[0]):
        is_held = r == operator.robot
        worth = promise(rules, operator, reports[r]) * session_share(rules, operator, reports[r]) * (HOLD if is_held else 1.0)
        if worth > best and (reports[r].legal or is_held):
            best, choice = worth, KEEP if is_held else r
    return choice


@kernel
def session_share(rules, operator, report):
    """Share of the operator's time that a session with a reported robot would be control: short ones are mostly overhead."""
    seconds = session_seconds(
        rules[0], operator.proficiency[report.embodiment], operator.fatigue, report.embodiment,
        report.distance, report.progress, report.difficulty,
    )  # fmt: skip
    return seconds / (seconds + OVERHEAD)
