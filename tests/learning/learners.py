"""Helpers of the learning tests: ragged graphs by hand, tiny runs, networks without convenient zeros."""

from typing import NamedTuple

import numpy as np
import pytest
import torch
from strategies import change

from commhg_mj.base.terms import KEEP
from commhg_mj.learning.distributed import ALONE
from commhg_mj.learning.features import OPERATOR, PAST, PEER, PUBLIC, REPORT, RESOURCE, ROBOT, TASK_EDGE
from commhg_mj.learning.graphs import OperatorGraphs, RobotGraphs
from commhg_mj.learning.ppo import Hyper
from commhg_mj.learning.registry import METHODS, find_method
from commhg_mj.learning.rollout import Experience
from commhg_mj.learning.state_features import STATE_MISSION, STATE_OPERATOR, STATE_ROBOT, STATE_TASK
from commhg_mj.learning.states import States
from commhg_mj.learning.train import Plan, Training
from commhg_mj.scenarios import SCENARIOS

torch.set_num_threads(1)
find_method("commhg")  # fills the registry
NAMES = sorted(METHODS)
# What takes long is tried by default on one method of each family: relatives of CommHG share its code and are slow tests.
RELATIVES = {name for name in NAMES if issubclass(METHODS[name], METHODS["commhg"])} - {"commhg"}
FAMILIES = [pytest.param(name, marks=pytest.mark.slow if name in RELATIVES else ()) for name in NAMES]
SHORT = change(SCENARIOS["small"], time_limit=40, n_tasks=10, forest_share=0.0, mountain_share=0.0)
QUICK = Hyper(decisions=160, minibatches=2, epochs=1)


def run(folder, method="commhg", scenario=SHORT, hyper=QUICK, device="cpu", group=ALONE, **options):
    """A tiny training; missions end within two updates."""
    options = {"side_by_side": 6, "missions": 1000, "first_updates": 1, **options}
    return Training(Plan(method, scenario, hyper=hyper, **options), folder, group=group, device=device)


def updated(training, n):
    for _ in range(n):
        training.update()
    return training


def shaken(module, seed=0, scale=0.3):
    """The module with noise on every parameter: biases are no longer zero, nor heads nearly so."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter += scale * torch.randn(parameter.shape, generator=generator) / max([1, *parameter.shape[-1:]]) ** 0.5
    return module


class Row(NamedTuple):
    """What is open to one robot."""

    tasks: tuple = ()  # legal, a task edge each
    keep: bool = True
    idle: bool = True
    gate: bool = True
    query: tuple = (True, True)  # an operator each
    assist: bool = True
    n_peers: int = 0
    own: int = -1  # which of its edges is the held task


def random_row(rng, n_operators=2):
    keep, idle = rng.random(2) < 0.6
    tasks = tuple(rng.random(rng.integers(0, 4)) < 0.6)
    query = tuple(rng.random(n_operators) < 0.6)
    return Row(tasks, keep, idle or not keep, rng.random() < 0.6, query, rng.random() < 0.6, int(rng.integers(0, 3)))


def robot_graphs(rows, n_tasks=5, seed=0, n_past=0) -> RobotGraphs:
    """Graphs of random features with these masks, all of mission 0."""
    rng = np.random.default_rng(seed)
    counts, peers = [len(row.tasks) for row in rows], [row.n_peers for row in rows]
    task_ptr, peer_ptr = (np.concatenate([[0], np.cumsum(column)]).astype(np.int64) for column in (counts, peers))
    n, n_edges, n_operators = len(rows), task_ptr[-1], len(rows[0].query)
    noise = lambda *shape: rng.normal(size=shape).astype(np.float32)
    task = np.concatenate([rng.permutation(n_tasks)[:count] for count in counts]).astype(np.int64)
    own = np.array([start + row.own if row.own >= 0 else -1 for start, row in zip(task_ptr, rows)], np.int64)
    return RobotGraphs(
        noise(n, ROBOT.width), task_ptr, task, noise(n_edges, TASK_EDGE.width),
        np.concatenate([np.array(row.tasks, bool) for row in rows]), own, peer_ptr, noise(peer_ptr[-1], PEER.width),
        rng.integers(0, 3, peer_ptr[-1]), rng.integers(-1, n_tasks, peer_ptr[-1]), noise(peer_ptr[-1], n_past, PAST.width),
        noise(n, n_operators, RESOURCE.width), np.array([[row.keep, row.idle] for row in rows]),
        np.array([row.gate for row in rows]), np.array([row.query for row in rows], bool).reshape(n, n_operators),
        np.array([row.assist for row in rows]), np.zeros(n, np.int64), np.arange(n),
        np.zeros((n, 0), np.float32), np.zeros((n_edges, 0), np.float32),
    )  # fmt: skip


def operator_graphs(k, n_robots, seed=0, known=0.6, n_past=0) -> OperatorGraphs:
    """Graphs of random features; each operator holds robot 0."""
    rng = np.random.default_rng(seed)
    noise = lambda *shape: rng.normal(size=shape).astype(np.float32)
    known = rng.random((k, n_robots)) < known
    report = noise(k, n_robots, REPORT.width) * known[..., None]
    return OperatorGraphs(
        noise(k, OPERATOR.width), report, known, np.ones((k, n_robots), bool), np.ones((k, 2), bool), np.zeros(k, np.int64),
        noise(k, n_robots, n_past, PAST.width), np.zeros(k, np.int64), np.arange(k),
        np.full(k, KEEP),
    )  # fmt: skip


def random_public(n_tasks=5, seed=0):
    return torch.from_numpy(np.random.default_rng(seed).normal(size=(n_tasks, PUBLIC.width)).astype(np.float32))


def random_states(s, n_robots=3, n_operators=2, n_tasks=4, seed=0) -> States:
    rng = np.random.default_rng(seed)
    shapes = (s, n_robots, STATE_ROBOT.width), (s, n_operators, STATE_OPERATOR.width), (s, n_tasks, STATE_TASK.width)
    robot, operator, task = (rng.normal(size=shape).astype(np.float32) for shape in shapes)
    is_open = rng.random((s, n_tasks)) < 0.6
    return States(robot, operator, task, is_open, rng.normal(size=(s, STATE_MISSION.width)).astype(np.float32))


def experience(rows, robot_choices, robot_advantage, operator_choices=(), operator_advantage=()) -> Experience:
    """Hand-made experience of one mission: robots' rows, then operators' with three robots each, a state each."""
    n, k = len(rows), len(operator_choices)
    public = random_public().numpy()[None]
    graphs = robot_graphs(rows)._replace(robot=np.zeros(n, np.int64))
    robot_advantage = np.asarray(robot_advantage, float).reshape(n, 2)
    operator_advantage = np.asarray(operator_advantage, float).reshape(k, 2)
    operators = operator_graphs(k, 3)._replace(operator=np.zeros(k, np.int64))
    # Made by indifferent logits: gate and query have two choices each, operators three that are not -50.
    log_prob = np.array([np.log(0.5) * (row.gate + any(row.query)) for row in rows], np.float32)
    free = np.array([row.gate or any(row.query) for row in rows], bool)
    return Experience(
        random_states(max(n, k)), graphs, operators, public, robot_choices, np.array(operator_choices, np.int64),
        np.arange(n), np.arange(k), (log_prob, np.full(k, np.log(1 / 3), np.float32)), (free, np.ones(k, bool)),
        (robot_advantage, operator_advantage), (robot_advantage, operator_advantage),
    )  # fmt: skip


def same_bits(one, other) -> bool:
    """Whether two trainings stand at the same bits: networks, optimiser, missions under way, random numbers."""
    states = [
        [t.method.state_dict(), t.learner.optimizer.state_dict(), t.collector.state_dict(), t.rng.bit_generator.state]
        for t in (one, other)
    ]
    return one.updates == other.updates and one.decisions == other.decisions and _equal(*states)


def _equal(a, b) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_equal(a[name], b[name]) for name in a if name not in POINTERS)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(_equal, a, b))
    return torch.equal(a, b) if isinstance(a, torch.Tensor) else a == b


POINTERS = {"missions"}  # the array that holds addresses of memory; the others hold everything that moves
