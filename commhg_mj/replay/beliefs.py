"""What a robot knew when it decided, beside the truth, in words."""

import numpy as np

from ..base.terms import IDLE, KEEP, NOBODY, Activity, Mode, Session, Status, TaskType
from ..mission.messages import TIRED, TIRING
from .replayer import Decision

NEVER_HEARD = "unknown: never heard"
TYPES = {TaskType.UAV_ONLY: "UAVs only", TaskType.UGV_ONLY: "UGVs only", TaskType.GENERAL: "both"}
FATIGUE = ("fresh", "tiring", "tired")


def headline(decision: Decision, names) -> str:
    """The robot's own state, in one line; `names` are the robots'."""
    own = decision.itself
    does = Activity(own["activity"]).name.lower() + (f", T{own['task']}" if own["task"] >= 0 else "")
    mode = Mode(own["mode"]).name.lower() + (f", operator{own['controller']}" if own["controller"] >= 0 else "")
    stands = f", refused: stands for {own['stand_left']:.0f} s" if own["stand_left"] else ""
    tokens = f"{own['tokens']:.0f} B of tokens, {own['broadcast_tokens']:.0f} B for broadcasts"
    return f"{names[decision.robot]} at {decision.time} s: {does}{stands}; {mode}; {tokens}"


def choice_words(decision: Decision) -> str:
    """What the robot chose, in one line."""
    task = {KEEP: f"keeps T{decision.plan}", IDLE: "idles"}.get(decision.task, f"takes T{decision.task}")
    words = [f"{task} (prescribed)" if decision.itself["prescribed"] else task]
    words += ["broadcasts"] * decision.broadcast
    words += [f"asks operator{decision.query}"] * (decision.query != NOBODY)
    words += ["requests assistance"] * decision.assist
    return ", ".join(words)


def believed_task(row) -> str:
    """A row of TASK_SEEN."""
    if row["age"] < 0:
        return f"{NEVER_HEARD}, announced for {TYPES[TaskType(row['type'])]}"
    return _task_words(row["status"], row["progress"], row["type"])


def true_task(task, names) -> str:
    """A row of TASK."""
    worker = f", {names[task['owner']]}'s" if task["owner"] != NOBODY and task["status"] != Status.DONE else ""
    return _task_words(task["status"], task["progress"], task["type"]) + worker


def believed_operator(row, names) -> str:
    """A row of OPERATOR_SEEN."""
    if row["age"] < 0:
        return NEVER_HEARD
    return _operator_words(row["session"], row["robot"], row["tokens"], row["queue"], row["fatigue_class"], names)


def true_operator(operator, queue, names) -> str:
    """A row of OPERATOR, and how many messages wait there."""
    fatigue = int(np.searchsorted((TIRING, TIRED), operator["fatigue"], side="right"))
    return _operator_words(operator["session"], operator["robot"], operator["tokens"], queue, fatigue, names)


def operator_sides(decision: Decision, names) -> list[tuple[str, str]]:
    """(belief with its age, truth) in words, one pair an operator."""
    sides = []
    for row, true, queue in zip(decision.operators, decision.truth.operators, decision.truth.queues):
        age = f", {age_words(row['age'])} ago" if row["age"] >= 0 else ""
        sides.append((believed_operator(row, names) + age, true_operator(true, queue, names)))
    return sides


def session_words(session, robot, names) -> str:
    """What an operator is doing."""
    if session == Session.REST:
        return "free"
    return f"{'controls' if session == Session.HELD else 'calls'} {names[robot]}"


def age_words(age) -> str:
    return f"{age:.0f} s" if age >= 0 else ""


def _task_words(status, progress, kind):
    words = {Status.OPEN: "open", Status.SERVICED: "in service", Status.DONE: "done"}[Status(status)]
    return f"{words}{f' {progress:.0%}' if status == Status.SERVICED else ''}, for {TYPES[TaskType(kind)]}"


def _operator_words(session, robot, tokens, queue, fatigue, names):
    return f"{session_words(session, robot, names)}, {FATIGUE[fatigue]}, {tokens:.0f} B, {queue} waiting"


def robot_words(robot) -> str:
    """What a robot does: a row of PEER_SEEN or of ROBOT."""
    task = f", T{robot['task']}" if robot["task"] != NOBODY else ""
    return f"{Activity(robot['activity']).name.lower()}{task}, {Mode(robot['mode']).name.lower()}"
