"""Scores of many missions."""

import dataclasses
import json

import numpy as np
from rich.console import Group
from rich.table import Table

from ...base.terms import Fate, Kind
from ...flights.statistics import mean_interval
from ...mission.score import Score

ROWS = {  # field of Score: what the table calls it
    "twcr": "TWCR",
    "lateness_loss": "value lost to lateness",
    "completion": "tasks completed",
    "on_time": "tasks completed on time",
    "mean_lateness": "lateness of late ones (s)",
    "control_time": "operators' control time",
    "fatigue": "fatigue at the end",
    "malfunctions": "malfunctions",
    "switches": "switches",
    "incompatibles": "incompatible arrivals",
    "conflicts": "control conflicts",
    "refusals": "claims refused",
    "bytes_sent": "bytes sent",
    "station_age": "age of station's reports (s)",
    "peer_age": "age of peers' reports (s)",
    "duration": "duration (s)",
}
FATES = (Fate.DELIVERED, Fate.TERRAIN, Fate.LOST, Fate.OUT_OF_RANGE, Fate.NO_TOKENS, Fate.EXPIRED, Fate.UNDERWAY)


def summary_table(title: str, scores: list[Score]) -> Group:
    """What `commhg-mj run` prints: means with 95 % intervals, then messages by kind and fate, means a mission."""
    table = Table(title=title, title_justify="left")
    table.add_column("mean a mission")
    table.add_column("value [95 % interval]", justify="right")
    for field, label in ROWS.items():
        table.add_row(label, str(mean_interval([getattr(score, field) for score in scores])))
    return Group(table, message_table(scores))


def message_table(scores: list[Score]) -> Table:
    """Mean counts a mission: one column a message kind."""
    kinds = [kind.name.lower() for kind in Kind]
    table = Table(title="messages a mission, by kind", title_justify="left")
    table.add_column("mean")
    for kind in kinds:
        table.add_column(kind, justify="right", no_wrap=True)
    for count in ("attempted", "sent", "bytes", *(fate.name.lower() for fate in FATES), "late", "mean_latency"):
        means = (np.mean([score.messages[kind][count] for score in scores]) for kind in kinds)
        label = "latency (s)" if count == "mean_latency" else count.replace("_", " ")
        table.add_row(label, *(f"{mean:,.1f}" for mean in means))
    return table


def summary_json(settings: dict, seeds, scores: list[Score]) -> str:
    """One object: the settings, means with intervals, and every mission's score."""
    means = {}
    for field in ROWS:
        interval = mean_interval([getattr(score, field) for score in scores])
        means[field] = {name: None if np.isnan(value) else value for name, value in interval._asdict().items()}
    missions = [{"seed": seed, **dataclasses.asdict(score)} for seed, score in zip(seeds, scores)]
    return json.dumps({**settings, "means": means, "missions": missions})
