"""Figures of communication: exact for a policy whose every query is known, a dash where there is none."""

import io
import json

import numpy as np
import pytest
from flying import Wanderer, plain
from rich.console import Console
from strategies import change

from commhg_mj.base.terms import NOBODY, Activity, Fate, Kind
from commhg_mj.cli.tables.evaluate import communication_table, evaluation_tables
from commhg_mj.flights.fly import fly
from commhg_mj.flights.statistics import mean_interval
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.mission.state import LUCK
from commhg_mj.mission.trace import make_traces
from commhg_mj.replay.communication import FIGURES, fly_and_listen, listen
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.study.evaluation import Condition, evaluate, save_evaluation

# No message is lost and each takes a second: asked at t, the query arrives at t + 2, the reply at t + 3.
SURE = plain(time_limit=60, range=(2.0, 2.0, 2.0), delay=1)
SHORT = change(SCENARIOS["small"], time_limit=60)


class Script:
    """Everybody stays; robot 0 asks operator 0 at given seconds, the operator turns to robot 0 at one."""

    def __init__(self, asks=(), bids=-1, broadcasts=(), requests=()):
        self.asks, self.bids, self.broadcasts, self.requests = asks, bids, broadcasts, requests

    def __call__(self, seen):
        decisions = stay(seen)
        for i, robot in enumerate(seen.robots):
            if robot["robot"] == 0:
                decisions.query[i] = 0 if robot["time"] in self.asks else NOBODY
                decisions.broadcast[i] = robot["time"] in self.broadcasts
                decisions.assist[i] = robot["time"] in self.requests
        for k, operator in enumerate(seen.operators):
            if operator["time"] == self.bids:
                decisions.operator[k] = 0
        return decisions


def figures_of(script, scenario=SURE):
    [(_, figures)] = listen(MissionBatch(scenario, [0]), script)
    assert list(figures) == list(FIGURES)
    return figures


def test_exact_figures_of_known_queries():
    figures = figures_of(Script(asks=(4, 14, 24), bids=16, broadcasts=(3, 5), requests=(2,)))
    assert figures["queries"] == 3 and figures["answered"] == 1
    assert figures["unknown"] == pytest.approx(1 / 3) and figures["free"] == pytest.approx(2 / 3) and figures["busy"] == 0
    assert figures["own"] == pytest.approx(1 / 3), "at 24 s the operator controls the robot, which still believes it free"
    assert figures["answer_age"] == 1
    assert figures["turned"] == 0.5, "the second answer confirms the first, the third finds the operator busy"
    assert figures["requests"] == 1
    assert figures["control_time"] > 0


def test_a_session_of_any_kind_is_busy():
    """Robot 0 hears that the operator holds it, and asks again."""
    figures = figures_of(Script(asks=(10, 14), bids=3))
    assert (figures["unknown"], figures["busy"], figures["free"]) == (0.5, 0.5, 0) and figures["own"] == 1


def test_the_age_of_a_record_counts_from_when_it_was_true():
    asks = (4, 14, 24)
    batch = MissionBatch(SURE, [0], record=True)
    [(_, figures)] = listen(batch, Script(asks=asks))
    [trace] = make_traces(batch, "script")
    written = trace.message_sent[trace.message_kind == Kind.REPLY]
    assert len(written) == 3
    assert figures["record_age"] == pytest.approx(np.mean([asks[1] - written[0], asks[2] - written[1]]))


def test_broadcasts_are_a_rate_over_living_robots():
    assert figures_of(Script(broadcasts=(3, 5)))["broadcasts"] == 1.0, "two in two robots' minute"
    batch = MissionBatch(change(SURE, malfunction=0.999), range(4))
    for (_, figures), robots, now in zip(listen(batch, Script(broadcasts=(0,))), batch.state.robots, batch.time):
        alive = np.where(robots["activity"] == Activity.FAILED, robots["failed_at"], now).sum()
        assert figures["broadcasts"] == pytest.approx(60 / alive)
    assert (batch.state.robots["activity"] == Activity.FAILED).any()


@pytest.mark.parametrize("operators", [1, 0])
def test_who_never_asks_has_dashes(operators, recwarn):
    figures = figures_of(Script(), change(SURE, n_operators=operators))
    without = {name for name, value in figures.items() if np.isnan(value)}
    assert without == {"answered", "free", "busy", "unknown", "own", "record_age", "answer_age", "turned"}
    assert figures["queries"] == figures["broadcasts"] == figures["requests"] == 0 and not recwarn.list
    table = communication_table(["silent", "talks"], [[figures], [figures_of(Script(asks=(4,)))]])
    for label, cells in zip(["silent", "talks"], list(table.columns)[1:]):
        dashes = {name for name, cell in zip(FIGURES, cells.cells) if cell == "-"}
        assert dashes == (without if label == "silent" else {"record_age", "turned"})


def test_counts_agree_with_scores_and_traces():
    batch = MissionBatch(SHORT, range(4), record=True)
    flights = listen(batch, Wanderer())
    for (score, figures), trace in zip(flights, make_traces(batch, "wanderer")):
        assert figures["queries"] == score.messages["query"]["attempted"] > 0
        assert figures["requests"] == score.messages["request"]["attempted"]
        assert figures["free"] + figures["busy"] + figures["unknown"] == pytest.approx(1)
        assert figures["queries"] == np.sum(trace.robot_query != NOBODY)
        replies = trace.message_kind == Kind.REPLY
        ages = (trace.message_ended - trace.message_sent)[replies & (trace.message_fate == Fate.DELIVERED)]
        assert figures["answered"] * figures["queries"] == pytest.approx(len(ages))
        assert figures["answer_age"] == pytest.approx(ages.mean())


def test_listening_changes_no_mission_and_processes_no_figure():
    seeds = range(20)
    alone = fly_and_listen(SHORT, "random", seeds)
    assert [score for score, _ in alone] == fly(SHORT, "random", seeds)
    assert str(fly_and_listen(SHORT, "random", seeds, workers=2)) == str(alone)


def test_evaluate_prints_both_tables_and_writes_both(tmp_path):
    flights = evaluate(SHORT, ["greedy+no-query", "random", "omniscient"], 3, "abstract", "nominal", 1, lambda missions: None)
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(evaluation_tables("a title", flights))
    text = console.export_text()
    asked = [figures["queries"] for _, figures in flights["random"]]
    expected = "a title", "minus greedy+no-query", "without luck", "communication", "omniscient (privileged)"
    for words in (*expected, str(mean_interval(asked))):
        assert words in text
    save_evaluation(tmp_path / "e.json", 3, [(Condition(SHORT, "abstract", "nominal"), flights)])
    stored = json.loads((tmp_path / "e.json").read_text(), parse_constant=pytest.fail)
    assert stored["missions"] == 3 and set(stored) == {"missions", "first_seed", "conditions"}
    (stored,) = stored["conditions"]
    assert set(stored) == {"scenario", "links", "limitation", "twcr", "luck", "communication"}
    assert stored["communication"]["random"]["queries"] == asked
    assert stored["luck"]["omniscient"] == {name: [score.luck[name] for score, _ in flights["omniscient"]] for name in LUCK}
    assert stored["communication"]["greedy+no-query"]["record_age"] == [None] * 3
