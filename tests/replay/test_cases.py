"""The case finder: it finds the paper's case in a history made by hand, and in nothing that only looks like it."""

import cv2
import numpy as np
import pytest

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, Fate, Kind, Session
from commhg_mj.cli.tables.decisions import case_table
from commhg_mj.flights.fly import fly
from commhg_mj.learning.preferences import Preferences
from commhg_mj.mission.observe import OPERATOR_SEEN, PEER_SEEN, ROBOT_SEES, TASK_SEEN, Observations
from commhg_mj.mission.state import OPERATOR
from commhg_mj.mission.trace import load_trace
from commhg_mj.render.case_figure import SIZE, STRIP, CaptionedFilm, draw_case
from commhg_mj.replay.cases import Case, _weigh, case_captions, cases_of, find_cases
from commhg_mj.replay.replayer import Decision, Truth
from commhg_mj.scenarios import SCENARIOS

HARD, EASY = 2, 1  # tasks
ME, OTHER, H = 0, 3, 1
SEED = 19  # of a mission with cases


def decision(time, choice=KEEP, query=NOBODY, report=None, robot=ME, held=HARD, **own):
    """A decision of a robot; `report` of operator H is (age, session, robot), None: never heard."""
    itself, tasks = np.zeros(1, ROBOT_SEES), np.zeros((1, 4), TASK_SEEN)
    operators = np.zeros((1, 2), OPERATOR_SEEN)
    itself["task"], itself["controller"], itself["can_keep"] = held, NOBODY, held != NOBODY
    for name, value in own.items():
        itself[name] = value
    tasks["difficulty"][0] = 0.0, 0.1, 0.9, 0.5
    operators["age"], operators["robot"], operators["legal"] = -1, NOBODY, 1
    if report:
        operators["age"][0, H], operators["session"][0, H], operators["robot"][0, H] = report
    none = np.zeros(0)
    seen = Observations(itself, tasks, np.zeros((1, 4), PEER_SEEN), operators, none, none)
    truth = Truth(None, None, np.zeros(2, OPERATOR), None)
    if report:
        truth.operators["session"][H], truth.operators["robot"][H] = report[1:]
    return Decision(robot, time, seen, truth, choice, False, query, False)


FREE, BUSY = (80, Session.REST, NOBODY), (4, Session.HELD, OTHER)
ASKS, TURNS = dict(time=100, query=H, report=FREE), dict(time=110, choice=EASY, report=BUSY)


def history(asks=None, turns=None, between=()):
    return [decision(**(ASKS | (asks or {}))), *between, decision(**(TURNS | (turns or {})))]


def test_the_case_is_found():
    (case,) = find_cases(history())
    assert (case.robot, case.operator, case.helped, case.left, case.taken) == (ME, H, OTHER, HARD, EASY)
    assert (case.asked.time, case.replied, case.answered.time) == (100, 106, 110)


def test_the_task_may_be_taken_with_the_query():
    (case,) = find_cases(history(dict(choice=HARD, held=NOBODY)))
    assert (case.left, case.taken) == (HARD, EASY)


@pytest.mark.parametrize("between", [
    [decision(104, report=(84, Session.REST, NOBODY))],  # the reply is not there yet
    [decision(104, query=H, report=(84, Session.REST, NOBODY))],  # it asks once more
    [decision(104, choice=EASY, robot=1, report=BUSY), decision(105, query=H, robot=1, report=FREE)],  # somebody else
])  # fmt: skip
def test_what_lies_between_does_not_hide_it(between):
    (case,) = find_cases(history(between=between))
    assert case.asked.time == 100


@pytest.mark.parametrize("miss", [
    dict(asks=dict(query=NOBODY)),
    dict(asks=dict(query=0)),  # asks another operator
    dict(asks=dict(report=None)),  # expected nothing
    dict(asks=dict(report=(80, Session.HELD, OTHER))),  # knew
    dict(asks=dict(controller=0)),  # has an operator already
    dict(asks=dict(choice=IDLE)),  # means to do nothing
    dict(turns=dict(report=(4, Session.REST, NOBODY))),  # is free indeed
    dict(turns=dict(report=(4, Session.HELD, ME))),  # comes
    dict(turns=dict(report=(4, Session.BID, OTHER))),  # controls nobody yet
    dict(turns=dict(report=(10, Session.HELD, OTHER))),  # was true before the query
    dict(turns=dict(report=(90, Session.REST, NOBODY))),  # no reply yet
    dict(turns=dict(choice=KEEP)),
    dict(turns=dict(choice=IDLE)),
    dict(turns=dict(can_keep=0)),  # had to leave the task anyway
    dict(turns=dict(held=NOBODY)),  # had lost it before
    dict(turns=dict(controller=0)),  # another operator has come
    dict(between=[decision(104, choice=3, report=(84, Session.REST, NOBODY))]),  # another plan before the reply
    dict(between=[decision(105, report=(2, Session.HELD, OTHER))]),  # kept its task when it learned it
])  # fmt: skip
def test_near_misses(miss):
    assert find_cases(history(**miss)) == []


def test_the_old_report_ages_in_the_comparison():
    case = Case(*history(), H)
    rows = []

    def look(seen):
        rows.append(seen.robot_operators[0, H].copy())
        return Preferences(np.zeros(4), 0.75 if rows[-1]["session"] == Session.REST else 0.25, 0.0, None, None, None)

    assert _weigh(case, look).loyalty == (0.75, 0.25)
    assert [(row["age"], row["session"], row["robot"]) for row in rows] == [(90, Session.REST, NOBODY), BUSY]
    assert tuple(case.answered.operators[H])[1:4] != tuple(case.asked.operators[H])[1:4], "the case itself is as it was"


def test_the_best_case():
    """First whose reply changed the choice most, then whose operator stays where it is and who left the harder task."""
    one, other, over = (Case(*history(turns=dict(choice=task)), H) for task in (EASY, 3, EASY))
    over.answered.truth.operators["session"][H] = Session.REST
    assert one.weight > other.weight > over.weight
    assert Case(*history(turns=dict(choice=3)), H, (0.5, 0.2)).weight > Case(*history(), H, (0.5, 0.3)).weight > one.weight


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """(path, trace, cases) of a mission in which everybody asks at random."""
    folder = tmp_path_factory.mktemp("traces")
    fly(SCENARIOS["small"], "random", [SEED], out=folder)
    (path,) = folder.iterdir()
    return path, load_trace(path), cases_of(path)


def test_cases_of_a_mission_are_the_traces(found):
    _, trace, cases = found
    assert cases
    for case in cases:
        at, then = case.asked.time, case.answered.time
        assert trace.robot_query[at, case.robot] == case.operator
        assert trace.robot_choice[then, case.robot] == case.taken == trace.robot_task[then + 1, case.robot]
        assert trace.robot_task[then, case.robot] == case.left
        reply = (trace.message_kind == Kind.REPLY) & (trace.message_sender == trace.scenario.n_robots + case.operator)
        reply &= (trace.message_receiver == case.robot) & (trace.message_fate == Fate.DELIVERED)
        reply &= (trace.message_sent == case.replied) & (trace.message_ended <= then)
        assert reply.any() and at < case.replied
        near = slice(int(case.replied) - 1, int(case.replied) + 1)
        assert case.helped in trace.operator_robot[near, case.operator]
    assert [case.weight for case in cases] == sorted([case.weight for case in cases], reverse=True)


def test_table_and_captions_tell_it(found):
    path, trace, cases = found
    names, case = trace.scenario.robot_names, cases[0]
    table = case_table([(path, case) for case in cases], {path: names})
    assert table.row_count == len(cases)
    said = " ".join(line for *_, lines in case_captions(case, trace) for line in lines)
    for word in (names[case.robot], names[case.helped], f"T{case.left}", f"T{case.taken}", f"H{case.operator}"):
        assert word in said
    assert [second for second, *_ in case_captions(case, trace)] == [case.asked.time, case.replied, case.settled]


def test_the_figure_and_a_picture_of_the_clip(found, tmp_path):
    _, trace, cases = found
    captions = case_captions(cases[0], trace)
    draw_case(tmp_path / "case.png", trace, cases[0], captions)
    picture = cv2.imread(str(tmp_path / "case.png")).astype(int)
    panels = [picture[:, start : start + 600] for start in (0, 610, 1220)]
    assert all(panel.std() > 20 for panel in panels)
    assert min(np.abs(a - b).mean() for a, b in zip(panels, panels[1:])) > 1
    assert [path.name for path in tmp_path.iterdir()] == ["case.png"]
    film = CaptionedFilm(trace, "uav0", [(5, "now")])
    early, late = film.picture(4.0), film.picture(5.0)
    film.close()
    assert early.shape == late.shape == (SIZE[1] + STRIP, SIZE[0], 3)
    assert np.ptp(early[:STRIP], axis=(0, 1)).max() == 0 < np.ptp(late[:STRIP], axis=(0, 1)).min()
