"""Traces: one compressed npz a mission, complete enough that rendering and re-scoring simulate nothing.

Loading executes no code (numpy without pickle). A trace carries a format version; a damaged or foreign
file is refused by name.
"""

import dataclasses
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from ..base.arguments import check_seed, instance, number, path_of
from ..base.files import whole_file
from ..base.terms import Kind
from ..radio import find_link_model
from ..scenarios import LIMITATIONS, Scenario, from_json, to_json
from . import state as s
from .batch import MissionBatch
from .recorder import SAMPLE_PERIOD
from .score import twcr

FORMAT = 3
MAGIC = "commhg_mj trace"
HEAD = ("scenario", "seed", "policy", "links", "limitation")  # which mission it is
TABLES = ("belief", "peer", "resource")  # records sampled every `link_period` s, columns as in mission/state.py
TASK_FIELDS = {  # column of the trace: field of the simulator's state
    "type": "announced", "changed_to": "type", "changed_at": "changed_at", "difficulty": "difficulty", "value": "value",
    "deadline": "deadline", "decay": "decay", "release": "release", "done": "done_at", "done_by": "done_by",
}  # fmt: skip


@dataclass(frozen=True)
class Trace:
    """One mission, second by second: N ticks, R robots (UAVs first), H operators, T tasks, M messages.

    Times are seconds since the start, -1 for never; indices are -1 for none. Addresses of messages:
    0..R-1 robots, then H operators, then the station's shared table, -1 nobody.
    """

    scenario: Scenario
    seed: int
    policy: str
    links: str
    limitation: str
    robot_xy: np.ndarray  # f4 [N + 1, R, 2] m
    robot_activity: np.ndarray  # i1 [N + 1, R] Activity
    robot_mode: np.ndarray  # i1 [N + 1, R] Mode
    robot_task: np.ndarray  # i2 [N + 1, R]
    robot_controller: np.ndarray  # i1 [N + 1, R]
    robot_progress: np.ndarray  # f4 [N + 1, R] of its own task
    robot_tokens: np.ndarray  # f4 [N + 1, R] B of the uplink
    robot_broadcast_tokens: np.ndarray  # f4 [N + 1, R] B
    robot_stand_left: np.ndarray  # f4 [N + 1, R] s until a refused robot may choose again
    robot_choice: np.ndarray  # i2 [N + 1, R] task chosen in that second, KEEP, IDLE or NOT_DECIDED
    robot_broadcast: np.ndarray  # i1 [N + 1, R]
    robot_query: np.ndarray  # i1 [N + 1, R] operator asked
    robot_request: np.ndarray  # i1 [N + 1, R]
    operator_fatigue: np.ndarray  # f4 [N + 1, H]
    operator_session: np.ndarray  # i1 [N + 1, H] Session
    operator_robot: np.ndarray  # i2 [N + 1, H]
    operator_tokens: np.ndarray  # f4 [N + 1, H] B
    operator_choice: np.ndarray  # i2 [N + 1, H] robot chosen, KEEP, REST or NOT_DECIDED
    task_xy: np.ndarray  # f8 [T, 2] m
    task_type: np.ndarray  # i2 [T] TaskType as announced
    task_changed_to: np.ndarray  # i2 [T] TaskType at the end
    task_changed_at: np.ndarray  # f8 [T] the hidden change
    task_difficulty: np.ndarray  # f8 [T]
    task_value: np.ndarray  # f8 [T]
    task_deadline: np.ndarray  # f8 [T] s
    task_decay: np.ndarray  # f8 [T] s
    task_release: np.ndarray  # f8 [T] s
    task_done: np.ndarray  # f8 [T] s
    task_done_by: np.ndarray  # i2 [T]
    message_kind: np.ndarray  # i1 [M] Kind; messages in the order in which they were queued
    message_sender: np.ndarray  # i2 [M]
    message_receiver: np.ndarray  # i2 [M]
    message_queued: np.ndarray  # i4 [M] s
    message_sent: np.ndarray  # i4 [M] s it left the antenna
    message_ended: np.ndarray  # i4 [M] s it met its fate
    message_fate: np.ndarray  # i1 [M] Fate
    message_late: np.ndarray  # i1 [M] delayed
    message_bytes: np.ndarray  # i4 [M]
    link_quality: np.ndarray  # u1 [samples, R, R + 1] percent that would be delivered; last column: station
    reward: np.ndarray  # f8 [N, 2] mission part, coordination part
    records: dict  # "belief_time": [samples, R + 1, T], …: what every receiver held; row R is the station

    @property
    def ticks(self) -> int:
        """Seconds flown."""
        return len(self.reward)

    @property
    def link_period(self) -> int:
        """Seconds between samples of links and records."""
        return SAMPLE_PERIOD

    def twcr_until(self, t: float) -> float:
        """The Timely Weighted Completion Ratio (paper, eq. 5) of what was completed by second t."""
        done = np.where(self.task_done <= number("t", t, -np.inf, np.inf), self.task_done, -1.0)
        return twcr(self.task_value, self.task_deadline, self.task_decay, done)

    def twcr(self) -> float:
        """The mission's Timely Weighted Completion Ratio."""
        return self.twcr_until(np.inf)


ARRAYS = [field.name for field in dataclasses.fields(Trace) if field.type is np.ndarray]


def make_traces(batch: MissionBatch, policy: str) -> list[Trace]:
    """The traces of a recorded batch.

    Raises:
      ValueError: the batch was made without `record=True`.
    """
    instance("policy", policy, str)
    if not getattr(batch, "record", False):
        raise ValueError("record: the batch keeps no log; make it with record=True")
    return [_make_trace(batch, policy, e) for e in range(len(batch.seeds))]


def _make_trace(batch, policy, e) -> Trace:
    scenario, log, state = batch.scenario, batch.log, batch.state
    rows = int(state.missions["now"][e]) + 1
    robots, operators, tasks = log.robots[e, :rows], log.operators[e, :rows], state.tasks[e]
    messages = log.messages[e, : state.missions["messages"][e]]
    samples = (rows - 1) // SAMPLE_PERIOD + 1
    sizes = np.array([getattr(scenario.communication, f"{kind.name.lower()}_bytes") for kind in Kind], np.int32)
    rewards = log.rewards[e, : rows - 1]
    columns = {f"robot_{name}": robots[name] for name in robots.dtype.names if name not in "xy"}
    columns |= {f"operator_{name}": operators[name] for name in operators.dtype.names}
    columns |= {f"task_{name}": tasks[field] for name, field in TASK_FIELDS.items()}
    columns |= {f"message_{name}": messages[name] for name in messages.dtype.names}
    arrays = {name: np.ascontiguousarray(column) for name, column in columns.items()}
    tables = {name: getattr(log, f"{name}s")[e, :samples] for name in TABLES}
    return Trace(
        scenario=scenario,
        seed=batch.seeds[e],
        policy=policy,
        links=batch.links,
        limitation=batch.limitation,
        robot_xy=np.stack([robots["x"], robots["y"]], axis=-1),
        task_xy=np.stack([tasks["x"], tasks["y"]], axis=-1),
        message_bytes=sizes[messages["kind"]],
        link_quality=np.ascontiguousarray(log.links[e, :samples]["percent"]),
        reward=np.stack([rewards["mission"], rewards["coordination"]], axis=-1),
        records={f"{t}_{c}": np.ascontiguousarray(table[c]) for t, table in tables.items() for c in table.dtype.names},
        **{name: _narrow(name, array) for name, array in arrays.items()},
    )


def _narrow(name, array):
    """The state's integers are 8 bytes wide; two are enough for a file."""
    if name.startswith("task_"):
        return array if array.dtype.kind == "f" else array.astype(np.int16)
    return array


def save_trace(trace: Trace, path) -> None:
    """Write a trace atomically.

    Raises:
      ValueError: the file cannot be written; the message names it.
    """
    instance("trace", trace, Trace)
    path = path_of("path", path)
    head = {name: getattr(trace, name) for name in HEAD}
    head |= {"magic": MAGIC, "format": FORMAT, "scenario": to_json(trace.scenario)}
    arrays = {name: getattr(trace, name) for name in ARRAYS}
    arrays |= {f"record_{name}": column for name, column in trace.records.items()}
    with whole_file(path) as part, open(part, "wb") as file:
        np.savez_compressed(file, **head, **arrays)


def load_trace(path) -> Trace:
    """Read a trace.

    Raises:
      ValueError: no such file, damaged, not a trace, or of another format; the message names the file.
    """
    found = _read(path)
    try:
        find_link_model(str(found.get("links")))
    except ValueError as error:  # no damage: another process may have registered it
        raise ValueError(f"{path}: {error}") from None
    with _naming(path):
        return _assemble(found)


def load_head(path) -> dict:
    """Which mission a trace is of, by the names of HEAD; its arrays are not read.

    Raises:
      ValueError: as `load_trace`.
    """
    found = _read(path, HEAD)
    with _naming(path):
        return {name: found[name].item() for name in HEAD} | {"scenario": from_json(str(found["scenario"]))}


def _read(path, names=None) -> dict:
    """Everything in a trace of this format, or what bears some names."""
    path = path_of("path", path)
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {name: file[name] for name in file.files if names is None or name in ("magic", "format", *names)}
    except OSError as error:
        raise ValueError(f"cannot read trace {path}: {error.strerror or error}") from None
    except Exception as error:  # whatever zipfile, zlib and numpy say of bytes that are no archive
        raise ValueError(f"{path} is damaged or not a trace ({type(error).__name__})") from None
    if str(found.get("magic")) != MAGIC:
        raise ValueError(f"{path} is not a commhg_mj trace")
    if str(found.get("format")) != str(FORMAT):
        raise ValueError(f"{path} is a trace of format {found.get('format')}; this version reads format {FORMAT}")
    return found


@contextmanager
def _naming(path):
    try:
        yield
    except (KeyError, TypeError, AttributeError, RecursionError, ValueError) as error:
        raise ValueError(f"{path} is damaged: {error}") from None


def _assemble(found) -> Trace:
    """The trace in a file's arrays, each of which must have its type and fit the scenario."""
    scenario = from_json(str(found["scenario"]))
    for name, (dtype, shape) in _expected(scenario, len(found["reward"]), len(found["message_kind"])).items():
        if name not in found or found[name].dtype != dtype or found[name].shape != shape:
            raise ValueError(f"{name} is missing or does not fit")
    links, limitation = str(found["links"]), str(found["limitation"])
    if limitation not in LIMITATIONS:
        raise ValueError(f"unknown limitation {limitation!r}")
    return Trace(
        scenario=scenario,
        seed=check_seed(found["seed"].item()),
        policy=str(found["policy"]),
        links=links,
        limitation=limitation,
        records={name.removeprefix("record_"): found[name] for name in found if name.startswith("record_")},
        **{name: found[name] for name in ARRAYS},
    )


def _expected(scenario, ticks, n_messages) -> dict:
    """Type and shape of every array of a trace."""
    r, h, t = scenario.n_robots, scenario.n_operators, scenario.n_tasks
    rows, samples = ticks + 1, ticks // SAMPLE_PERIOD + 1
    arrays = {
        "robot_xy": (np.dtype("f4"), (rows, r, 2)),
        "task_xy": (np.dtype("f8"), (t, 2)),
        "message_bytes": (np.dtype("i4"), (n_messages,)),
        "link_quality": (np.dtype("u1"), (samples, r, r + 1)),
        "reward": (np.dtype("f8"), (ticks, 2)),
    }
    for name, field in TASK_FIELDS.items():
        arrays[f"task_{name}"] = np.dtype("f8" if s.TASK[field].kind == "f" else "i2"), (t,)
    tables = (
        ("robot", s.ROBOT_ROW, (rows, r)), ("operator", s.OPERATOR_ROW, (rows, h)), ("message", s.MESSAGE_ROW, (n_messages,)),
        ("record_belief", s.BELIEF_ROW, (samples, r + 1, t)), ("record_peer", s.PEER_ROW, (samples, r + 1, r)),
        ("record_resource", s.RESOURCE_ROW, (samples, r, h)),
    )  # fmt: skip
    for prefix, row, shape in tables:
        columns = (name for name in row.names or () if prefix != "robot" or name not in "xy")
        arrays |= {f"{prefix}_{name}": (row[name], shape) for name in columns}
    return arrays
