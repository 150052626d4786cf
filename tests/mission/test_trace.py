"""Traces: nothing is lost on the way to a file and back (damaged files: test_damaged_traces.py)."""

import dataclasses

import numpy as np
import pytest
from flying import Wanderer, flown, fly
from hypothesis import given, settings
from strategies import change, limitations, link_models, scenarios, seeds

from commhg_mj.base.terms import Activity, Fate, Kind, Session
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.recorder import SAMPLE_PERIOD
from commhg_mj.mission.trace import load_trace, make_traces, save_trace
from commhg_mj.policies import prepare
from commhg_mj.scenarios import SCENARIOS

SHORT = change(SCENARIOS["small"], time_limit=90)


@pytest.fixture(scope="module")
def trace():
    (trace,) = make_traces(flown(SHORT, [3], record=True), "wanderer")
    return trace


def assert_same(one, other):
    for field in dataclasses.fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype and np.array_equal(a, b), field.name
        elif field.name == "records":
            assert a.keys() == b.keys() and all(np.array_equal(a[key], b[key]) for key in a)
        else:
            assert a == b, field.name


@settings(max_examples=10)
@given(scenarios(), seeds, link_models, limitations)
def test_any_mission_survives_the_way_to_a_file_and_back(tmp_path_factory, scenario, seed, links, limitation):
    path = tmp_path_factory.mktemp("t") / "a.npz"
    batch = flown(scenario, [seed], Wanderer(seed % 99), links=links, limitation=limitation, record=True)
    (trace,) = make_traces(batch, "wanderer")
    save_trace(trace, path)
    assert_same(trace, load_trace(path))
    (score,) = batch.scores()
    assert trace.twcr() == pytest.approx(score.twcr) and trace.ticks == score.duration
    np.testing.assert_allclose(trace.reward.sum(axis=0), [score.reward_mission, score.reward_coordination], atol=1e-6)
    assert trace.message_bytes[trace.message_sent >= 0].sum() == score.bytes_sent
    for kind in Kind:
        fates = np.bincount(trace.message_fate[trace.message_kind == kind], minlength=len(Fate))
        assert [score.messages[kind.name.lower()][fate.name.lower()] for fate in Fate] == fates.tolist()
    assert np.sum(trace.robot_activity[-1] == Activity.FAILED) == score.malfunctions
    held = np.mean(trace.operator_session == Session.HELD) if scenario.n_operators else 0.0
    assert held == pytest.approx(score.control_time, abs=1.5 / max(1, score.duration) + 0.02)
    assert trace.link_quality.shape[0] == trace.ticks // SAMPLE_PERIOD + 1


def test_twcr_grows_with_completions_alone():
    batch, policy = prepare("greedy", "small", [1], record=True)
    (trace,) = make_traces(fly(batch, policy), "greedy")
    course = np.array([trace.twcr_until(t) for t in range(trace.ticks + 1)])
    assert course[0] == 0 and np.all(np.diff(course) >= 0) and course[-1] == trace.twcr() > 0
    assert set(np.flatnonzero(np.diff(course)) + 1) <= set(trace.task_done.astype(int))


def test_the_last_row_is_the_final_state(trace):
    state = flown(SHORT, [3], record=True).state
    assert np.array_equal(trace.robot_xy[-1, :, 0], state.robots["x"][0].astype(np.float32))
    assert np.array_equal(trace.operator_fatigue[-1], state.operators["fatigue"][0].astype(np.float32))
    assert np.array_equal(trace.task_changed_to, state.tasks["type"][0])
    assert np.array_equal(trace.task_type, state.tasks["announced"][0])


def test_a_batch_that_kept_no_log_has_no_trace():
    with pytest.raises(ValueError, match="record=True"):
        make_traces(MissionBatch(SHORT, [1]), "nobody")


def refused(path, match=None):
    with pytest.raises(ValueError, match=match) as error:
        load_trace(path)
    assert path.name in str(error.value) and "\n" not in str(error.value)


def test_what_is_no_trace_at_all_is_refused_by_name(tmp_path):
    refused(tmp_path / "missing.npz", "No such file")
    refused(tmp_path)
    for name, content in (("text.npz", b"hello"), ("empty.npz", b"")):
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name)
    np.save(tmp_path / "array.npy", np.arange(3))
    refused(tmp_path / "array.npy")
    np.savez(tmp_path / "pickled.npz", a=np.array([{}], object))
    refused(tmp_path / "pickled.npz")
