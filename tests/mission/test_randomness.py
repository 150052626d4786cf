"""Same seed, same bits, wherever and with whomever a mission is flown; common random numbers between policies."""

import copy
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from flying import Wanderer, fingerprint, flown, fly, plain
from hypothesis import given, settings
from strategies import change, limitations, link_models, scenarios, seeds

import commhg_mj
from commhg_mj.base.terms import Fate, Kind, Mode, TaskType
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.randomness import Event, uniform
from commhg_mj.policies import POLICIES, prepare
from commhg_mj.scenarios import SCENARIOS

SHORT = change(SCENARIOS["small"], time_limit=150)


def flight(seeds, name="random", record=False):
    """The end of a flight: (state, log) fingerprints by seed."""
    batch, policy = prepare(name, SHORT, seeds, record=record)
    fly(batch, policy)
    marks = {}
    for e, seed in enumerate(seeds):
        marks[seed] = fingerprint(batch.state, slice(e, e + 1)), fingerprint(batch.log, slice(e, e + 1))
    return marks


@pytest.mark.parametrize("name", POLICIES)
def test_a_mission_is_the_same_alone_in_a_batch_and_in_another_order(name):
    together = flight([3, 9, 3**30, 0], name, record=True)
    assert flight([0, 3**30, 9, 3], name, record=True) == together
    for seed, mark in together.items():
        assert flight([seed], name, record=True)[seed] == mark
    assert len(set(together.values())) == len(together), "different seeds must differ"


def test_recording_changes_nothing():
    (with_log, _), (without, _) = flight([7], record=True)[7], flight([7])[7]
    batch = MissionBatch(SHORT, [7])
    assert batch.log.messages.shape[1] == 0
    assert with_log == without


def test_threads_share_nothing():
    alone = {**flight([1, 2]), **flight([3, 4])}
    with ThreadPoolExecutor(2) as pool:
        for _ in range(3):
            one, other = pool.map(flight, ([1, 2], [3, 4]))
            assert {**one, **other} == alone


def test_a_fresh_process_flies_the_same_bits():
    code = "from test_randomness import flight; print(flight([5, 6], 'greedy', True))"
    here = Path(__file__).parent
    folders = [str(here), str(here.parent), str(Path(commhg_mj.__file__).parents[1])]
    program = f"import sys; sys.path[:0] = {folders!r}; {code}"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip().splitlines()[-1] == str(flight([5, 6], "greedy", True))


@settings(max_examples=8)
@given(scenarios(), seeds, link_models, limitations)
def test_reset_flies_the_same_mission_again(scenario, seed, links, limitation):
    batch = MissionBatch(scenario, [seed], links, limitation)
    start = fingerprint(batch.state), fingerprint(batch.observations)
    first = fingerprint(fly(batch, Wanderer(1)).state)
    batch.reset()
    assert (fingerprint(batch.state), fingerprint(batch.observations)) == start
    assert fingerprint(fly(batch, Wanderer(1)).state) == first


@pytest.mark.parametrize("name", POLICIES)
def test_a_policy_made_before_a_reset_flies_the_same_mission_again(name):
    batch, policy = prepare(name, SHORT, [8])
    first = fingerprint(fly(batch, policy).state)
    batch.reset()
    assert fingerprint(fly(batch, policy).state) == first


def test_uniform_numbers_are_uniform_and_independent_of_each_argument():
    draws = np.array([uniform(1, 2, t, i, j) for t in range(40) for i in range(10) for j in range(10)])
    assert np.all((draws >= 0) & (draws < 1)) and len(np.unique(draws)) == len(draws)
    assert abs(draws.mean() - 0.5) < 4 * np.sqrt(1 / 12 / len(draws))
    share = np.histogram(draws, 10, (0, 1))[0] / len(draws)
    assert np.all(np.abs(share - 0.1) < 4 * np.sqrt(0.09 / len(draws)))
    base = (5, 3, 70, 2, 1)
    for k in range(5):
        other = tuple(value + (k == i) for i, value in enumerate(base))
        assert uniform(*other) != uniform(*base)
    pairs = np.array([(uniform(1, 0, t, 0, 1), uniform(1, 0, t + 1, 0, 1)) for t in range(4000)])
    assert abs(np.corrcoef(pairs.T)[0, 1]) < 4 / np.sqrt(len(pairs))


def two_policies(scenario, seed, **kwargs):
    """The same mission under a busy and under a calm policy."""
    return [flown(scenario, [seed], Wanderer(1, restless), **kwargs) for restless in (0.02, 0.8)]


@pytest.mark.parametrize("copy", [copy.deepcopy, lambda batch: pickle.loads(pickle.dumps(batch))])
def test_a_copy_of_a_batch_flies_on_by_itself(copy):
    batch = fly(MissionBatch(SHORT, [1, 2]), Wanderer(0), 40)
    twin, before = copy(batch), fingerprint(batch.state)
    fly(twin, Wanderer(1))
    assert fingerprint(batch.state) == before, "the original stands still"
    assert fingerprint(fly(batch, Wanderer(1)).state) == fingerprint(twin.state)


def test_policies_meet_the_same_tasks_operators_and_type_changes():
    scenario = change(SCENARIOS["medium"], change_share=1.0, change_within=0.1, time_limit=300)
    changed = 0
    for seed in range(6):
        one, other = two_policies(scenario, seed)
        for name in ("x", "y", "announced", "difficulty", "value", "deadline", "decay", "release", "changes_to"):
            assert np.array_equal(one.state.tasks[name], other.state.tasks[name]), name
        assert np.array_equal(one.state.operators["capacity"], other.state.operators["capacity"])
        assert np.array_equal(one.state.operators["proficiency"], other.state.operators["proficiency"])
        a, b = one.state.tasks[0], other.state.tasks[0]
        both = (a["changed_at"] >= 0) & (b["changed_at"] >= 0)
        assert np.array_equal(a["changed_at"][both], b["changed_at"][both])
        assert np.array_equal(a["type"][both], b["type"][both])
        changed += both.sum()
    assert changed > 50


def test_policies_meet_the_same_malfunctions():
    scenario = change(SCENARIOS["medium"], n_operators=0, malfunction=0.9, time_limit=300)
    for seed in range(4):
        one, other = two_policies(scenario, seed)
        ends = min(one.time[0], other.time[0])
        a, b = (
            np.where(batch.state.robots["failed_at"][0] < ends, batch.state.robots["failed_at"][0], -1)
            for batch in (one, other)
        )
        assert np.array_equal(a, b) and np.any(a >= 0)


def test_control_lowers_the_hazard_on_the_same_draws():
    scenario = plain(malfunction=0.9, controlled_hazard=0.4, time_limit=200, n_uav=4, n_operators=4)
    batch = flown(scenario, [3], Wanderer(0, 0.05), record=True)
    hazard, mode = batch.rules["hazard"][0], batch.log.robots["mode"][0]
    expected = np.full(scenario.n_robots, -1.0)
    for r in range(scenario.n_robots):
        for now in range(int(batch.time[0])):
            factor = 0.4 if mode[now, r] == Mode.CONTROLLED else 1.0
            if uniform(3, Event.MALFUNCTION, now, r, 0) < factor * hazard:
                expected[r] = now + 1
                break
    # Between a row and the next second, decisions may end control: compare where none did.
    assert np.array_equal(batch.state.robots["failed_at"][0], expected)
    assert np.any(mode == Mode.CONTROLLED) and np.any(expected >= 0)


def messages_of(batch):
    """Sent messages of a recorded mission by what identifies their packet."""
    rows = batch.log.messages[0][: batch.state.missions["messages"][0]]
    rows = rows[rows["sent"] >= 0]
    return {(int(row["kind"]), int(row["sent"]), int(row["sender"]), int(row["receiver"])): row for row in rows}


def test_policies_meet_the_same_packet_fates():
    scenario = change(
        SCENARIOS["medium"], malfunction=0.0, time_limit=300, map_side=400.0, forest_share=0.0, mountain_share=0.0
    )
    common = 0
    for seed in range(4):
        one, other = (messages_of(batch) for batch in two_policies(scenario, seed, record=True))
        for packet in one.keys() & other.keys():
            a, b = one[packet], other[packet]
            if Fate.UNDERWAY in (a["fate"], b["fate"]):
                continue
            assert a["fate"] == b["fate"] and a["late"] == b["late"] and a["ended"] == b["ended"]
            common += 1
    assert common > 300


def test_levels_of_limitation_use_the_same_draws():
    """What is lost under a milder level is lost under a harsher one; in time under the harsher, so under the milder."""
    scenario = change(SCENARIOS["medium"], malfunction=0.0, time_limit=300, forest_share=0.0, mountain_share=0.0)
    lost = 0
    for seed in range(4):
        nominal, low, high = (
            messages_of(flown(scenario, [seed], Wanderer(1), limitation=level, record=True))
            for level in ("nominal", "low", "high")
        )
        for mild, harsh in ((nominal, low), (low, high)):
            for packet in mild.keys() & harsh.keys():
                a, b = mild[packet], harsh[packet]
                if a["fate"] == Fate.LOST:
                    assert b["fate"] == Fate.LOST
                    lost += 1
                if b["fate"] == Fate.DELIVERED and not b["late"]:
                    assert not a["late"] and a["fate"] in (Fate.DELIVERED, Fate.UNDERWAY)
    assert lost > 20


def test_broadcast_packets_have_draws_of_their_own():
    """Receivers of one broadcast, and kinds in one second, do not share their fate."""
    draws = {uniform(1, Event.PACKET + kind, 10, 0, receiver) for kind in Kind for receiver in range(8)}
    assert len(draws) == len(Kind) * 8


def test_changes_happen_only_to_unserviced_general_tasks():
    scenario = change(SCENARIOS["medium"], change_share=1.0, change_within=0.3, service_base=5.0, time_limit=400)
    batch = flown(scenario, range(4), Wanderer(0, 0.02))
    tasks = batch.state.tasks.ravel()
    moved = tasks["type"] != tasks["announced"]
    assert np.array_equal(moved, tasks["changed_at"] >= 0) and moved.any()
    assert np.all(tasks["announced"][moved] == TaskType.GENERAL)
    assert np.array_equal(tasks["type"][moved], tasks["changes_to"][moved])
    assert np.all(tasks["changed_at"][moved] > tasks["release"][moved])
    assert np.all((tasks["done_at"] < 0) | (tasks["done_at"] > tasks["changed_at"]))
    kept = (tasks["announced"] == TaskType.GENERAL) & ~moved
    assert kept.any(), "service must have kept some from changing"
