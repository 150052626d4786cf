"""The state of a batch of missions: a few arrays of records, leading axis = missions.

One record type a subject, so that a rule reads like its sentence in docs/benchmark.md (`robot.task = task`) and
one compiled kernel serves every team and map size. `state.robots["x"]` is an [missions, robots] view.
Times are seconds since the mission's start; NEVER marks none. Counts and indices are 8-byte integers
wherever kernels pass them on, so that each kernel is compiled once.
"""

from typing import NamedTuple

import numpy as np

from ..base.elementary_functions import expm1, log1p
from ..base.kernels import kernel, record
from ..base.terms import Fate, Kind
from ..models.routes import new_scratch
from ..models.world import World
from ..radio.link_models import RADIO, radio_rules
from ..radio.obstacles import make_obstacles
from ..scenarios import Scenario

NEVER = -1.0
MAX_SHARED = 8  # task records in one message
LUCK = "value", "value_by_time_left", "minutes", "minutes_by_time_left"  # its measures (service.py: count_luck)
N_UPLINK_PLACES = 3  # query, request, telemetry, by priority


RULES = record(  # a scenario's numbers as the kernels read them
    radio=(RADIO,), robot_period="i8", operator_period="i8", out_degree="i8", delay="i8", late_low="i8", late_high="i8",
    time_limit="i8", initial_phase_end="i8", picks_first="i8", broadcast_records="i8", telemetry_records="i8",
    message_bytes=("i8", (len(Kind),)), speed=("f8", (2, 2)), hazard="f8", controlled_hazard="f8", sensing_radius="f8",
    bucket="f8", refill="f8", broadcast_bucket="f8", broadcast_refill="f8", time_to_live="f8",
    telemetry_period="f8", service_base="f8", service_per_difficulty="f8", success_autonomous=("f8", (2,)),
    success_controlled=("f8", (3,)), fatigue_rate="f8", recovery_rate="f8", travel_workload="f8",
    service_workload=("f8", (2,)), fatigue_slowdown="f8", handover="f8", lease="f8", renewal_period="f8", bid_timeout="f8",
    refusal="f8", arbitration="f8", pending_cost="f8", switch_cost="f8", switch_window="f8", incompatible_cost="f8",
    conflict_cost="f8",
)  # fmt: skip

# Where the arrays of one mission lie (mission/accessors.py): its state, its world, scratch, its log.
ADDRESSES = (
    "robots_at", "operators_at", "tasks_at", "beliefs_at", "peers_at", "inboxes_at", "resources_at", "commands_at", "tips_at",
    "uplinks_at", "downlinks_at",
    "air_at", "flying_at", "counters_at", "frames_at", "kinds_at", "canopies_at", "mountains_at", "calls_at",
    "waves_at", "intervals_at", "ray_at", "link_at", "route_frames_at", "corners_at", "goals_at", "to_goal_at", "next_hop_at",
    "between_at", "found_at", "distance_at", "dx_at", "dy_at",
    "clearance_at", "log_robots_at", "log_operators_at",
    "log_messages_at", "log_rewards_at", "log_links_at", "log_beliefs_at", "log_peers_at", "log_resources_at",
)  # fmt: skip
COUNTS = (
    "n_robots", "n_operators", "n_tasks", "n_uplink_places", "n_downlink_places", "n_parts", "n_canopies", "n_mountains",
    "n_waves", "n_corners", "n_link_columns", "n_log_ticks", "n_log_messages",
)  # fmt: skip

MISSION = record(
    rules=(RULES,), seed="u8", station_x="f8", station_y="f8", now="i8", over="i1", messages="i8", flying="i8",
    total_value="f8", pending_value="f8", luck=("f8", (len(LUCK),)),
    reward=("f8", (2,)), tick_reward=("f8", (2,)), switches="i8", incompatibles="i8", conflicts="i8", refusals="i8",
    **{name: "i8" for name in COUNTS + ADDRESSES},
)  # fmt: skip

ROBOT = record(
    embodiment="i8", x="f8", y="f8", activity="i8", mode="i8", task="i8", controller="i8", waypoint_x="f8", waypoint_y="f8",
    hop="i8", place="i8", radio_of="i8",
    handover_until="f8", lease_until="f8", tokens="f8", broadcast_tokens="f8", due="i8", prescribed="i8", next_decision="i8",
    stands_until="f8",
    next_telemetry="f8", last_broadcast="f8", last_request="f8", failed_at="f8",
)  # fmt: skip

OPERATOR = record(  # its session, leases and exemption are its own record: its clock, its commands, delivered reports
    proficiency=("f8", (2,)), capacity="f8", fatigue="f8", session="i8", robot="i8", bid_at="f8", queued_at="f8",
    accepted_at="f8", leased="i8", ordered_at="f8", lease_sent="f8", exempt="i8", left="i8", left_at="f8",
    tokens="f8", due="i8", next_decision="i8", control_time="f8",
)  # fmt: skip

TASK = record(  # what observations read lies together, in one cache line
    x="f8", y="f8", difficulty="f8", value="f8", deadline="f8", decay="f8", announced="i8", released="i8", type="i8",
    status="i8", progress="f8", owner="i8", release="f8", change_at="f8", changes_to="i8", changed_at="f8", done_at="f8",
    done_by="i8", chance="f8",
)  # fmt: skip

BELIEF = record(  # what a robot (or the station) holds of a task; `time` is when it was true at its origin
    time="f4", progress="f4", refused_until="f4", claim_time="f4", type="i1", status="i1", sensed="i1", claimed_by="i1",
)  # fmt: skip

PEER = record(  # what a robot (or the station) holds of a robot
    time="f4", x="f4", y="f4", progress="f4", request_time="f4", command_sent="f4", task="i2", activity="i1", mode="i1",
    controller="i1", command_from="i1",
)  # fmt: skip

RESOURCE = record(  # what a robot holds of an operator, from its replies
    time="f4", tokens="f4", queue="i2", robot="i2", session="i1", fatigue_class="i1",
)  # fmt: skip

INBOX = record(  # age of information: of robot records at one receiver, summed over seconds
    known="i8", time_sum="f8", age_sum="f8", samples="i8",
)  # fmt: skip

COMMAND = record(sent="f4")  # when the newest command that a robot heard of an operator was sent

TIP = record(time="f4", claim_time="f4")  # evidence times in the last tip on a task that the station sent to a robot

WAITING = record(  # a queued message; empty when since is NEVER. `about`: the task that the query named which it answers
    since="f8", target="i8", kind="i8", about="i8", log="i8",
)

MESSAGE = record(  # in the air
    kind="i8", sender="i8", receiver="i8", due="i8", sent="i8", log="i8", about="i8", records="i8",
    robot=(PEER,), resource=(RESOURCE,),
    task=("i8", (MAX_SHARED,)), belief=(BELIEF, (MAX_SHARED,)),
)  # fmt: skip

FLYING = record(slot="i8")

COUNTERS = record(  # one a message kind
    attempted="i8", sent="i8", bytes="i8", late="i8", latency_sum="i8", fate=("i8", (len(Fate),)),
)  # fmt: skip

# What a recorded mission writes down (mission/recorder.py).
ROBOT_ROW = record(
    x="f4", y="f4", progress="f4", tokens="f4", broadcast_tokens="f4", stand_left="f4", task="i2", choice="i2",
    activity="i1", mode="i1", controller="i1",
    broadcast="i1", query="i1", request="i1",
)  # fmt: skip
OPERATOR_ROW = record(fatigue="f4", tokens="f4", robot="i2", choice="i2", session="i1")
MESSAGE_ROW = record(queued="i4", sent="i4", ended="i4", sender="i2", receiver="i2", kind="i1", fate="i1", late="i1")
REWARD_ROW = record(mission="f8", coordination="f8")
LINK_ROW = record(percent="u1")
BELIEF_ROW = record(time="i4", claim_time="i4", progress="u1", type="i1", status="i1", refused="i1", claimed_by="i1")
PEER_ROW = record(time="i4", task="i2", x="f4", y="f4", activity="i1", mode="i1", controller="i1")
RESOURCE_ROW = record(time="i4", tokens="f4", queue="i2", robot="i2", session="i1", fatigue_class="i1")


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
    commands: np.ndarray  # [E, R, H] COMMAND
    tips: np.ndarray  # [E, R, T] TIP
    uplinks: np.ndarray  # [E, R, N_UPLINK_PLACES] WAITING
    downlinks: np.ndarray  # [E, H, 1 + R] WAITING: the command, then a reply to each robot
    air: np.ndarray  # [E, slots] MESSAGE
    flying: np.ndarray  # [E, slots] FLYING: slots in use (the first mission.flying), then free ones
    counters: np.ndarray  # [E, kinds] COUNTERS


class Ground(NamedTuple):
    """One world as the kernels read it."""

    frames: np.ndarray  # this and the next eight: radio.obstacles.Obstacles
    kinds: np.ndarray
    canopies: np.ndarray
    mountains: np.ndarray
    calls: np.ndarray
    waves: np.ndarray
    intervals: np.ndarray
    ray: np.ndarray
    link: np.ndarray
    route_frames: np.ndarray  # [parts, 6] inflated footprints -> unit circle
    corners: np.ndarray  # [corners, 6]
    goals: np.ndarray  # [T, 2]
    to_goal: np.ndarray  # [corners, T] f4
    next_hop: np.ndarray  # [T, corners] i2
    between: np.ndarray  # [T, T] f4
    found: np.ndarray  # this and the rest: scratch of a route query (models/routes.py)
    distance: np.ndarray
    dx: np.ndarray
    dy: np.ndarray
    clearance: np.ndarray


def new_state(n_missions: int, scenario: Scenario) -> State:
    """An empty state: nothing known, nothing queued, every robot idle."""
    e, r, h, t = n_missions, scenario.n_robots, scenario.n_operators, scenario.n_tasks
    transport = scenario.communication
    longest = max(transport.delay, *transport.late_delay)
    # In one second a robot sends one broadcast and one message a queue place at most, an operator likewise.
    slots = (r * (min(transport.out_degree, r) + N_UPLINK_PLACES) + h * (1 + r)) * (longest + 1)
    state = State(
        missions=np.zeros(e, MISSION),
        robots=np.zeros((e, r), ROBOT),
        operators=np.zeros((e, h), OPERATOR),
        tasks=np.zeros((e, t), TASK),
        beliefs=np.zeros((e, r + 1, t), BELIEF),
        peers=np.zeros((e, r + 1, r), PEER),
        inboxes=np.zeros((e, r + 1), INBOX),
        resources=np.zeros((e, r, h), RESOURCE),
        commands=np.zeros((e, r, h), COMMAND),
        tips=np.zeros((e, r, t), TIP),
        uplinks=np.zeros((e, r, N_UPLINK_PLACES), WAITING),
        downlinks=np.zeros((e, h, 1 + r), WAITING),
        air=np.zeros((e, slots), MESSAGE),
        flying=np.zeros((e, slots), FLYING),
        counters=np.zeros((e, len(Kind)), COUNTERS),
    )
    state.flying["slot"] = np.arange(slots)
    for records, fields in (
        (state.robots, ("task", "place", "controller", "failed_at", "last_request", "stands_until")),
        (state.operators, ("robot", "queued_at", "leased", "left")),
        (state.tasks, ("owner", "done_at", "done_by", "changed_at", "change_at")),
        (state.beliefs, ("time", "refused_until", "claim_time", "claimed_by")),
        (state.peers, ("time", "task", "controller", "request_time", "command_from", "command_sent")),
        (state.resources, ("time", "robot")),
        (state.commands, ("sent",)),
        (state.tips, ("time", "claim_time")),
        (state.uplinks, ("since",)),
        (state.downlinks, ("since",)),
    ):
        for field in fields:
            records[field] = NEVER
    return state


def ground_of(world: World, links: str) -> Ground:
    """The kernels' arrays of a world under a link model; its static ones are shared, scratch is its own.

    `world` must outlive them: they may hold the address of its MuJoCo model.
    """
    routes = world.routes
    return Ground(
        **make_obstacles(world, links)._asdict(),
        route_frames=routes.frames,
        corners=routes.corners,
        goals=routes.goals,
        to_goal=routes.to_goal,
        next_hop=routes.next_hop,
        between=routes.between,
        **new_scratch(len(routes.corners), len(routes.goals))._asdict(),
    )


def wire(state: State, log, e: int, ground: Ground) -> None:
    """Tell the record of mission `e` where its arrays lie.

    Their owner must outlive the kernels' calls; a mission's record is of no use to another batch.
    """
    mission = state.missions[e]
    mission["n_robots"], mission["n_operators"] = state.robots.shape[1], state.operators.shape[1]
    mission["n_tasks"] = state.tasks.shape[1]
    mission["n_uplink_places"], mission["n_downlink_places"] = state.uplinks.shape[2], state.downlinks.shape[2]
    mission["n_link_columns"] = state.robots.shape[1] + 1
    mission["n_log_ticks"], mission["n_log_messages"] = log.robots.shape[1], log.messages.shape[1]
    mission["n_parts"], mission["n_corners"] = len(ground.frames), len(ground.corners)
    for name in ("canopies", "mountains", "waves"):
        mission[f"n_{name}"] = len(getattr(ground, name))
    for prefix, arrays in (("", state._asdict()), ("log_", log._asdict())):
        for name, array in arrays.items():
            if name != "missions":
                mission[f"{prefix}{name}_at"] = array[e].ctypes.data
    for name, array in ground._asdict().items():
        assert array.flags.c_contiguous
        mission[f"{name}_at"] = array.ctypes.data


@kernel
def _hazard(share, seconds):
    """Chance of a failure in one second, where that share fails within so many."""
    return -expm1(log1p(-share) / seconds)


def write_rules(missions, scenario: Scenario, links: str, limitation: str) -> None:
    """Fill in the scenario's numbers under one link model and one limitation level."""
    side, limit = scenario.map_side, scenario.time_limit
    robots, transport = scenario.robots, scenario.communication
    rules = missions["rules"]
    for table in (scenario.tasks, scenario.operators, transport, scenario.decisions, scenario.reward):
        for name in table.__dataclass_fields__:
            if name in (RULES.names or ()):
                rules[name] = getattr(table, name)
    rules["radio"] = radio_rules(scenario, links, limitation)
    rules["time_limit"] = limit
    rules["initial_phase_end"] = round(scenario.decisions.initial_phase * limit)
    rules["picks_first"] = scenario.decisions.first_targets == "policy"
    rules["late_low"], rules["late_high"] = transport.late_delay
    rules["message_bytes"] = [getattr(transport, f"{kind.name.lower()}_bytes") for kind in Kind]
    rules["speed"] = (robots.autonomous_speed, robots.controlled_speed)
    rules["hazard"] = _hazard(robots.malfunction, limit)
    rules["controlled_hazard"] = robots.controlled_hazard * rules["hazard"]
    rules["sensing_radius"] = robots.sensing_radius * side
    rules["pending_cost"] = scenario.reward.pending
    for name in ("switch_cost", "incompatible_cost", "conflict_cost"):
        rules[name] *= sum(scenario.tasks.values) / len(scenario.tasks.values)
