"""What methods may and may not read: unheard records, forbidden columns, hidden truth; and what each costs."""

import numpy as np
import pytest
import torch
from flying import Wanderer, copied, fly
from learners import NAMES, SHORT, run, shaken
from strategies import change

from commhg_mj.learning import features
from commhg_mj.learning.batches import operator_batch, robot_batch
from commhg_mj.learning.graphs import GraphBuilder
from commhg_mj.learning.method_table import HEAD, method_rows
from commhg_mj.learning.methods.mappo import N_TASKS, read_robot
from commhg_mj.learning.registry import METHODS
from commhg_mj.learning.rollout import Actors, value_agents
from commhg_mj.learning.states import States
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.observe import UNKNOWN

every_method = pytest.mark.parametrize("name", NAMES)
HEARS_ALL = [name for name in NAMES if METHODS[name].wants.every_record]
LONG = change(SHORT, time_limit=200, released_at_start=0.5)


def untrained(name):
    torch.manual_seed(0)
    return shaken(METHODS[name](), scale=1.0)


@pytest.fixture(scope="module")
def batch():
    return fly(MissionBatch(LONG, range(6)), Wanderer(restless=0.3), seconds=60)


@torch.no_grad()
def said(method, batch, seen):
    """Logits of all robots' tasks and queries, and of operators."""
    builder = GraphBuilder(batch, method.wants)
    _, logits = Actors(method, builder).score(builder.robots(seen), builder.public(batch.state.tasks))
    operators = builder.operators(seen)
    legal = torch.from_numpy(np.concatenate([operators.keep_rest, operators.legal], axis=1))
    picks = torch.where(legal, method.operator(operator_batch(operators)), 0.0)
    return [part for part in (*logits, picks) if part is not None]


def same(one, other):
    return all(map(torch.equal, one, other))


@every_method
@pytest.mark.parametrize("table", ["robot_peers", "robot_operators", "operator_reports"])
def test_what_an_unheard_record_holds_leaves_the_output_unchanged(batch, name, table):
    method, seen, rng = untrained(name), copied(batch.observations), np.random.default_rng(0)
    rows = getattr(seen, table)
    rows["age"][:, ::2] = UNKNOWN
    if table == "operator_reports":
        rows["legal"][rows["age"] < 0] = 0
    other = rows.copy()
    for field in rows.dtype.names:
        if field not in ("age", "legal", "embodiment"):  # the roster is public
            other[field][rows["age"] < 0] = rng.integers(0, 2, (rows["age"] < 0).sum())
    assert same(said(method, batch, seen), said(method, batch, seen._replace(**{table: other})))


@pytest.mark.parametrize("name", HEARS_ALL)
@pytest.mark.parametrize("table", ["robot_peers", "operator_reports"])
def test_without_connectivity_an_unheard_record_counts_by_its_presence(batch, name, table):
    """Who was never heard of sends a message of zeros: of another embodiment, another one."""
    method, seen = untrained(name), copied(batch.observations)
    rows = getattr(seen, table)
    rows["age"][:, ::2] = UNKNOWN
    other = rows.copy()
    other["embodiment"][rows["age"] < 0] = 1 - rows["embodiment"][rows["age"] < 0]
    assert not same(said(method, batch, seen), said(method, batch, seen._replace(**{table: other})))


@pytest.mark.parametrize("name", [name for name in NAMES if name not in HEARS_ALL])
def test_who_was_never_heard_of_does_not_count_elsewhere(batch, name):
    method, seen = untrained(name), copied(batch.observations)
    seen.robot_peers["age"][:, ::2] = UNKNOWN
    other = seen.robot_peers.copy()
    other["embodiment"][:, ::2] = 1 - other["embodiment"][:, ::2]
    assert same(said(method, batch, seen), said(method, batch, seen._replace(robot_peers=other)))


FORBIDDEN = {
    features.TASK_EDGE: ("age_known", "age_short", "age_long", "claim_short", "claim_long"),
    features.PEER: ("age_known", "age_short", "age_long"),
    features.RESOURCE: ("age_known", "age_short", "age_long", "availability"),
    features.ROBOT: ("availability",),
    features.REPORT: (
        "age_known", "age_short", "age_long", "request_short", "request_long", "task_known", "task_short", "task_long",
    ),
    features.OPERATOR: ("availability",),
}  # fmt: skip


@torch.no_grad()
def heard(method, batch, change_columns):
    """What a method says of graphs whose columns were changed by hand."""
    builder = GraphBuilder(batch, method.wants)
    seen = batch.observations
    robots, operators = builder.robots(seen), builder.operators(seen)
    tables = {
        features.ROBOT: robots.itself, features.TASK_EDGE: robots.task_edge, features.PEER: robots.peer_edge,
        features.RESOURCE: robots.resource, features.REPORT: operators.report, features.OPERATOR: operators.itself,
    }  # fmt: skip
    for group, names in change_columns.items():
        columns = group.columns(*names)
        tables[group][..., columns] = np.random.default_rng(0).random(tables[group][..., columns].shape)
    public = builder.public(batch.state.tasks)
    logits = method.robot(robot_batch(robots, public.shape[1]), torch.from_numpy(public.reshape(-1, public.shape[2])))
    return [part for part in (*logits, method.operator(operator_batch(operators))) if part is not None]


def test_informarl_reads_no_ages_no_knowledge_and_not_who_has_room(batch):
    method = untrained("informarl")
    before = heard(method, batch, {})
    assert same(before, heard(method, batch, FORBIDDEN))
    for group, names in {features.TASK_EDGE: ("progress",), features.PEER: ("dx",), features.REPORT: ("gain",)}.items():
        assert not same(before, heard(method, batch, {group: names})), "the check above can fail"
    assert not same(heard(untrained("commhg"), batch, {}), heard(untrained("commhg"), batch, FORBIDDEN))


def test_nocomm_blind_reads_no_ages_on_its_edges(batch):
    ages = {group: ("known", "age") for group in (features.TASK_EDGE, features.PEER, features.RESOURCE, features.REPORT)}
    blind, sees = untrained("nocomm-blind"), untrained("commhg-nocomm")
    assert same(heard(blind, batch, {}), heard(blind, batch, ages))
    assert not same(heard(sees, batch, {}), heard(sees, batch, ages))


@pytest.mark.parametrize("name", [name for name in NAMES if METHODS[name]().critic.reads == "local"])
def test_a_local_critic_does_not_see_the_truth(tmp_path, name):
    """What its actor reads decides its values; the true state of others, which the central critic reads, does not."""
    training = run(tmp_path, name, LONG)
    data = training.collector.collect(100, training.method.critic, training.method.scale, 0.99, 0.95)
    training.method.scale.update(0, torch.randn(50, 2)), training.method.scale.update(1, torch.randn(50, 2))
    shaken(training.method.critic)
    agents = (data.robot_state, data.robots.robot), (data.operator_state, data.operators.operator)
    value = lambda critic, states: value_agents(
        critic, training.method.scale, states, *agents, data.robots, data.operators, data.public
    )
    other = States(*(1.0 - part if part.dtype != bool else ~part for part in data.states))
    local, central = training.method.critic, shaken(METHODS["mappo"]().critic)
    assert all(map(np.array_equal, value(local, data.states), value(local, other)))
    assert not any(map(np.array_equal, value(central, data.states), value(central, other)))
    assert all(np.std(values) > 0 for values in value(local, data.states))


def test_to_observe_everyone_is_to_observe_whoever_is_due_and_the_others(batch):
    truth, seen = copied(batch.state), batch.observations
    everyone = batch.observe_everyone()
    assert len(everyone.robots) == (~batch.over).sum() * LONG.n_robots and len(everyone.operators) % LONG.n_operators == 0
    for mine, all_, key in ((seen.robots, everyone.robots, "robot"), (seen.operators, everyone.operators, "operator")):
        where = [np.flatnonzero((all_["mission"] == row["mission"]) & (all_[key] == row[key]))[0] for row in mine]
        assert np.array_equal(all_[where], mine)
    assert all(np.array_equal(a, b) for a, b in zip(truth, batch.state)) and batch.observations is seen


def test_a_list_takes_the_most_useful_in():
    """The best tasks, the own one first; the own operator, then whoever is free; all that is left out is never chosen."""
    batch = fly(MissionBatch(change(SHORT, n_tasks=40, released_at_start=1.0, time_limit=200), range(3)), Wanderer(), seconds=30)
    builder = GraphBuilder(batch)
    graphs = robot_batch(builder.robots(batch.observations), 40)
    _, picked = read_robot(graphs)
    rate = graphs.task_edge[:, features.TASK_EDGE.index("value_rate")]
    wanted = graphs.task_legal | (graphs.task_edge[:, features.TASK_EDGE.index("is_held")] > 0)
    for row, edges in enumerate(picked):
        mine = torch.arange(graphs.task_ptr[row], graphs.task_ptr[row + 1])
        order = sorted(mine.tolist(), key=lambda edge: (not wanted[edge], -rate[edge].item()))
        assert [edge for edge in edges.tolist() if edge >= 0] == order[:N_TASKS]
    method = untrained("mappo")
    public = torch.from_numpy(builder.public(batch.state.tasks).reshape(-1, features.PUBLIC.width))
    with torch.no_grad():
        score = method.robot(graphs, public).task
    left_out = ~torch.isin(torch.arange(len(score)), picked)
    assert left_out.any() and (score[left_out] < -50).all() and (score[~left_out] >= -10).all()


def test_the_table_of_methods_is_that_of_the_docs_and_no_method_is_half_or_twice_commhg(script):
    script = script("methods")
    rows = method_rows()
    assert [row[0] for row in rows] == NAMES and len(HEAD) == len(rows[0])
    assert script.table() in script.PAGE.read_text(encoding="utf-8"), "run python scripts/methods.py"
    assert all(all(cells) for cells in rows), "a method that comes with the package says what it is"
    shares = {row[0]: float(row[-1]) for row in rows}
    assert all(0.5 <= share <= 2.0 for share in shares.values()), shares
