"""A mission at t = 0: its tasks and operators are drawn, its robots stand at the station."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..base.kernels import kernel
from ..base.terms import NOBODY, Embodiment, TaskType
from ..models.world import World
from ..radio import LinkModel
from .accessors import true_robot, true_task
from .estimate import expected_utility
from .observe import TASK_SEEN, observe_tasks
from .recorder import log_tick
from .records import is_compatible
from .service import take_task
from .state import NEVER
from .tick import look_around, release_and_change

STREAM = 2  # separates the mission's random stream from the world's


def draw_mission(state, e: int, world: World) -> None:
    """Fill mission `e` of the batch from its world; every draw depends on the world's seed alone."""
    scenario = world.scenario
    rng = np.random.default_rng([world.seed, STREAM])
    draw_tasks(state.tasks[e], world, rng)
    draw_operators(state.operators[e], scenario, rng)
    robots = state.robots[e]
    robots["embodiment"] = [Embodiment.UAV] * scenario.n_uav + [Embodiment.UGV] * scenario.n_ugv
    robots["x"], robots["y"] = world.layout.starts.T
    robots["tokens"] = scenario.communication.bucket
    robots["broadcast_tokens"] = scenario.communication.broadcast_bucket
    robots["due"] = 1
    # Telemetry and broadcasts of a team do not all fall due in the same second.
    robots["next_telemetry"] = 1 + np.arange(scenario.n_robots) % scenario.communication.telemetry_period
    robots["last_broadcast"] = -1 - np.arange(scenario.n_robots) % scenario.decisions.robot_period
    mission = state.missions[e : e + 1]
    is_shuffled = mission["rules"]["radio"]["link_model"][0] == LinkModel.RAYCAST_SHUFFLED
    robots["radio_of"] = others(scenario.n_robots, world.seed) if is_shuffled else np.arange(scenario.n_robots)
    mission["seed"] = world.seed
    mission["station_x"], mission["station_y"] = world.layout.station
    mission["total_value"] = state.tasks[e]["value"].sum()


def others(n: int, seed: int) -> np.ndarray:
    """[n] for each of n robots another one: a random cycle."""
    order = np.random.default_rng([seed, STREAM, 1]).permutation(n)
    return order[np.argsort(np.roll(order, 1))]


def draw_tasks(tasks, world: World, rng) -> None:
    """Attributes of all tasks, released and later ones."""
    rules, n, limit = world.scenario.tasks, len(tasks), world.scenario.time_limit
    tasks["x"], tasks["y"] = world.pois.T
    tasks["announced"] = tasks["type"] = world.poi_types
    tasks["difficulty"] = rng.uniform(*rules.difficulty, n)
    tasks["value"] = rng.choice(rules.values, n)
    later = rng.permutation(n)[round(rules.released_at_start * n) :]
    tasks["release"][later] = np.floor(rng.uniform(0, rules.last_release, len(later)) * limit)
    tasks["deadline"] = tasks["release"] + rng.uniform(*rules.deadline, n)
    tasks["decay"] = rng.uniform(*rules.decay, n)
    changes = (world.poi_types == TaskType.GENERAL) & (rng.random(n) < rules.change_share)
    tasks["change_at"] = np.where(changes, np.floor(tasks["release"] + 1 + rng.uniform(0, rules.change_within, n) * limit), NEVER)
    tasks["changes_to"] = rng.integers(0, 2, n)


def draw_operators(operators, scenario, rng) -> None:
    """Profiles go round robin; two operators are one generalist and one specialist, drawn per mission."""
    rules, n = scenario.operators, len(operators)
    profiles = [rules.generalist, rules.uav_specialist, rules.ugv_specialist]
    if n == 2:
        profiles = [rules.generalist, profiles[1 + rng.integers(2)]]
    for h, operator in enumerate(operators):
        operator["proficiency"] = profiles[h % len(profiles)]
    operators["capacity"] = rng.uniform(*rules.capacity, n)
    operators["tokens"] = scenario.communication.bucket
    operators["due"] = 1


@kernel
def open_missions(missions, rows, utilities):
    """Announce the first tasks, let robots look around, and rate first targets by public information.

    Args:
      rows: [T] TASK_SEEN scratch.
      utilities: [E, R, T] is filled; 0 where a robot cannot service a task.
    """
    for e in range(missions.shape[0]):
        m = missions[e]
        release_and_change(m, 0)
        look_around(m, 0)
        for r in range(m.n_robots):
            robot = true_robot(m, r)
            observe_tasks(m, r, True, rows)
            for j in range(m.n_tasks):
                row = rows[j]
                utilities[e, r, j] = 0.0
                if row.released and is_compatible(robot.embodiment, true_task(m, j).announced):
                    speed = m.rules.speed[0, robot.embodiment]
                    utilities[e, r, j] = expected_utility(
                        m.rules, row.distance, speed, row.difficulty, row.value, row.deadline, row.decay, 0.0
                    )


@kernel
def assign_first_targets(missions, targets):
    """Send every robot to its first target [E, R] (NOBODY: none), prescribed until it ends."""
    for e in range(missions.shape[0]):
        m = missions[e]
        for r in range(m.n_robots):
            if targets[e, r] != NOBODY:
                take_task(m, r, targets[e, r])
                true_robot(m, r).prescribed = m.rules.initial_phase_end > 0
        log_tick(m)


def initialize(state) -> None:
    """The initializer: once, first targets by optimal assignment on public information (docs/benchmark.md, section 8)."""
    e, r = state.robots.shape
    utilities = np.empty((e, r, state.tasks.shape[1]))
    open_missions(state.missions, np.empty(utilities.shape[2], TASK_SEEN), utilities)
    targets = np.full((e, r), NOBODY, np.int32)
    for mission, table in enumerate(utilities):
        robots, tasks = linear_sum_assignment(table, maximize=True)
        worthwhile = (table[robots, tasks] > 0) & (state.missions["rules"]["picks_first"][mission] == 0)
        targets[mission, robots[worthwhile]] = tasks[worthwhile]
    assign_first_targets(state.missions, targets)
