"""Features by name: each is read from what its row of the table says, and the page shows the table."""

import numpy as np
import pytest
from flying import Wanderer, copied, fly
from learners import SHORT
from strategies import change

from commhg_mj.learning import features
from commhg_mj.learning.features import KINDS, columns_of
from commhg_mj.learning.graphs import GraphBuilder
from commhg_mj.learning.state_features import ALL_GROUPS as GROUPS
from commhg_mj.mission import state
from commhg_mj.mission.batch import MissionBatch

TABLES = {  # of observations: whose rows they are, and the groups that are read from them
    "robot_tasks": ("robot", features.TASK_EDGE, "task_edge"),
    "robot_peers": ("robot", features.PEER, "peer_edge"),
    "robot_operators": ("robot", features.RESOURCE, "resource"),
    "operator_reports": ("operator", features.REPORT, "report"),
}
LARGEST = {"status": 1, "claimed_by": 3, "task": 9, "robot": 3, "operator": 1, "queue": 9}  # of whole numbers; others: 2
LOWEST = {"claimed_by": -1, "task": -1, "controller": -1}
EDGES_HANG_ON = {"released", "legal", "mission"}
AGES = {"age", "claim_age", "request_age", "task_age"}


def drawn(table, name, rng):
    """Other values for a column: ages are known, shares shares, names of others names."""
    old = table[name]
    if old.dtype.kind == "f":
        return (rng.uniform(0.05, 1.0, old.shape) * max(1.0, np.abs(old).max())).astype(old.dtype)
    is_flag = name.startswith(("can_", "prescribed", "refused", "exempt", "compatible", "embodiment")) or name.endswith("waits")
    return rng.integers(LOWEST.get(name, 0), LARGEST.get(name, 1 if is_flag else 2) + 1, old.shape).astype(old.dtype)


@pytest.fixture(scope="module")
def seen():
    """(builder, observations in which everything is known and every value occurs)."""
    batch = fly(MissionBatch(change(SHORT, time_limit=200), range(40)), Wanderer(restless=0.3), seconds=30)
    rng, seen = np.random.default_rng(0), copied(batch.observations)
    for table in seen:
        for name in sorted(set(table.dtype.names) - EDGES_HANG_ON - {"time"}):
            table[name] = drawn(table, name, rng)
    return GraphBuilder(batch), seen


def read(builder, seen):
    """{group: its columns} of all graphs."""
    robots, operators = builder.robots(seen), builder.operators(seen)
    found = {features.ROBOT: robots.itself, features.OPERATOR: operators.itself}
    return found | {group: getattr(robots if owner == "robot" else operators, name) for owner, group, name in TABLES.values()}


def named(group, source):
    return {feature.name for feature in group.features if source in feature.source.split()}


@pytest.mark.parametrize("table", ["robots", "operators", *TABLES])
def test_a_feature_is_read_from_the_columns_that_it_names_and_no_other(seen, table):
    builder, seen = seen
    owner, own, _ = TABLES.get(table, (table.removesuffix("s"), None, None))
    own = own or {"robots": features.ROBOT, "operators": features.OPERATOR}[table]
    rows, rng, before = getattr(seen, table), np.random.default_rng(1), read(builder, seen)
    for name in sorted(set(rows.dtype.names) - EDGES_HANG_ON):
        other = rows.copy()
        other[name] = drawn(rows, name, rng)
        after = read(builder, seen._replace(**{table: other}))
        for group in before:
            moved = (before[group] != after[group]).reshape(-1, group.width).any(axis=0)
            changed = {group.names[i] for i in np.flatnonzero(moved)}
            changed |= {f"{name.removesuffix('_long')}_known" for name in changed if name.endswith("_long")}  # all are known
            is_beside = table in ("robots", "operators") and group in [g for o, g, _ in TABLES.values() if o == owner]
            wanted = named(group, name) if group is own else named(group, f"{owner}.{name}") if is_beside else set()
            assert changed == wanted, (name, group.title)


def test_public_features_and_the_critics_name_columns_of_the_state():
    of_state = "robot", "operator", "task", "mission", "belief", "peer", "waiting", "message"
    records = {name: getattr(state, name.upper()).names for name in of_state}
    for group in (features.PUBLIC, *(group for group in GROUPS if group.title.startswith("state: "))):
        of = group.title.removeprefix("state: ").partition(",")[0]
        for feature in group.features:
            for source in feature.source.split():
                row, _, column = source.rpartition(".")
                assert column in records[row or of], (group.title, feature)


def test_every_feature_has_one_name_and_one_kind():
    assert len({group.title for group in GROUPS}) == len(GROUPS)
    for group in GROUPS:
        assert len(set(group.names)) == group.width and not set(group.names) & set(KINDS)
        assert all(feature.kind in KINDS and all(feature) for feature in group.features)
        assert (group.dtype.names, group.dtype.itemsize) == (tuple(group.names), 4 * group.width)


def test_ages_and_knownness_are_found_by_their_kinds():
    for group in GROUPS:
        from_ages = [i for i, f in enumerate(group.features) if AGES & {word.rpartition(".")[2] for word in f.source.split()}]
        assert sorted(group.columns("known", "age")) == from_ages
    assert features.RESOURCE.columns("availability") == list(range(3, 9))
    rest = set(range(features.PEER.width)) - set(features.PEER.columns("known", "age", "availability"))
    assert [features.PEER.names[i] for i in sorted(rest)] == features.PEER.names[:-3]


def test_columns_by_name():
    assert features.ROBOT.index("time") == 26 and features.ROBOT.columns("time", "x", "mask", "time") == [26, 2, 22, 23, 24, 25]
    assert features.PEER.columns("dx", "dy", "known", "age") == [2, 3, 13, 14, 15], "docs/features.md shows it"
    with pytest.raises(ValueError, match="features of peer to robot: there is no 'tokens'"):
        features.PEER.columns("dx", "tokens")
    with pytest.raises(ValueError, match="there is no 'known'"):
        features.PEER.index("known")


def test_records_and_columns_are_one_memory():
    records = features.PEER.zeros(2, 3)
    table = columns_of(records)
    records["has_task"][1, 2] = 7.0
    assert table.shape == (2, 3, features.PEER.width) and table[1, 2, features.PEER.index("has_task")] == 7.0
    assert columns_of(features.PEER.zeros(0)).shape == (0, features.PEER.width)
    assert columns_of(features.PEER.zeros(4, 0)).shape == (4, 0, features.PEER.width)


def test_an_operator_sees_its_queue_and_what_the_station_believes_of_the_task(seen):
    builder, seen = seen
    rows, operators = seen.operator_reports.copy(), seen.operators.copy()
    rows["task"], rows["task_type"], rows["task_status"], rows["compatible"] = 0, 1, 2, 0
    rows["task_progress"], rows["task_age"], operators["queue"] = 0.5, 30.0, 4
    names = ("uav_only", "ugv_only", "general", "compatible", "task_serviced", "task_done", "task_progress")
    look = lambda: builder.operators(seen._replace(operator_reports=rows, operators=operators))
    graphs = look()
    assert np.all(graphs.report[..., features.REPORT.columns(*names)] == [0, 1, 0, 0, 0, 1, 0.5])
    ages = features.REPORT.columns("task_known", "task_short", "task_long")
    np.testing.assert_allclose(graphs.report[0, 0, ages], [1.0, np.exp(-1.0), np.exp(-0.15)], rtol=1e-6)
    np.testing.assert_allclose(graphs.itself[:, features.OPERATOR.index("queue")], np.tanh(1.0), rtol=1e-6)
    rows["task_age"] = -1.0
    assert np.all(look().report[..., ages] == 0.0)
    rows["task"] = -1
    assert np.all(look().report[..., features.REPORT.columns(*names, "has_task")] == 0.0)


def test_the_page_is_what_the_table_says(script):
    script = script("features")
    assert script.tables() in script.PAGE.read_text(encoding="utf-8"), "run python scripts/features.py"
