"""Every field of a scenario, with its unit, its mark and its reason.

Marks: ``P`` is stated by the paper and fixed; ``D`` is our default where the paper is silent, chosen
within the calibration rules (docs/calibration.md).
"""

import dataclasses
import math
from dataclasses import dataclass

from .checks import check

LIMITATIONS = ("nominal", "low", "high")
PROFILES = ("matched", "edge", "radio")  # calibrations of the ray-cast link


def _field(default, unit, mark, doc, low=None, high=None, choices=()):
    """A scenario field; `low` and `high` are inclusive bounds of every number in it, `choices` its words."""
    metadata = {"unit": unit, "mark": mark, "doc": doc, "low": low, "high": high, "choices": choices}
    return dataclasses.field(default=default, metadata=metadata)


@dataclass(frozen=True)
class WorldRules:
    """Ground, obstacles and points of interest (POIs)."""

    forest_share: float = _field(0.10, "of the area", "D", "forest footprints", 0, 0.4)
    mountain_share: float = _field(0.05, "of the area", "D", "mountain footprints; without a heightmap", 0, 0.3)
    n_forests: int = _field(7, "count", "D", "forests; each is a union of up to four discs", 0, 64)
    n_mountains: int = _field(3, "count", "D", "mountains, each an ellipse; without a heightmap", 0, 32)
    canopy_height: tuple = _field((12.0, 20.0), "m", "D", "lowest and highest canopy top", 3, 60)
    mountain_height: tuple = _field((60.0, 150.0), "m", "D", "lowest and highest summit; a heightmap's white", 5, 1000)
    heightmap: str = _field("", "", "D", "the mountains' picture: a TOML file names a PNG (docs/worlds.md); empty: drawn ones")
    poi_spacing: float = _field(0.02, "of the side", "D", "no two POIs closer", 0, 0.1)
    uav_height: float = _field(60.0, "m", "D", "flight height above the floor of flights, over plains above the ground", 1, 500)
    uav_slope: float = _field(
        0.4, "rise over run", "D", "of the floor of flights, at most: climbs of 7 m/s autonomously, 10 m/s controlled", 0.01, 1e6
    )
    ugv_radius: float = _field(2.0, "m", "D", "footprints are inflated by it for routes", 0.1, 20)
    mast_height: float = _field(15.0, "m", "D", "station antenna above the ground", 1, 200)


@dataclass(frozen=True)
class RobotRules:
    """Speeds and malfunctions; pairs are (UAV, UGV)."""

    autonomous_speed: tuple = _field((18.0, 5.0), "m/s", "P", "speed without control", 0.01, 1000)
    controlled_speed: tuple = _field((25.0, 8.0), "m/s", "P", "speed under human control", 0.01, 1000)
    malfunction: float = _field(0.10, "probability", "D", "an autonomous robot fails within the time limit", 0, 0.999)
    controlled_hazard: float = _field(0.4, "factor", "D", "on the hazard while controlled", 0, 1)
    sensing_radius: float = _field(0.03, "of the side", "D", "true task state is seen within it", 0, 2)


@dataclass(frozen=True)
class TaskRules:
    """How tasks are drawn, serviced and change."""

    type_shares: tuple = _field((0.25, 0.25, 0.50), "share", "D", "UAV-only, UGV-only, general", 0, 1)
    difficulty: tuple = _field((0.0, 1.0), "", "D", "range of the uniform difficulty D", 0, 1)
    values: tuple = _field((1.0, 2.0, 3.0), "", "D", "equally likely task values", 0.001, 1e6)
    released_at_start: float = _field(0.70, "share", "D", "tasks known at t = 0", 0, 1)
    last_release: float = _field(0.60, "of the limit", "D", "later releases are uniform up to here", 0, 1)
    deadline: tuple = _field((110.0, 575.0), "s", "D", "deadline after the release, uniform", 0, 1e6)
    decay: tuple = _field((80.0, 240.0), "s", "D", "late-value decay timescale, uniform", 0.001, 1e6)
    change_share: float = _field(0.40, "share", "D", "general tasks that turn robot-exclusive", 0, 1)
    change_within: float = _field(0.30, "of the limit", "D", "the change comes this soon after the release, uniform", 0, 1)
    service_base: float = _field(20.0, "s", "D", "autonomous service time at D = 0", 1, 1e5)
    service_per_difficulty: float = _field(80.0, "s", "D", "added at D = 1", 0, 1e5)
    success_autonomous: tuple = _field((0.75, 0.55), "", "D", "P(success) = a - b D", 0, 1)
    success_controlled: tuple = _field(
        (0.97, 0.15, 0.20), "", "D", "P(success) = a - b D - c fatigue", 0, 1
    )


@dataclass(frozen=True)
class OperatorRules:
    """Proficiency, fatigue and control sessions; pairs are (UAV, UGV)."""

    generalist: tuple = _field((0.90, 0.90), "factor", "P", "service-time multipliers", 0.01, 10)
    uav_specialist: tuple = _field((0.65, 1.20), "factor", "P", "service-time multipliers", 0.01, 10)
    ugv_specialist: tuple = _field((1.20, 0.65), "factor", "P", "service-time multipliers", 0.01, 10)
    capacity: tuple = _field((0.7, 1.3), "", "D", "cognitive capacity c, uniform", 0.01, 10)
    fatigue_rate: float = _field(
        1.527e-3, "1/s", "D", "k_a: ten minutes of hard control bring a mean operator to 0.6", 0, 1
    )
    recovery_rate: float = _field(2.310e-3, "1/s", "D", "k_r: five minutes of rest halve fatigue", 0, 1)
    travel_workload: float = _field(0.3, "", "D", "w while the robot travels or idles", 0, 1)
    service_workload: tuple = _field((0.4, 0.6), "", "D", "w = a + b D while it services", 0, 1)
    fatigue_slowdown: float = _field(0.5, "", "D", "controlled service time x (1 + this x fatigue)", 0, 10)
    handover: float = _field(6.0, "s", "D", "after acceptance, without progress", 0, 600)
    lease: float = _field(15.0, "s", "D", "control holds this long after the last command that arrived was sent", 1, 3600)
    renewal_period: float = _field(10.0, "s", "D", "KEEP renews at most this often", 1, 3600)
    bid_timeout: float = _field(20.0, "s", "D", "a command whose acceptance is not reported by then is given up", 1, 3600)


@dataclass(frozen=True)
class CommunicationRules:
    """Transport; triples are (nominal, low, high) limitation."""

    range: tuple = _field((0.30, 0.22, 0.06), "of the side", "P/D", "robot-robot range; nominal [P]", 0, 2)
    unavailable_or_delayed: tuple = _field(
        (0.10, 0.20, 0.30), "probability", "P", "lost or delayed over clear ground, in equal shares", 0, 1
    )
    out_degree: int = _field(4, "count", "P", "neighbours of one broadcast", 1, 64)
    delay: int = _field(1, "s", "D", "of a message in time", 1, 60)
    late_delay: tuple = _field((3, 8), "s", "D", "of a delayed message, uniform", 1, 60)
    broadcast_records: int = _field(4, "count", "D", "freshest task records in a broadcast", 0, 8)
    telemetry_records: int = _field(4, "count", "D", "freshest sensed task records in telemetry", 0, 8)
    bucket: float = _field(192.0, "B", "P", "capacity of each uplink and downlink token bucket", 1, 1e9)
    refill: float = _field(6.5, "B/s", "D", "of each of them", 0, 1e9)
    broadcast_bucket: float = _field(640.0, "B", "D", "capacity of each robot's token bucket for broadcasts", 1, 1e9)
    broadcast_refill: float = _field(4.0, "B/s", "D", "of each of them", 0, 1e9)
    time_to_live: float = _field(24.0, "s", "P", "of every queued message", 1, 1e6)
    broadcast_bytes: int = _field(160, "B", "D", "state, assignment and four task records", 1, 65535)
    telemetry_bytes: int = _field(40, "B", "D", "own state, own task, freshest sensed records", 1, 65535)
    query_bytes: int = _field(32, "B", "P", "information query", 1, 65535)
    request_bytes: int = _field(24, "B", "D", "assistance request", 1, 65535)
    control_bytes: int = _field(48, "B", "D", "control command", 1, 65535)
    renewal_bytes: int = _field(24, "B", "D", "lease renewal", 1, 65535)
    release_bytes: int = _field(24, "B", "D", "end of a lease before its time", 1, 65535)
    reply_bytes: int = _field(56, "B", "D", "resource report and task tip", 1, 65535)
    telemetry_period: float = _field(5.0, "s", "D", "telemetry falls due this often", 1, 3600)
    forest_decay: float = _field(73.0, "m", "D", "l_f: abstract links lose exp(-metres/l_f) in forest", 0.01, 1e9)
    mountain_decay: float = _field(10.0, "m", "D", "l_m: the same inside mountains", 0.01, 1e9)


@dataclass(frozen=True)
class RadioRules:
    """The ray-cast link's budget, and the abstract link fitted to it (docs/radio.md; formulas: radio/losses.py)."""

    profile: str = _field(
        "matched", "", "D", "matched: capped range, clear links as the abstract ones; edge: 95 % at the range by SNR alone; "
        "radio: an unmodified radio", choices=PROFILES,
    )  # fmt: skip
    frequency: float = _field(2.4, "GHz", "D", "carrier", 0.1, 100)
    transmit_power: float = _field(20.0, "dBm", "D", "with antennas of 0 dBi", 0, 60)
    bandwidth: float = _field(20.0, "MHz", "D", "of the noise", 0.001, 1000)
    noise_figure: float = _field(7.0, "dB", "D", "of the receiver", 0, 40)
    margin: float = _field(15.0, "dB", "D", "matched: of a clear link at the nominal range over the 50 % point", 0, 60)
    foliage: str = _field("itu", "", "D", "P.833-10 eq. 1, or Weissberger's model", choices=("itu", "weissberger"))
    foliage_rate: float = _field(0.382, "dB/m", "D", "P.833's gamma, for short ways at the carrier", 0, 10)
    foliage_limit: float = _field(36.0, "dB", "D", "P.833's A_m, for long ways at the carrier", 0.1, 200)
    diffraction: str = _field(
        "edge", "", "D", "P.526's knife edge at the Bullington point, bullington adds its correction",
        choices=("edge", "bullington"),
    )  # fmt: skip
    shadowing: float = _field(0.0, "dB", "D", "sigma of log-normal shadowing; 0: none, 4 is usual", 0, 20)
    shadowing_length: float = _field(25.0, "m", "D", "along this way shadowing decorrelates to 1/e", 0.1, 1e4)
    uav_antenna: float = _field(0.0, "m", "D", "above the UAV", 0, 50)
    ugv_antenna: float = _field(1.0, "m", "D", "above the ground; the station's is world.mast_height", 0.1, 50)
    fitted_forest_decay: float = _field(532.1, "m", "D", "abstract-fit: l_f by maximum likelihood", 0.01, 1e9)
    fitted_mountain_decay: float = _field(300.2, "m", "D", "abstract-fit: l_m, likewise", 0.01, 1e9)


@dataclass(frozen=True)
class DecisionRules:
    """When actors decide, and the shared mechanisms."""

    robot_period: int = _field(10, "s", "D", "a robot decides at least this often", 1, 3600)
    operator_period: int = _field(5, "s", "D", "an operator decides at least this often", 1, 3600)
    first_targets: str = _field(
        "initializer", "", "D", "who picks them at t = 0: the initializer, or each robot's policy",
        choices=("initializer", "policy"),
    )  # fmt: skip
    initial_phase: float = _field(0.10, "of the limit", "D", "longest prescribed first target", 0, 1)
    refusal: float = _field(20.0, "s", "D", "after its stand a refused robot may not choose that task for so long", 0, 3600)
    arbitration: float = _field(60.0, "s", "D", "a refused robot stands so long: claim and answer are on their way", 0, 3600)


@dataclass(frozen=True)
class RewardRules:
    """Costs of the team reward (paper, eq. 4), in mean task values: the same on every scale."""

    pending: float = _field(0.01, "1/s", "P", "times the pending share of V0", 0, 1)
    switch_cost: float = _field(0.2, "mean task value", "D", "a non-exempt change of the controlled robot", 0, 100)
    switch_window: float = _field(60.0, "s", "D", "another robot within it of a non-exempt end is a change", 0, 86400)
    incompatible_cost: float = _field(0.2, "mean task value", "D", "choosing an incompatible task", 0, 100)
    conflict_cost: float = _field(0.1, "mean task value", "D", "commanding a robot that another operator holds", 0, 100)


@dataclass(frozen=True)
class Scenario:
    """One mission class. Build variants with `load_scenario` or `dataclasses.replace`.

    Raises:
      ValueError: a field is impossible; the message names it.
    """

    name: str = _field("medium", "", "D", "label, part of file names")
    map_side: float = _field(1000.0, "m", "P", "side of the square map", 50, 1e5)
    n_tasks: int = _field(56, "count", "P", "tasks of all releases", 1, 1024)
    time_limit: int = _field(1200, "s", "P", "mission duration", 1, 86400)
    n_uav: int = _field(4, "count", "P", "aerial robots", 0, 64)
    n_ugv: int = _field(4, "count", "P", "ground robots", 0, 64)
    n_operators: int = _field(3, "count", "P", "human operators", 0, 24)
    world: WorldRules = WorldRules()
    robots: RobotRules = RobotRules()
    tasks: TaskRules = TaskRules()
    operators: OperatorRules = OperatorRules()
    communication: CommunicationRules = CommunicationRules()
    radio: RadioRules = RadioRules()
    decisions: DecisionRules = DecisionRules()
    reward: RewardRules = RewardRules()

    def __post_init__(self):
        check(self)
        if not 1 <= self.n_robots <= 64:
            raise ValueError(f"n_uav + n_ugv must lie in 1..64, is {self.n_robots}")
        shares = self.tasks.type_shares
        if not math.isclose(sum(shares), 1.0, abs_tol=1e-6):
            raise ValueError(f"tasks.type_shares must sum to 1, sums to {sum(shares):g}")
        for field in dataclasses.fields(self.communication):
            bucket = "broadcast_bucket" if field.name == "broadcast_bytes" else "bucket"
            value = getattr(self.communication, field.name)
            if field.name.endswith("_bytes") and value > getattr(self.communication, bucket):
                raise ValueError(f"communication.{field.name} = {value} does not fit into communication.{bucket}")

    @property
    def n_robots(self) -> int:
        return self.n_uav + self.n_ugv

    @property
    def robot_names(self) -> list[str]:
        """UAVs first, as everywhere: uav0, uav1, …, ugv0, …"""
        return [f"uav{i}" for i in range(self.n_uav)] + [f"ugv{i}" for i in range(self.n_ugv)]
