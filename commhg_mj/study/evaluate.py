"""Policies on held-out missions, paired mission by mission."""

import json

import numpy as np
from rich.table import Table

from ..files import whole_file
from ..pilots import find_policy, label_of
from .fly import HELD_OUT, fly
from .statistics import mean_interval, middle_interval


def evaluate(scenario, policies, n_missions, links, limitation, workers, advance) -> dict:
    """{policy: scores of the same held-out missions}."""
    seeds = range(HELD_OUT, HELD_OUT + n_missions)
    for policy in policies:
        find_policy(policy)  # refuses a bad one before anything flies
    return {policy: fly(scenario, policy, seeds, links, limitation, None, workers, advance) for policy in policies}


def compare_scores(scores: dict) -> list[dict]:
    """A row a policy: TWCR, its paired difference to the first policy, and how it communicates."""
    first = np.array([score.twcr for score in next(iter(scores.values()))])
    rows = []
    for policy, each in scores.items():
        twcr = np.array([score.twcr for score in each])
        sent = {kind: np.mean([score.messages[kind]["sent"] for score in each]) for kind in ("broadcast", "query", "request")}
        rows.append({
            "policy": label_of(policy), "privileged": find_policy(policy).is_privileged, "twcr": mean_interval(twcr),
            "iqm": middle_interval(twcr), "difference": mean_interval(twcr - first),
            "control_time": mean_interval([score.control_time for score in each]), **sent,
        })  # fmt: skip
    return rows


def evaluation_table(title, rows) -> Table:
    """What `commhg-mj evaluate` prints."""
    table = Table(title=title, title_justify="left")
    for name in ("policy", "TWCR", "IQM", f"minus {rows[0]['policy']}", "control time", "broadcasts", "queries", "requests"):
        table.add_column(name, justify="left" if name == "policy" else "right")
    for row in rows:
        mark = " (privileged)" if row["privileged"] else ""
        counts = (f"{row[kind]:,.0f}" for kind in ("broadcast", "query", "request"))
        table.add_row(
            row["policy"] + mark, str(row["twcr"]), str(row["iqm"]), str(row["difference"]), str(row["control_time"]), *counts
        )
    return table


def save_evaluation(path, settings: dict, scores: dict) -> None:
    """The settings and every mission's TWCR as JSON."""
    missions = {policy: [score.twcr for score in each] for policy, each in scores.items()}
    with whole_file(path) as draft:
        draft.write_text(json.dumps({**settings, "twcr": missions}))
