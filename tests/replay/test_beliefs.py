"""What a robot knew: its records as they were, the truth beside them, the heads' probabilities, and what is refused."""

import numpy as np
import pytest
import torch
from flying import copied
from strategies import change

from commhg_mj.base.terms import KEEP, NOBODY, Activity, Session, Status
from commhg_mj.cli.tables.decisions import operator_table, peer_table, task_table
from commhg_mj.flights.fly import fly_to_end
from commhg_mj.learning.batches import robot_batch
from commhg_mj.learning.heads import RobotChoices, judge_robots
from commhg_mj.learning.registry import find_method
from commhg_mj.learning.weights import save_weights
from commhg_mj.mission.trace import make_traces
from commhg_mj.policies import prepare
from commhg_mj.replay.beliefs import choice_words, operator_sides
from commhg_mj.replay.replayer import Replayer, last_decision
from commhg_mj.scenarios import SCENARIOS

SCENARIO = change(SCENARIOS["small"], n_tasks=12, time_limit=120, malfunction=0.0, forest_share=0.0, mountain_share=0.0)
FATAL = change(SCENARIO, malfunction=0.999)
NAMES = SCENARIO.robot_names
SEED, AT = 4, 73


def recorded(policy, scenario=SCENARIO, label=None):
    return make_traces(fly_to_end(policy, scenario, [SEED], record=True), label or policy)[0]


@pytest.fixture(scope="module")
def trace():
    return recorded("random")


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """Files of shaken weights by method: their heads prefer something."""
    paths, generator = {}, torch.Generator().manual_seed(0)
    for name in ("commhg", "mappo"):
        drawn = torch.get_rng_state()
        torch.default_generator.manual_seed(0)  # whatever other tests have drawn
        method = find_method(name)()
        torch.set_rng_state(drawn)
        with torch.no_grad():
            for parameter in method.parameters():
                parameter += 0.5 * torch.randn(parameter.shape, generator=generator) / max(1, parameter.shape[-1]) ** 0.5
        paths[name] = str(tmp_path_factory.mktemp(name) / "weights.safetensors")
        save_weights(method, paths[name], {})
    return paths


def look(trace, robot="uav0", at=AT, policy=None):
    return last_decision(Replayer(trace, policy), robot, at)


def rows(table):
    """A table as {first cell: {column: cell}}."""
    headers, cells = [column.header for column in table.columns], zip(*(column.cells for column in table.columns))
    return {line[0]: dict(zip(headers, line)) for line in cells}


@pytest.mark.parametrize("robot", NAMES)
def test_truth_is_the_missions_state(trace, robot):
    decision = look(trace, robot)
    batch, act = prepare("random", SCENARIO, [SEED])
    while batch.time[0] <= decision.time:
        if decision.robot in batch.observations.robots["robot"]:
            state = copied(batch.state)
        batch.step(act(batch.observations))
    for kept, true in ((decision.truth.tasks, state.tasks), (decision.truth.robots, state.robots)):
        assert kept.tobytes() == true[0].tobytes()
    tasks, operators = rows(task_table(decision, NAMES)), rows(operator_table(decision, NAMES))
    words = {Status.OPEN: "open", Status.SERVICED: "in service", Status.DONE: "done"}
    for j, task in enumerate(state.tasks[0]):
        assert (f"T{j}" in tasks) == bool(task["released"])
        if task["released"]:
            assert tasks[f"T{j}"]["the truth"].startswith(words[Status(task["status"])])
    doing = {Session.REST: "free", Session.BID: "calls", Session.HELD: "controls"}
    for h, operator in enumerate(state.operators[0]):
        cell, waiting = operators[f"operator{h}"]["the truth"], (state.downlinks["since"][0, h] >= 0).sum()
        assert cell.startswith(doing[Session(operator["session"])])
        assert f"{operator['tokens']:.0f} B, {waiting} waiting" in cell
        if operator["session"] != Session.REST:
            assert NAMES[operator["robot"]] in cell
    assert set(rows(peer_table(decision, NAMES))) == {*NAMES} - {robot}


def test_beliefs_are_the_traces_records(trace):
    """The trace has sampled every robot's records by itself: at those seconds both must agree, unknown ones too."""
    unknown = 0
    for decision in Replayer(trace).decisions():
        sample, late = divmod(decision.time, trace.link_period)
        if late:
            continue
        heard = trace.records["belief_time"][sample, decision.robot]
        asked = trace.records["resource_time"][sample, decision.robot]
        for j, cells in rows(task_table(decision, NAMES)).items():
            if j.startswith("T"):
                time = heard[int(j[1:])]
                assert cells["the robot believed"].startswith("unknown: never heard") == (time < 0)
                assert cells["age"] == ("" if time < 0 else f"{decision.time - time:.0f} s")
                unknown += time < 0
        for h, time in enumerate(asked):
            believed = operator_sides(decision, NAMES)[h][0]
            assert (believed == "unknown: never heard") == (time < 0)
            assert time < 0 or believed.endswith(f", {decision.time - time:.0f} s ago")
    assert unknown > 20


def test_choices_are_the_traces(trace):
    decided = np.zeros((len(trace.robot_choice), len(NAMES)), bool)
    for decision in Replayer(trace).decisions():
        at = decision.time, decision.robot
        decided[at] = True
        if trace.robot_choice[at] == decision.task:  # after a refused claim it decides twice
            assert (trace.robot_query[at] == decision.query) or decision.query == NOBODY
            assert decision.plan == (decision.itself["task"] if decision.task == KEEP else max(decision.task, NOBODY))
    assert np.array_equal(decided, trace.robot_choice != -9)


def test_the_last_decision_by_then(trace):
    times = [decision.time for decision in Replayer(trace).decisions() if decision.robot == 2]
    for at in (0, 3.7, times[5], times[5] - 0.5, trace.ticks):
        assert look(trace, NAMES[2], at).time == max(time for time in times if time <= at)


def test_probabilities_are_the_heads(weights):
    drawn = f"{weights['commhg']}+drawn"
    trace = recorded(drawn, label="mine")
    flight, joint = Replayer(trace, drawn), 0
    prefer, act = flight.preferences(), flight._act
    for decision in flight.decisions(80):
        seen, own, p = decision.seen, decision.itself, prefer(decision.seen)
        assert p.task.sum() + p.keep + p.idle == pytest.approx(1) and p.query.sum() == pytest.approx(1)
        assert not p.task[decision.tasks["legal"] == 0].any() and (p.task[decision.tasks["legal"] == 1] > 0).all()
        assert (p.keep > 0, p.idle > 0, p.gate > 0) == (own["can_keep"], own["can_idle"], own["can_broadcast"])
        assert np.array_equal(p.query[1:] > 0, decision.operators["legal"] == 1)
        graphs = act.builder.robots(seen)
        task = decision.task if decision.task < 0 else int(np.flatnonzero(graphs.task == decision.task)[0])
        batch = robot_batch(graphs, SCENARIO.n_tasks)
        choices = RobotChoices(*map(torch.tensor, ([task], [decision.broadcast], [decision.query], [decision.assist])))
        logits = act.actors.method.robot(batch, torch.from_numpy(act.public.reshape(SCENARIO.n_tasks, -1)))
        share = {-1: p.keep, -2: p.idle}.get(decision.task, p.task[decision.task]) * p.query[1 + decision.query]
        share *= (p.gate if decision.broadcast else 1 - p.gate) if own["can_broadcast"] else 1
        share *= (p.assist if decision.assist else 1 - p.assist) if own["can_assist"] and decision.query == NOBODY else 1
        assert float(judge_robots(logits, batch, choices).log_prob.detach()) == pytest.approx(np.log(share), abs=1e-4)
        joint += decision.query != NOBODY
    assert joint > 3, "nobody ever asked"


def test_what_was_chosen_and_preferred_is_in_the_table(weights):
    trace = recorded(weights["commhg"], label="mine")
    flight = Replayer(trace, weights["commhg"])
    decision = last_decision(flight, "uav1", 60)
    p = flight.preferences()(decision.seen)
    tasks, others = rows(task_table(decision, NAMES, p)), rows(operator_table(decision, NAMES, p))
    chosen = {KEEP: "KEEP", -2: "IDLE"}.get(decision.task, f"T{decision.task}")
    assert [name for name, cells in tasks.items() if cells[""] == "chosen"] == [chosen]
    asked = "nobody" if decision.query == NOBODY else f"operator{decision.query}"
    assert others[asked][""] == "chosen" and others[asked]["preferred"] == f"{p.query[1 + decision.query]:.1%}"
    shown = [
        float(cells["preferred"].rstrip("%")) for name, cells in tasks.items() if name.startswith("T") and cells["preferred"]
    ]
    assert shown == sorted(shown, reverse=True) and len(shown) == (decision.tasks["legal"] == 1).sum()
    assert ("broadcasts" in choice_words(decision)) == (others["broadcast"][""] == "chosen")


def test_no_column_without_a_head(trace, weights):
    assert Replayer(trace).preferences() is None
    assert "preferred" not in rows(task_table(look(trace), NAMES))["KEEP"]
    schedule = recorded(weights["mappo"], label="mine")
    flight = Replayer(schedule, weights["mappo"])
    decision = last_decision(flight, "ugv0", 40)
    p = flight.preferences()(decision.seen)
    assert (p.gate, p.query, p.assist) == (None, None, None) and p.task.sum() + p.keep + p.idle == pytest.approx(1)
    assert "preferred" in rows(task_table(decision, NAMES, p))["KEEP"]
    assert "preferred" not in rows(operator_table(decision, NAMES, p))["nobody"]


@pytest.mark.parametrize("robot, at, said", [
    ("uav9", 5, "--robot must be one of uav0, uav1, ugv0, ugv1, is 'uav9'"), ("station", 5, "--robot"),
    ("uav0", -1, "--at -1 lies outside the mission, 0..120 s"), ("uav0", 120.5, "--at 120.5"), ("uav0", np.nan, "--at nan"),
])  # fmt: skip
def test_no_such_robot_or_second(trace, robot, at, said):
    with pytest.raises(ValueError, match=said):
        look(trace, robot, at)


def test_a_robot_that_has_failed():
    trace = recorded("greedy", FATAL)
    failed = np.flatnonzero(trace.robot_activity[:, 0] == Activity.FAILED)[0]
    with pytest.raises(ValueError, match=f"uav0 failed at {failed} s"):
        look(trace, at=failed)
    assert look(trace, at=failed - 1).time < failed


def test_another_policys_trace(trace):
    with pytest.raises(ValueError, match="^t.npz was not flown by greedy: the missions part between"):
        last_decision(Replayer(trace, "greedy", "t.npz"), "uav0", 60)
    with pytest.raises(ValueError, match="^t.npz was flown by 'mine'; name its policy or weights by --policy"):
        Replayer(recorded("greedy", label="mine"), None, "t.npz")
    with pytest.raises(ValueError, match="^unknown policy 'nobody'"):
        Replayer(trace, "nobody")
