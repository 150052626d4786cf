"""What a robot knew when it decided, beside the truth, and what it preferred: words and tables."""

import numpy as np
from rich.table import Table

from ..mission.replies import TIRED, TIRING
from ..terms import IDLE, KEEP, NOBODY, Activity, Mode, Session, Status, TaskType
from .reflight import Decision

NEVER_HEARD = "unknown: never heard"
TYPES = {TaskType.UAV_ONLY: "UAVs only", TaskType.UGV_ONLY: "UGVs only", TaskType.GENERAL: "both"}
NUMBERS = ("difficulty", "value", "way (m)", "age", "preferred", "apart (m)")  # columns
FATIGUE = ("fresh", "tiring", "tired")


def headline(decision: Decision, names) -> str:
    """The robot's own state, in one line; `names` are the robots'."""
    own = decision.itself
    does = Activity(own["activity"]).name.lower() + (f", T{own['task']}" if own["task"] >= 0 else "")
    mode = Mode(own["mode"]).name.lower() + (f", operator{own['controller']}" if own["controller"] >= 0 else "")
    return f"{names[decision.robot]} at {decision.time} s: {does}; {mode}; {own['tokens']:.0f} B of tokens"


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


def task_table(decision: Decision, names, preferences=None) -> Table:
    """Every released task as believed and as it was; the preferred ones first."""
    columns = ["task", "difficulty", "value", "way (m)", "the robot believed", "age", "claimed by", "the truth", "preferred", ""]
    seen, own, lines = decision.tasks, decision.itself, []
    share = preferences.task if preferences else np.full(len(seen), np.nan)
    for j in np.argsort(-share, kind="stable"):
        row = seen[j]
        if row["released"]:
            claim = f"{names[row['claimed_by']]}, {age_words(row['claim_age'])} ago" if row["claimed_by"] != NOBODY else ""
            cells = [f"T{j}", f"{row['difficulty']:.2f}", f"{row['value']:g}", f"{row['distance']:.0f}", believed_task(row)]
            cells += [age_words(row["age"]), claim, true_task(decision.truth.tasks[j], names)]
            mark = "held" if j == own["task"] else "refused" if row["refused"] else ""
            lines.append([*cells, *_choice(share[j], row["legal"], decision.task == j, mark)])
    keep, idle = (preferences.keep, preferences.idle) if preferences else (np.nan, np.nan)
    lines.append(["KEEP", *[""] * 7, *_choice(keep, own["can_keep"], decision.task == KEEP)])
    lines.append(["IDLE", *[""] * 7, *_choice(idle, own["can_idle"], decision.task == IDLE)])
    return _make_table("tasks", columns, lines)


def operator_table(decision: Decision, names, preferences=None) -> Table:
    """Every operator as last reported and as it was; then what else the robot may send."""
    columns = ["whom to ask, what to send", "the robot believed", "age", "the truth", "preferred", ""]
    own, truth, lines = decision.itself, decision.truth, []
    heads = (preferences.query, preferences.gate, preferences.assist) if preferences else (None, None, None)
    query = np.full(1 + len(decision.operators), np.nan) if heads[0] is None else heads[0]
    gate, assist = (np.nan if share is None else share for share in heads[1:])
    for h, row in enumerate(decision.operators):
        true = true_operator(truth.operators[h], truth.queues[h], names)
        cells = [f"operator{h}", believed_operator(row, names), age_words(row["age"]), true]
        lines.append([*cells, *_choice(query[1 + h], row["legal"], decision.query == h)])
    for name, share, is_open, is_chosen in (
        ("nobody", query[0], True, decision.query == NOBODY),
        ("broadcast", gate, own["can_broadcast"], decision.broadcast),
        ("request assistance, if nobody is asked", assist, own["can_assist"], decision.assist),
    ):
        lines.append([name, "", "", "", *_choice(share, is_open, is_chosen)])
    return _make_table("operators and messages", columns, lines)


def peer_table(decision: Decision, names) -> Table:
    """Every other robot as last reported and as it was."""
    lines = []
    for r, (row, true) in enumerate(zip(decision.peers, decision.truth.robots)):
        if r != decision.robot:
            off = f"{np.hypot(row['x'] - true['x'], row['y'] - true['y']):.0f}" if row["age"] >= 0 else ""
            believed = _robot_words(row) if row["age"] >= 0 else NEVER_HEARD
            lines.append([names[r], believed, age_words(row["age"]), _robot_words(true), off])
    return _make_table("other robots", ["robot", "the robot believed", "age", "the truth", "apart (m)"], lines)


def _choice(share, is_open, is_chosen, mark=""):
    """The last two cells of a choice: how much it was preferred, None without a head, and what became of it."""
    what = "chosen" if is_chosen else mark or ("" if is_open else "masked")
    return None if np.isnan(share) else f"{share:.1%}" if is_open else "", what


def _make_table(title, columns, lines):
    """A rich table; a column without any cell is left out, and what was chosen stands out."""
    table = Table(title=title, title_justify="left")
    kept = [i for i in range(len(columns)) if any(line[i] is not None for line in lines)]
    for i in kept:
        table.add_column(columns[i], justify="right" if columns[i] in NUMBERS else "left")
    for line in lines:
        table.add_row(*(line[i] for i in kept), style="bold" if line[-1] == "chosen" else None)
    return table


def _task_words(status, progress, kind):
    words = {Status.OPEN: "open", Status.SERVICED: "in service", Status.DONE: "done"}[Status(status)]
    return f"{words}{f' {progress:.0%}' if status == Status.SERVICED else ''}, for {TYPES[TaskType(kind)]}"


def _operator_words(session, robot, tokens, queue, fatigue, names):
    return f"{session_words(session, robot, names)}, {FATIGUE[fatigue]}, {tokens:.0f} B, {queue} waiting"


def _robot_words(robot):
    task = f", T{robot['task']}" if robot["task"] != NOBODY else ""
    return f"{Activity(robot['activity']).name.lower()}{task}, {Mode(robot['mode']).name.lower()}"
