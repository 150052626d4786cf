"""What the tables of an observation hold: every column with its bounds, for the spaces and specs of all interfaces.

Tables and columns are those of `commhg_mj.Observations` (docs/observations.md), as float32; an operator's two
proficiencies are two columns.
"""

import math

import numpy as np

from ..base.terms import NOBODY, Activity, Embodiment, Mode, Session, Status, TaskType
from ..mission.observe import OPERATOR_SEEN, OPERATOR_SEES, PEER_SEEN, REPORT_SEEN, ROBOT_SEES, TASK_SEEN, UNKNOWN
from ..scenarios import Scenario

FLAG = (0.0, 1.0)
WINDING = 10.0  # map diagonals: no ground route is longer

ROWS = {  # table: (who looks, at what)
    "robots": ("robots", ()),
    "robot_tasks": ("robots", ("tasks",)),
    "robot_peers": ("robots", ("robots",)),
    "robot_operators": ("robots", ("operators",)),
    "operators": ("operators", ()),
    "operator_reports": ("operators", ("robots",)),
}
RECORDS = {
    "robots": ROBOT_SEES, "robot_tasks": TASK_SEEN, "robot_peers": PEER_SEEN, "robot_operators": OPERATOR_SEEN,
    "operators": OPERATOR_SEES, "operator_reports": REPORT_SEEN,
}  # fmt: skip
INDICES = {"robots": ("mission", "robot"), "operators": ("mission", "operator")}  # a row's place says them already


def _columns(table):
    columns = [name for name in RECORDS[table].names or () if name not in INDICES.get(table, ())]
    if "proficiency" in columns:
        columns.remove("proficiency")
        columns += ["proficiency_uav", "proficiency_ugv"]
    return tuple(columns)


COLUMNS = {table: _columns(table) for table in ROWS}


def table_shape(table: str, scenario: Scenario) -> tuple:
    """(actors, …, columns) of a table in one mission."""
    counts = {"robots": scenario.n_robots, "operators": scenario.n_operators, "tasks": scenario.n_tasks}
    actors, seen = ROWS[table]
    return counts[actors], *(counts[name] for name in seen), len(COLUMNS[table])


def table_bounds(table: str, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """(lowest, highest) value [columns] f4 of every column of a table."""
    limits = {**_limits(scenario), **_overrides(table, scenario)}
    low, high = zip(*(limits[name] for name in COLUMNS[table]))
    return np.array(low, np.float32), np.array(high, np.float32)


def _limits(scenario) -> dict:
    """The bounds of every column name, in the units of docs/observations.md."""
    rules, side, time = scenario.tasks, scenario.map_side, scenario.time_limit
    operators, decisions = scenario.operators, scenario.decisions
    robot, operator = (NOBODY, scenario.n_robots - 1), (NOBODY, scenario.n_operators - 1)
    factors = np.array([operators.generalist, operators.uav_specialist, operators.ugv_specialist])
    flags = (
        "legal", "released", "refused", "query_waits", "request_waits", "prescribed", "exempt",
        "can_keep", "can_idle", "can_broadcast", "can_assist", "compatible",
    )  # fmt: skip
    kinds = {
        "embodiment": Embodiment, "activity": Activity, "mode": Mode, "session": Session, "type": TaskType, "status": Status,
        "task_type": TaskType, "task_status": Status,
    }  # fmt: skip
    ages = ("age", "claim_age", "request_age", "since_request", "since_bid", "task_age")
    return (
        {name: FLAG for name in flags}
        | {name: (0.0, float(max(kind))) for name, kind in kinds.items()}
        | {name: (UNKNOWN, time) for name in ages}
        | {
            "time": (0.0, time),
            "x": (0.0, side),
            "y": (0.0, side),
            "speed": (0.0, max(*scenario.robots.autonomous_speed, *scenario.robots.controlled_speed)),
            "task": (NOBODY, scenario.n_tasks - 1),
            "progress": FLAG,
            "task_progress": FLAG,
            "controller": operator,
            "robot": robot,
            "claimed_by": robot,
            "lease_left": (0.0, operators.lease),
            "handover_left": (0.0, operators.handover),
            "stand_left": (0.0, decisions.arbitration),
            "tokens": (0.0, scenario.communication.bucket),
            "broadcast_tokens": (0.0, scenario.communication.broadcast_bucket),
            "since_broadcast": (0.0, time + decisions.robot_period),
            "distance": (0.0, math.sqrt(2.0) * side),
            "difficulty": (0.0, rules.difficulty[1]),
            "value": (0.0, max(rules.values)),
            "deadline": (0.0, rules.last_release * time + rules.deadline[1]),
            "decay": (0.0, rules.decay[1]),
            "fatigue_class": (0.0, 2.0),
            "queue": (0.0, 1 + scenario.n_robots),
            "proficiency_uav": (factors[:, 0].min(), factors[:, 0].max()),
            "proficiency_ugv": (factors[:, 1].min(), factors[:, 1].max()),
            "capacity": operators.capacity,
            "fatigue": FLAG,
        }
    )


def _overrides(table, scenario) -> dict:
    """Columns whose bounds depend on the table."""
    if table == "robot_tasks":
        return {"distance": (0.0, WINDING * math.sqrt(2.0) * scenario.map_side)}
    if table == "operators":
        # The operator counts from when it last renewed; a renewal that arrives late extends the lease beyond.
        return {"lease_left": (-float(scenario.time_limit), scenario.operators.lease)}
    return {}
