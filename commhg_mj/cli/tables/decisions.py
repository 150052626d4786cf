"""What a robot knew and preferred when it decided, and cases of a changed plan."""

from pathlib import Path

import numpy as np
from rich.table import Table

from ...base.terms import IDLE, KEEP, NOBODY
from ...replay.beliefs import NEVER_HEARD, age_words, believed_operator, believed_task, robot_words, true_operator, true_task
from ...replay.replayer import Decision

NUMBERS = ("difficulty", "value", "way (m)", "age", "preferred", "apart (m)")  # columns


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
            believed = robot_words(row) if row["age"] >= 0 else NEVER_HEARD
            lines.append([names[r], believed, age_words(row["age"]), robot_words(true), off])
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


def case_table(cases: list, names) -> Table:
    """One line a case.

    Args:
      cases: (its trace's path, `Case`) each. names: the robots' by path.
    """
    table = Table(title="an operator expected, asked, found busy; another task chosen", title_justify="left")
    has_heads = any(case.loyalty for _, case in cases)
    columns = ["mission", "robot", "operator", "asked at", "report's age", "reply of", "controls", "decided at", "left", "taken"]
    for column in columns + ["keep by old report", "by reply"] * has_heads:
        table.add_column(column)
    for path, case in cases:
        robot, asked, answered = names[path][case.robot], case.asked, case.answered
        age = age_words(asked.operators["age"][case.operator])
        cells = [Path(path).stem, robot, f"operator{case.operator}", f"{asked.time} s", age]
        cells += [f"{case.replied:.0f} s", names[path][case.helped], f"{answered.time} s"]
        cells += [f"T{j} ({asked.tasks['difficulty'][j]:.2f})" for j in (case.left, case.taken)]
        table.add_row(*cells, *(f"{share:.1%}" for share in case.loyalty or ()))
    return table
