"""What a choice would be worth: forks begin where the mission stands, hold what is tried, and leave the mission as it was."""

import numpy as np
import pytest
from flying import copied
from strategies import change

from commhg_mj.base.terms import IDLE, KEEP, REST
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.mission.state import ADDRESSES, LUCK
from commhg_mj.policies.alternatives import OPERATOR, ROBOT, Alternatives, Tried, hold, list_candidates
from commhg_mj.policies.planner import WHOLE, Memory, choose, new_desk, new_memory, talk
from commhg_mj.scenarios import SCENARIOS

SHORT = change(SCENARIOS["small"], time_limit=160)


class Flight:
    """Missions by the planner's own kernels; `on_choice` sees every second's choices before they are spoken of."""

    def __init__(self, seeds=range(3), links="raycast"):
        self.batch = MissionBatch(SHORT, seeds, links)
        self.desk, self.memory = new_desk(SHORT), new_memory(len(self.batch.seeds), SHORT)

    def fly(self, seconds):
        while not self.batch.over.all() and self.batch.time.min() < seconds:
            self.batch.step(self.spoken(self.choices()))

    def choices(self):
        decisions = stay(self.batch.observations)
        choose(self.batch.rules, WHOLE, self.desk, self.memory, self.batch.observations, decisions)
        return decisions

    def spoken(self, decisions):
        talk(WHOLE, self.memory, self.batch.observations, decisions)
        return decisions


def bytes_of(batch):
    return {name: array.tobytes() for name, array in batch.state._asdict().items()}


def first_free(flight, e=0):
    """(row, robot) of a robot of mission e that may choose a task."""
    seen = flight.batch.observations
    rows = np.flatnonzero((seen.robots["mission"] == e) & (seen.robot_tasks["legal"].sum(axis=1) > 1))
    return rows[0], int(seen.robots["robot"][rows[0]])


@pytest.fixture
def flight():
    flight = Flight()
    flight.fly(40)
    while not ((flight.batch.observations.robots["mission"] == 0)
               & (flight.batch.observations.robot_tasks["legal"].sum(axis=1) > 1)).any():
        flight.fly(flight.batch.time.min() + 1)
    return flight


def test_judging_leaves_the_mission_and_the_planners_memory_as_they_were(flight):
    choices = flight.choices()
    before, memory = bytes_of(flight.batch), [array.copy() for array in flight.memory]
    row, robot = first_free(flight)
    tasks = np.flatnonzero(flight.batch.observations.robot_tasks["legal"][row])
    Alternatives(flight.batch, 8).judge(0, flight.memory, ROBOT, robot, tasks[:2], [7, 8, 9])
    assert bytes_of(flight.batch) == before and all(map(np.array_equal, flight.memory, memory))
    flight.batch.step(flight.spoken(choices))


def test_the_planners_own_choice_with_the_missions_own_luck_is_the_mission_itself(flight):
    row, robot = first_free(flight)
    seen, choices = flight.batch.observations, flight.choices()
    own = int(choices.task[row])
    own = int(seen.robots["task"][row]) if own == KEEP else own
    judge = Alternatives(flight.batch, 2).judge
    robots = judge(0, flight.memory, ROBOT, robot, [own], [flight.batch.seeds[0]])
    earned = float(flight.batch.state.missions["reward"][0].sum())
    operator = np.flatnonzero(seen.operators["mission"] == 0)
    operators = [
        judge(0, flight.memory, OPERATOR, int(seen.operators["operator"][k]), [int(choices.operator[k])], [flight.batch.seeds[0]])
        for k in operator if choices.operator[k] != REST  # a tried REST lasts
    ]
    flight.batch.step(flight.spoken(choices))
    flight.fly(160)
    score = flight.batch.scores()[0]
    for twcr, reward, _ in (robots, *operators):
        assert twcr.shape == (1, 1) and twcr[0, 0] == score.twcr
        assert reward[0, 0] == pytest.approx(score.reward_mission + score.reward_coordination - earned, abs=1e-9)


def test_repetitions_differ_by_their_luck_alone(flight):
    row, robot = first_free(flight)
    tasks = np.flatnonzero(flight.batch.observations.robot_tasks["legal"][row])[:2]
    flight.choices()
    alternatives = Alternatives(flight.batch, 12)
    whole, *_ = alternatives.judge(0, flight.memory, ROBOT, robot, tasks, range(100, 106))
    again, *_ = alternatives.judge(0, flight.memory, ROBOT, robot, tasks[1:], range(103, 106))
    assert np.array_equal(whole[1:, 3:], again), "neither the other alternatives nor the other repetitions matter"
    assert len(np.unique(whole)) > 2


def test_luck_has_no_mean_and_explains_most_of_what_flights_differ_by(flight):
    row, robot = first_free(flight)
    tasks = np.flatnonzero(flight.batch.observations.robot_tasks["legal"][row])[:2]
    flight.choices()
    ends = Alternatives(flight.batch, 800).judge(0, flight.memory, ROBOT, robot, tasks, range(1000, 1400))
    luck = ends.luck.reshape(800, len(LUCK))
    assert np.all(np.abs(luck.mean(axis=0)) < 4.0 * luck.std(axis=0) / 20.0) and luck.std(axis=0).min() > 0.0
    twcr, luck = ends.twcr[1] - ends.twcr[0], ends.luck[1] - ends.luck[0]
    twcr, luck = twcr - twcr.mean(), luck - luck.mean(axis=0)
    explained, *_ = np.linalg.lstsq(luck[::2], twcr[::2])
    left = twcr[1::2] - luck[1::2] @ explained
    assert (left**2).mean() < 0.6 * (twcr[1::2] ** 2).mean(), "on flights that the coefficients were not fitted to"


def test_a_robot_holds_its_task_until_it_is_rid_of_it_and_idles_once():
    flight = Flight()
    seen, chosen = copied(flight.batch.observations), stay(flight.batch.observations)
    seen.robots["can_keep"], seen.robots["task"], chosen.task[:] = 1, 4, IDLE
    robot = seen.robots["robot"][0]
    assert hold(Tried(ROBOT, robot, 3, 0), seen, chosen, True) and chosen.task[0] == 3
    assert hold(Tried(ROBOT, robot, 4, 0), seen, chosen, True) and chosen.task[0] == KEEP
    chosen.task[:] = IDLE
    assert hold(Tried(ROBOT, robot, 4, 0), seen, chosen, False) and chosen.task[0] == KEEP
    assert not hold(Tried(ROBOT, robot, 5, 0), seen, chosen, False), "it has another one by now"
    seen.robots["can_keep"] = 0
    assert not hold(Tried(ROBOT, robot, 4, 0), seen, chosen, False), "it is ruled out"
    assert not hold(Tried(ROBOT, robot, IDLE, 0), seen, chosen, False)
    nobody = seen._replace(robots=seen.robots[:0])
    assert hold(Tried(ROBOT, robot, 4, 0), nobody, chosen, False), "it is not due: nothing is known"


def test_a_tried_rest_lasts_twenty_seconds_and_other_choices_are_the_planners_from_then_on():
    flight = Flight()
    seen, chosen = copied(flight.batch.observations), stay(flight.batch.observations)
    chosen.operator[:] = KEEP
    operator = seen.operators["operator"][0]
    assert hold(Tried(OPERATOR, operator, 2, 0), seen, chosen, True) and chosen.operator[0] == 2
    chosen.operator[:] = KEEP
    assert not hold(Tried(OPERATOR, operator, 2, 0), seen, chosen, False) and chosen.operator[0] == KEEP
    seen.operators["time"] = 19.0
    assert hold(Tried(OPERATOR, operator, REST, 0), seen, chosen, False) and chosen.operator[0] == REST
    seen.operators["time"] = 20.0
    assert not hold(Tried(OPERATOR, operator, REST, 0), seen, chosen, False)


def test_candidates_are_open_to_the_robot_and_begin_with_the_planners_pick(flight):
    batch, seen, choices = flight.batch, flight.batch.observations, flight.choices()
    found, n_seen = np.zeros(SHORT.n_tasks + 1, np.int64), 0
    for i, robot in enumerate(seen.robots):
        n = list_candidates(batch.rules, flight.desk, flight.memory, seen, i, found)
        pick = robot["task"] if choices.task[i] == KEEP else choices.task[i]
        if robot["activity"] != 2:  # at work: it does not choose
            assert found[0] == pick
        tasks = [j for j in found[:n] if j >= 0]
        assert len(set(tasks)) == len(tasks) and all(seen.robot_tasks["legal"][i, j] or j == robot["task"] for j in tasks)
        assert set(np.flatnonzero(seen.robot_tasks["legal"][i])) <= set(tasks)
        n_seen += n
    assert n_seen > len(seen.robots)


def test_the_memory_of_a_mission_is_its_own(flight):
    """Judged in another place of the batch, a mission is worth the same."""
    flight.choices()
    row, robot = first_free(flight)
    tasks = np.flatnonzero(flight.batch.observations.robot_tasks["legal"][row])[:2]
    expected, *_ = Alternatives(flight.batch, 4).judge(0, flight.memory, ROBOT, robot, tasks, [1, 2])
    alone = MissionBatch(SHORT, flight.batch.seeds[:1], "raycast")
    kept = {name: array[:1].copy() for name, array in flight.batch.state._asdict().items()}
    for name in ADDRESSES:
        kept["missions"][name] = alone.state.missions[name]
    alone.restore(kept)
    memory = Memory(*(array[:1].copy() for array in flight.memory))
    assert np.array_equal(Alternatives(alone, 4).judge(0, memory, ROBOT, robot, tasks, [1, 2])[0], expected)
