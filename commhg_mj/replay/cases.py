"""The paper's case study, looked for in real missions: an operator expected, asked, found busy, and another task chosen.

A case is a robot without an operator that holds a task, believes an operator free, and asks it; the reply says that the
operator controls another robot; at its next decision the robot leaves the task, which it could have kept, for another.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ..base.terms import NOBODY, Session
from ..mission.trace import Trace, load_trace
from .beliefs import age_words, session_words
from .replayer import Decision, Replayer


@dataclass(frozen=True)
class Case:
    """One query that found its operator busy, and what the robot made of it."""

    asked: Decision  # the query
    answered: Decision  # the robot's first decision that knew the reply
    operator: int
    loyalty: tuple[float, float] | None = None  # probability of keeping the task: by the old report, by the reply

    @property
    def robot(self) -> int:
        return self.asked.robot

    @property
    def helped(self) -> int:
        """The robot that the operator controls, by its reply."""
        return int(self.answered.operators["robot"][self.operator])

    @property
    def left(self) -> int:
        """The task that was given up."""
        return self.asked.plan

    @property
    def taken(self) -> int:
        """The task that was chosen instead."""
        return self.answered.plan

    @property
    def replied(self) -> float:
        """Second at which the reply was true."""
        return self.answered.time - float(self.answered.operators["age"][self.operator])

    @property
    def settled(self) -> int:
        """Second at which the choice has taken effect."""
        return self.answered.time + 1

    @property
    def weight(self) -> tuple:
        """Better cases are greater.

        First those where the reply itself turned the choice; then those like the paper's, whose operator still controls the
        other robot and whose task left is the harder one.
        """
        swing = round(self.loyalty[0] - self.loyalty[1], 2) if self.loyalty else 0.0
        operator, difficulty = self.answered.truth.operators[self.operator], self.asked.tasks["difficulty"]
        lasts = (operator["session"], operator["robot"]) == (Session.HELD, self.helped)
        fall = float(difficulty[self.left] - difficulty[self.taken])
        return swing, lasts + (fall > 0), fall


def find_cases(decisions: Iterable[Decision]) -> list[Case]:
    """The cases among robots' decisions, which come in order of time."""
    open_, cases = {}, []  # by robot and operator: the query that waits for its reply
    for decision in decisions:
        for key in [key for key in open_ if key[0] == decision.robot]:
            asked, h = open_[key], key[1]
            is_answered = decision.time - decision.operators["age"][h] > asked.time
            if is_answered and _is_turned(asked, decision, h):
                cases.append(Case(asked, decision, h))
            if is_answered or decision.plan != asked.plan:
                del open_[key]
        if _is_hopeful(decision):
            open_.setdefault((decision.robot, decision.query), decision)
    return cases


def _is_hopeful(decision) -> bool:
    """Whether a robot that works alone asks an operator that it believes free."""
    if decision.query == NOBODY or decision.plan == NOBODY or decision.itself["controller"] != NOBODY:
        return False
    report = decision.operators[decision.query]
    return bool(report["age"] >= 0 and report["session"] == Session.REST)


def _is_turned(asked, decision, operator) -> bool:
    """Whether the operator is busy by its reply, and the robot leaves a task that it could have kept for another."""
    report, own = decision.operators[operator], decision.itself
    is_busy = report["session"] == Session.HELD and report["robot"] != decision.robot
    could_stay = own["task"] == asked.plan and own["can_keep"] and own["controller"] == NOBODY
    return bool(is_busy and could_stay and decision.plan not in (NOBODY, asked.plan))


def cases_of(path, policy: str | None = None) -> list[Case]:
    """The cases of a trace, the best first.

    Raises:
      ValueError: the file is no trace, or not of that policy; the message names it.
    """
    trace = load_trace(path)
    flight = Replayer(trace, policy, str(path))
    cases = [case for case in find_cases(flight.decisions()) if _is_granted(trace, case)]
    look = flight.preferences()
    if look is not None:
        cases = [_weigh(case, look) for case in cases]
    return sorted(cases, key=lambda case: case.weight, reverse=True)


def _is_granted(trace: Trace, case) -> bool:
    """Whether the robot got the task that it chose: somebody may have owned it."""
    return case.settled <= trace.ticks and trace.robot_task[case.settled, case.robot] == case.taken


def _weigh(case, look: Callable) -> Case:
    """With the probabilities of keeping the task: had the old report only aged, and by the reply."""
    asked, answered, h = case.asked, case.answered, case.operator
    unasked = answered.seen._replace(robot_operators=answered.seen.robot_operators.copy())
    row = unasked.robot_operators[0, h]
    is_open = row["legal"]
    unasked.robot_operators[0, h] = asked.operators[h]
    row["age"] += answered.time - asked.time
    row["legal"] = is_open
    return Case(asked, answered, h, (look(unasked).keep, look(answered.seen).keep))


def case_captions(case: Case, trace: Trace) -> list[tuple[int, str, list[str]]]:
    """(second, title, lines) of the three panels: expected, asked, after the reply."""
    names, h, asked = trace.scenario.robot_names, case.operator, case.asked
    robot, difficulty = names[case.robot], asked.tasks["difficulty"]
    session, with_whom = trace.operator_session[case.settled, h], trace.operator_robot[case.settled, h]
    still = "still " if (session, with_whom) == (Session.HELD, case.helped) else "by now "
    after = [f"{robot} leaves T{case.left} for T{case.taken} (difficulty {difficulty[case.taken]:.2f});"]
    after += [f"H{h} {still}{'is ' if session == Session.REST else ''}{session_words(session, with_whom, names)}"]
    if case.loyalty:
        after.append("would keep T{}: {:.1%} by the old report, {:.1%} by the reply".format(case.left, *case.loyalty))
    expected = [
        f"{robot} means to do T{case.left} (difficulty {difficulty[case.left]:.2f})",
        f"and believes H{h} free, by a report {age_words(asked.operators['age'][h])} old",
    ]
    found = [f"{robot} has asked H{h}; the reply, true at this second:", f"H{h} controls {names[case.helped]}"]
    return [
        (asked.time, "expected", expected),
        (round(case.replied), "asked, found busy", found),
        (case.settled, "after the reply", after),
    ]
