"""The state of a batch of missions: a few arrays of records, leading axis = missions.

One record type a subject, so that a rule reads like its sentence in the design (`robot.task = task`) and
one compiled kernel serves every team and map size. `state.robots["x"]` is an [missions, robots] view;
a snapshot is one copy of each array. Times are seconds since the mission's start; NEVER marks none.
"""

from typing import NamedTuple

import numpy as np

from ..terms import Fate, Kind

NEVER = -1.0
MAX_SHARED = 8  # task records in one message


def record(**fields) -> np.dtype:
    """A record type from field=type or field=(type, shape)."""
    return np.dtype([(name, *(kind if isinstance(kind, tuple) else (kind,))) for name, kind in fields.items()], align=True)


RULES = record(  # a scenario's numbers as the kernels read them
    link_model="i4", robot_period="i4", operator_period="i4", out_degree="i4", delay="i4", late_low="i4", late_high="i4",
    time_limit="i4", initial_phase_end="i4", broadcast_records="i4", telemetry_records="i4", message_bytes=("i4", (len(Kind),)),
    speed=("f8", (2, 2)), hazard="f8", controlled_hazard="f8", sensing_radius="f8", range="f8", on_time="f8", forest_decay="f8",
    mountain_decay="f8", bucket="f8", refill="f8", time_to_live="f8", telemetry_period="f8", service_base="f8",
    service_per_difficulty="f8", success_autonomous=("f8", (2,)), success_controlled=("f8", (3,)), fatigue_rate="f8",
    recovery_rate="f8", travel_workload="f8", service_workload=("f8", (2,)), fatigue_slowdown="f8", handover="f8", lease="f8",
    renewal_period="f8", bid_timeout="f8", refusal="f8", pending_cost="f8", switch_cost="f8", incompatible_cost="f8",
    conflict_cost="f8",
)  # fmt: skip

MISSION = record(  # one a mission
    seed="u8", now="i4", over="i1", messages="i4", flying="i4", total_value="f8", pending_value="f8", reward=("f8", (2,)),
    tick_reward=("f8", (2,)), switches="i4", incompatibles="i4", conflicts="i4", refusals="i4",
)  # fmt: skip

ROBOT = record(
    embodiment="i1", x="f8", y="f8", activity="i1", mode="i1", task="i2", controller="i1", waypoint_x="f8", waypoint_y="f8",
    hop="i2", handover_until="f8", lease_until="f8", tokens="f8", due="i1", prescribed="i1", next_decision="i4",
    next_telemetry="f8", last_broadcast="f8", last_request="f8", failed_at="f8",
)  # fmt: skip

OPERATOR = record(
    proficiency=("f8", (2,)), capacity="f8", fatigue="f8", session="i1", robot="i2", bid_at="f8", renewed_at="f8", exempt="i1",
    tokens="f8", due="i1", next_decision="i4", control_time="f8",
)  # fmt: skip

TASK = record(
    x="f8", y="f8", announced="i1", type="i1", changes_to="i1", change_at="f8", changed_at="f8", difficulty="f8", value="f8",
    deadline="f8", decay="f8", release="f8", released="i1", status="i1", progress="f8", owner="i2", done_at="f8", done_by="i2",
)  # fmt: skip

BELIEF = record(  # what a robot (or the station) holds of a task; `time` is when it was true at its origin
    time="f4", progress="f4", refused_until="f4", type="i1", status="i1", sensed="i1",
)  # fmt: skip

PEER = record(  # what a robot (or the station) holds of a robot
    time="f4", x="f4", y="f4", progress="f4", request_time="f4", task="i2", activity="i1", mode="i1", controller="i1",
)  # fmt: skip

RESOURCE = record(  # what a robot holds of an operator, from its replies
    time="f4", tokens="f4", queue="i2", robot="i2", session="i1", fatigue_class="i1",
)  # fmt: skip

INBOX = record(  # age of information: of robot records at one receiver, summed over seconds
    known="i4", time_sum="f8", age_sum="f8", samples="i8",
)  # fmt: skip

WAITING = record(since="f8", target="i2", kind="i1", log="i4")  # a queued message; empty when since is NEVER

MESSAGE = record(  # in the air
    kind="i1", sender="i2", receiver="i2", due="i4", sent="i4", log="i4", robot=PEER, resource=RESOURCE, records="i4",
    task=("i2", (MAX_SHARED,)), belief=(BELIEF, (MAX_SHARED,)),
)  # fmt: skip

COUNTERS = record(  # one a message kind
    attempted="i8", sent="i8", bytes="i8", late="i8", latency_sum="i8", fate=("i8", (len(Fate),)),
)  # fmt: skip


class State(NamedTuple):
    """R robots, H operators, T tasks; row R of `beliefs`, `peers` and `inboxes` is the station's table."""

    missions: np.ndarray  # [E] MISSION
    robots: np.ndarray  # [E, R] ROBOT
    operators: np.ndarray  # [E, H] OPERATOR
    tasks: np.ndarray  # [E, T] TASK
    beliefs: np.ndarray  # [E, R + 1, T] BELIEF
    peers: np.ndarray  # [E, R + 1, R] PEER
    inboxes: np.ndarray  # [E, R + 1] INBOX
    resources: np.ndarray  # [E, R, H] RESOURCE
    tips: np.ndarray  # [E, R, T] f4: evidence time of the last tip that the station sent to the robot
    uplinks: np.ndarray  # [E, R, 3] WAITING: query, request, telemetry, by priority
    downlinks: np.ndarray  # [E, H, 1 + R] WAITING: the command, then a reply to each robot
    air: np.ndarray  # [E, slots] MESSAGE
    flying: np.ndarray  # [E, slots] i4: slots in use (the first mission.flying), then free ones
    counters: np.ndarray  # [E, kinds] COUNTERS


def new_state(n_missions: int, scenario) -> State:
    """An empty state: nothing known, nothing queued, every robot idle."""
    e, r, h, t = n_missions, scenario.n_robots, scenario.n_operators, scenario.n_tasks
    transport = scenario.communication
    longest = max(transport.delay, *transport.late_delay)
    # Per second a robot sends one broadcast and one uplink message at most, an operator one a queue place.
    slots = (r * (min(transport.out_degree, r) + 3) + h * (1 + r)) * (longest + 1)
    state = State(
        missions=np.zeros(e, MISSION),
        robots=np.zeros((e, r), ROBOT),
        operators=np.zeros((e, h), OPERATOR),
        tasks=np.zeros((e, t), TASK),
        beliefs=np.zeros((e, r + 1, t), BELIEF),
        peers=np.zeros((e, r + 1, r), PEER),
        inboxes=np.zeros((e, r + 1), INBOX),
        resources=np.zeros((e, r, h), RESOURCE),
        tips=np.full((e, r, t), NEVER, np.float32),
        uplinks=np.zeros((e, r, 3), WAITING),
        downlinks=np.zeros((e, h, 1 + r), WAITING),
        air=np.zeros((e, slots), MESSAGE),
        flying=np.tile(np.arange(slots, dtype=np.int32), (e, 1)),
        counters=np.zeros((e, len(Kind)), COUNTERS),
    )
    for records, fields in (
        (state.robots, ("task", "controller", "failed_at", "last_request")),
        (state.operators, ("robot",)),
        (state.tasks, ("owner", "done_at", "done_by", "changed_at", "change_at")),
        (state.beliefs, ("time", "refused_until")),
        (state.peers, ("time", "task", "controller", "request_time")),
        (state.resources, ("time", "robot")),
        (state.uplinks, ("since",)),
        (state.downlinks, ("since",)),
    ):
        for field in fields:
            records[field] = NEVER
    return state


def rules_record(scenario, link_model: int, limitation: int) -> np.ndarray:
    """[1] RULES of a scenario under one link model and one limitation level (index)."""
    side, limit = scenario.map_side, scenario.time_limit
    robots, tasks, people, radio = scenario.robots, scenario.tasks, scenario.operators, scenario.communication
    rules = np.zeros(1, RULES)
    r = rules[0]
    for table in (tasks, people, radio, scenario.decisions, scenario.reward):
        for name in table.__dataclass_fields__:
            if name in RULES.names and name != "range":
                r[name] = getattr(table, name)
    r["link_model"] = link_model
    r["time_limit"] = limit
    r["initial_phase_end"] = round(scenario.decisions.initial_phase * limit)
    r["late_low"], r["late_high"] = radio.late_delay
    r["message_bytes"] = (
        radio.broadcast_bytes, radio.telemetry_bytes, radio.query_bytes, radio.request_bytes, radio.control_bytes,
        radio.renewal_bytes, radio.reply_bytes,
    )  # fmt: skip
    r["speed"] = (robots.autonomous_speed, robots.controlled_speed)
    r["hazard"] = 1.0 - (1.0 - robots.malfunction) ** (1.0 / limit)
    r["controlled_hazard"] = robots.controlled_hazard * r["hazard"]
    r["sensing_radius"] = robots.sensing_radius * side
    r["range"] = radio.range[limitation] * side
    r["on_time"] = 1.0 - radio.unavailable_or_delayed[limitation]
    r["pending_cost"] = scenario.reward.pending
    return rules
