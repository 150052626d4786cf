"""Local graphs out of true observations: what is unknown leaves no mark, what is known does."""

import numpy as np
import pytest
from flying import Wanderer, copied, fly
from learners import NAMES, SHORT
from strategies import change

from commhg_mj.base.terms import NOBODY
from commhg_mj.learning.batches import join_robots, pick_robots
from commhg_mj.learning.features import TASK_EDGE
from commhg_mj.learning.graphs import GraphBuilder, RobotGraphs
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.observe import UNKNOWN
from commhg_mj.scenarios import SCENARIOS


@pytest.fixture(scope="module")
def batch():
    """Missions with late releases, in which much is known and much is not."""
    batch = MissionBatch(change(SHORT, time_limit=200, released_at_start=0.5), range(6))
    return fly(batch, Wanderer(restless=0.3), seconds=40)


def noisy(table, where, rng, kept=("legal", "released", "embodiment", "age", "claimed_by", "claim_age")):
    """The table with nonsense in every field of the rows `where`, but for those `kept`."""
    table = table.copy()
    for name in table.dtype.names:
        if name not in kept:
            table[name][where] = rng.integers(0, 3, where.sum())
    return table


def same(one, other):
    return [name for name, a, b in zip(one._fields, one, other) if not np.array_equal(a, b)]


@pytest.mark.parametrize("table", ["robot_tasks", "robot_peers", "robot_operators", "operator_reports"])
def test_unknown_records_leave_no_mark(batch, table):
    seen, rng, builder = copied(batch.observations), np.random.default_rng(0), GraphBuilder(batch)
    rows = getattr(seen, table)
    if table == "robot_tasks":
        unknown = rows["released"] == 0
    else:
        rows["age"][:, ::2] = UNKNOWN
        unknown = rows["age"] < 0
    assert unknown.any() and not unknown.all()
    for where, changes in ((unknown, False), (~unknown, True)):
        other = seen._replace(**{table: noisy(rows, where, rng)})
        found = same(builder.robots(seen), builder.robots(other)) + same(builder.operators(seen), builder.operators(other))
        assert bool(found) == changes, found


def test_edges_are_the_released_tasks_not_believed_done_and_the_peers_heard_of(batch):
    seen = batch.observations
    graphs = GraphBuilder(batch).robots(seen)
    for i, robot in enumerate(seen.robots):
        tasks = seen.robot_tasks[i]
        wanted = np.flatnonzero((tasks["released"] == 1) & (tasks["status"] != 2))
        edges = slice(graphs.task_ptr[i], graphs.task_ptr[i + 1])
        assert np.array_equal(graphs.task[edges], wanted)
        assert np.array_equal(graphs.task_legal[edges], tasks["legal"][wanted] == 1)
        assert graphs.task_legal[edges].sum() == tasks["legal"].sum(), "a legal task is missing"
        assert np.diff(graphs.peer_ptr)[i] == (seen.robot_peers[i]["age"] >= 0).sum()
        own = graphs.own_edge[i]
        assert (graphs.task[own] if own >= 0 else NOBODY) == (robot["task"] if robot["task"] in wanted else NOBODY)
        assert own < 0 or graphs.task_ptr[i] <= own < graphs.task_ptr[i + 1]


def test_every_feature_is_bounded_on_every_scale():
    for name in SCENARIOS:
        batch = fly(MissionBatch(change(SCENARIOS[name], time_limit=200), [1, 2]), Wanderer(restless=0.3), seconds=100)
        builder = GraphBuilder(batch)
        robots, operators = builder.robots(batch.observations), builder.operators(batch.observations)
        tables = robots.itself, robots.task_edge, robots.peer_edge, robots.resource, operators.itself, operators.report
        for table in (*tables, builder.public(batch.state.tasks)):
            assert np.isfinite(table).all() and np.abs(table).max(initial=0.0) <= 12, name


def test_the_public_table_is_that_of_the_mission_and_does_not_change(batch):
    fresh = MissionBatch(batch.scenario, batch.seeds)
    builder = GraphBuilder(batch)
    assert np.array_equal(builder.public(batch.state.tasks), GraphBuilder(fresh).public(fresh.state.tasks))


def test_rows_picked_out_of_joined_graphs_are_those_that_went_in(batch):
    builder, rng = GraphBuilder(batch), np.random.default_rng(0)
    parts = []
    wanderer = Wanderer()
    while len(parts) < 5:
        parts.append(builder.robots(batch.observations))
        batch.step(wanderer(batch.observations))
    joined = join_robots(parts)
    singles = [pick_robots(part, np.array([i]))[0] for part in parts for i in range(len(part.itself))]
    order = rng.permutation(len(singles))[:10]
    picked, shift = pick_robots(joined, order)
    assert same(picked, join_robots([singles[i] for i in order])) == []
    assert isinstance(picked, RobotGraphs) and np.array_equal(shift, picked.task_ptr[:-1] - joined.task_ptr[order])
    own = picked.own_edge >= 0
    held = picked.task_edge[picked.own_edge[own], TASK_EDGE.index("is_held")]
    assert own.any() and np.all(held == 1), "own_edge is not the held task's"


def test_names_of_methods_are_those_of_the_paper():
    assert {"commhg", "mappo", "ippo"} <= set(NAMES)
