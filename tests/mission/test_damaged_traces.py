"""Trace files that went wrong: a ValueError that names the file, never another exception, and never other numbers."""

import dataclasses
import io
import json
import os

import numpy as np
import pytest

from commhg_mj.base.terms import Fate, Kind
from commhg_mj.mission.trace import ARRAYS, load_trace, make_traces, save_trace
from commhg_mj.policies import prepare
from commhg_mj.scenarios import from_dict

TINY = from_dict({"base": "small", "name": "tiny", "n_tasks": 6, "time_limit": 90})


@pytest.fixture(scope="module")
def flight():
    """(trace, score) of a mission with messages of every kind."""
    batch, policy = prepare("random", TINY, [3], record=True)
    observations = batch.observations
    while not batch.over.all():
        observations = batch.step(policy(observations))
    return make_traces(batch, "random")[0], batch.scores()[0]


@pytest.fixture(scope="module")
def trace(flight):
    return flight[0]


@pytest.fixture(scope="module")
def content(trace, tmp_path_factory):
    path = tmp_path_factory.mktemp("trace") / "good.npz"
    save_trace(trace, path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def columns(content):
    with np.load(io.BytesIO(content)) as file:
        return {name: file[name] for name in file.files}


def is_same(one, other):
    """Whether two traces agree in every value, type and shape."""

    def same(a, b):
        if isinstance(a, np.ndarray):
            return a.dtype == b.dtype and np.array_equal(a, b)
        if isinstance(a, dict):
            return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
        return a == b

    return all(same(getattr(one, field.name), getattr(other, field.name)) for field in dataclasses.fields(one))


def refuses(path, content):
    """Whether a file with that content is refused by name; any other exception is an error."""
    path.write_bytes(content)
    try:
        found = load_trace(path)
    except ValueError as error:
        assert str(path) in str(error) and "\n" not in str(error)
        return True
    return found


def packed(**columns):
    file = io.BytesIO()
    np.savez(file, **columns)
    return file.getvalue()


def test_scores_come_out_of_the_file_bit_for_bit(flight, content, tmp_path):
    trace, score = flight
    (tmp_path / "t.npz").write_bytes(content)
    for each in (trace, load_trace(tmp_path / "t.npz")):
        assert each.twcr() == score.twcr == each.twcr_until(each.ticks)
        assert each.twcr_until(-0.5) == 0.0
        mission, coordination = each.reward.sum(axis=0)
        assert (mission, coordination) == pytest.approx((score.reward_mission, score.reward_coordination), rel=1e-12)
        assert (np.mean(each.task_done >= 0), each.ticks) == (score.completion, score.duration)


def test_messages_in_the_file_are_those_of_the_score(flight):
    trace, score = flight
    for kind in Kind:
        rows, counts = trace.message_kind == kind, score.messages[kind.name.lower()]
        sent = rows & (trace.message_sent >= 0)
        assert counts["attempted"] == rows.sum() and counts["sent"] == sent.sum()
        assert counts["bytes"] == trace.message_bytes[sent].sum() and counts["late"] == trace.message_late[rows].sum()
        for fate in Fate:
            assert counts[fate.name.lower()] == np.sum(trace.message_fate[rows] == fate), (kind, fate)
        arrived = rows & (trace.message_fate == Fate.DELIVERED)
        latency = (trace.message_ended - trace.message_sent)[arrived]
        assert counts["mean_latency"] == pytest.approx(latency.mean() if len(latency) else 0.0)
    assert sum(counts["attempted"] > 0 for counts in score.messages.values()) >= 5, "a flight worth the test"


def test_times_of_messages_are_in_order(trace):
    queued, sent, ended, fate = (getattr(trace, f"message_{name}") for name in ("queued", "sent", "ended", "fate"))
    assert np.all(np.diff(queued) >= 0) and np.all(queued >= 0)
    assert np.any(fate == Fate.UNDERWAY) and np.all(ended[fate == Fate.UNDERWAY] == trace.ticks), "the mission ended"
    assert np.all((sent < 0) | (sent >= queued)) and np.all(ended >= np.maximum(queued, sent))
    assert np.all(sent[fate == Fate.DELIVERED] < ended[fate == Fate.DELIVERED])
    assert ended.max() <= trace.ticks


def test_an_unfinished_mission_can_be_kept(tmp_path):
    batch, policy = prepare("greedy", TINY, [0], record=True)
    for _ in range(3):
        (trace,) = make_traces(batch, "greedy")
        save_trace(trace, tmp_path / "t.npz")
        assert trace.ticks == batch.time[0] and is_same(load_trace(tmp_path / "t.npz"), trace)
        batch.step(policy(batch.observations))


def test_a_trace_is_the_same_alone_and_in_a_batch(trace):
    batch, policy = prepare("random", TINY, [9, 3, 1], record=True)
    while not batch.over.all():
        batch.step(policy(batch.observations))
    assert is_same(make_traces(batch, "random")[1], trace)


@pytest.mark.slow
def test_a_large_trace_of_the_most_talkative_policy_stays_small(tmp_path):
    """Random asks and broadcasts all the time; Greedy is in test_trace.py."""
    batch, policy = prepare("random", "large", [0], record=True)
    while not batch.over.all():
        batch.step(policy(batch.observations))
    save_trace(make_traces(batch, "random")[0], tmp_path / "t.npz")
    assert (tmp_path / "t.npz").stat().st_size < 3e6


@pytest.mark.parametrize("mask", [0x01, 0xFF])
def test_no_byte_can_change_anything_unnoticed(content, trace, tmp_path, mask):
    """Anywhere in the archive, and at every byte of its directory, which no checksum protects."""
    directory, rng = content.index(b"PK\x01\x02"), np.random.default_rng(mask)
    inside = rng.integers(0, directory, 100)
    table = range(directory + mask % 13, len(content), 13)
    n_refused = 0
    for at in [*inside, *table, *range(len(content) - 22, len(content))]:
        found = refuses(tmp_path / "t.npz", content[:at] + bytes([content[at] ^ mask]) + content[at + 1 :])
        assert found is True or is_same(found, trace), f"byte {at} of {len(content)}"
        n_refused += found is True
    assert n_refused > 100


def test_no_truncated_file_is_a_trace(content, tmp_path):
    for length in [*range(0, len(content), len(content) // 60), *range(len(content) - 25, len(content))]:
        assert refuses(tmp_path / "t.npz", content[:length]) is True, length


def variants(column):
    """The same column in other shapes and types."""
    yield "scalar", np.zeros((), column.dtype)
    yield "longer axis", column[..., None]
    yield "text", np.full(column.shape, "a")
    yield "complex", column.astype(complex)
    yield "empty", column[:0]
    yield "a row less", column[:-1]
    if column.ndim > 1:
        yield "transposed", column.T
        yield "flat", column.ravel()


@pytest.mark.parametrize("name", [*ARRAYS, "record_belief_progress", "record_peer_x", "record_resource_tokens"])
def test_every_column_must_fit(columns, tmp_path, name):
    for what, column in variants(columns[name]):
        if column.shape != columns[name].shape or column.dtype != columns[name].dtype:
            assert refuses(tmp_path / "t.npz", packed(**{**columns, name: column})) is True, what
    others = {key: value for key, value in columns.items() if key != name}
    assert refuses(tmp_path / "t.npz", packed(**others)) is True, "missing"


@pytest.mark.parametrize(
    "name, values",
    [
        ("magic", ["", "other", 1, [1, 2]]),
        ("format", [0, 1, "x", 2.5, [2, 2]]),
        ("seed", [-1, 1.5, "x", [1, 2], 1j, float("nan")]),
        ("links", ["", "laser", 3]),
        ("limitation", ["", "extreme"]),
        ("scenario", ["", "{", "[]", "3", "null", "{}", '{"n_uav": [1]}', '{"x": 1}', "[" * 100_000, '{"world": 3}']),
    ],
)
def test_every_setting_must_fit(columns, tmp_path, name, values):
    for value in values:
        assert refuses(tmp_path / "t.npz", packed(**{**columns, name: value})) is True, value


def test_the_trace_of_another_team_does_not_fit(columns, tmp_path):
    table = json.loads(str(columns["scenario"]))
    for changes in ({"n_uav": 3}, {"n_tasks": 7}, {"n_operators": 1}):
        changed = {**columns, "scenario": json.dumps(table | changes)}
        assert refuses(tmp_path / "t.npz", packed(**changed)) is True


class Bomb:
    """What runs when somebody unpickles it."""

    def __init__(self, marker):
        self.marker = marker

    def __reduce__(self):
        return os.mkdir, (str(self.marker),)


def test_pickles_are_refused_and_not_opened(columns, tmp_path):
    payload = np.array([Bomb(tmp_path / "ran")], dtype=object)
    for name in ("robot_xy", "magic", "unknown"):
        assert refuses(tmp_path / "t.npz", packed(**{**columns, name: payload})) is True
    alone = io.BytesIO()
    np.save(alone, payload, allow_pickle=True)
    assert refuses(tmp_path / "t.npy", alone.getvalue()) is True
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError(), OSError(28, "No space left on device")])
def test_a_failing_write_leaves_the_old_trace(trace, tmp_path, monkeypatch, error):
    def fail(file, **arrays):
        file.write(b"half")
        raise error

    path = tmp_path / "t.npz"
    save_trace(trace, path)
    old = path.read_bytes()
    monkeypatch.setattr("commhg_mj.mission.trace.np.savez_compressed", fail)
    with pytest.raises(ValueError if isinstance(error, OSError) else type(error)):
        save_trace(trace, path)
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == {"t.npz": old}
