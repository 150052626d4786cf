"""What holds in every second of every mission, whatever the scenario and the decisions."""

import numpy as np
import pytest
from flying import Wanderer, WatchedBatch, copied, flown, fly
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import change, limitations, link_models, scenarios, seeds

from commhg_mj.base.terms import NOBODY, Activity, Fate, Kind, Mode, Session, Status
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.policies import prepare
from commhg_mj.scenarios import SCENARIOS

NEVER_SENT = [Fate.OUT_OF_RANGE, Fate.NO_TOKENS, Fate.EXPIRED]


class Auditor:
    """Checks every state that it is shown, and what must not change from one to the next."""

    def __init__(self):
        self.before = None

    def __call__(self, batch, acted):
        state, communication = batch.state, batch.scenario.communication
        self.check_tokens(state, communication)
        self.check_queues(state, communication, acted)
        self.check_messages(state, communication)
        self.check_control(state)
        self.check_ownership(state)
        self.check_evidence(state)
        self.check_end(state, batch.scenario)
        if self.before is not None and self.before.missions["now"].sum() <= state.missions["now"].sum():
            self.check_terminal(self.before, state)
        self.before = copied(state)

    @staticmethod
    def check_tokens(state, communication):
        for owner in (state.robots, state.operators):
            assert np.all(owner["tokens"] >= 0) and np.all(owner["tokens"] <= communication.bucket)

    @staticmethod
    def check_queues(state, communication, acted):
        failed = state.robots["activity"] == Activity.FAILED
        assert np.all(state.uplinks["since"][failed] < 0), "a failed robot still queues messages"
        going = state.missions["over"] == 0
        for queue in () if acted else (state.uplinks[going], state.downlinks[going]):
            age = state.missions["now"][going][:, None, None] - queue["since"]
            assert np.all((age < communication.time_to_live) | (queue["since"] < 0)), "a message outlives its TTL"

    @staticmethod
    def check_messages(state, communication):
        sizes = np.array([getattr(communication, f"{kind.name.lower()}_bytes") for kind in Kind])
        count = state.counters
        queued, flying = np.zeros(count.shape, int), np.zeros(count.shape, int)
        for e, mission in enumerate(state.missions):
            if mission["over"]:
                continue
            slots = state.flying["slot"][e]
            assert np.array_equal(np.sort(slots), np.arange(len(slots)))
            air = state.air[e][slots[: mission["flying"]]]
            flying[e] = np.bincount(air["kind"], minlength=len(Kind))
            assert np.all((air["due"] - air["sent"] >= 1) & (air["sent"] <= mission["now"]))
            for queue in (state.uplinks[e], state.downlinks[e]):
                queued[e] += np.bincount(queue["kind"][queue["since"] >= 0].ravel(), minlength=len(Kind))
        fates = count["fate"]
        assert np.array_equal(count["attempted"], fates.sum(axis=-1) + queued + flying), "messages without one fate"
        assert np.array_equal(count["bytes"], count["sent"] * sizes)
        for e in np.flatnonzero(state.missions["over"] == 0):
            unsent = fates[e][:, NEVER_SENT].sum(axis=-1) + queued[e]
            assert np.array_equal(count["sent"][e], count["attempted"][e] - unsent)
        delivered, longest = fates[..., Fate.DELIVERED], max(communication.delay, communication.late_delay[1])
        soonest = min(communication.delay, communication.late_delay[0])
        assert np.all(count["latency_sum"] >= soonest * delivered)
        assert np.all(count["latency_sum"] <= longest * delivered)
        assert np.all(count["late"] <= count["sent"])

    @staticmethod
    def check_control(state):
        """One robot a human, one human a robot, and no lease that its operator does not reckon with."""
        lease = state.missions["rules"]["lease"]
        for e, (robots, operators) in enumerate(zip(state.robots, state.operators)):
            controlled = np.flatnonzero(robots["controller"] != NOBODY)
            controllers = robots["controller"][controlled]
            assert len(np.unique(controllers)) == len(controllers), "an operator controls two robots"
            assert np.array_equal(operators["leased"][controllers], controlled)
            assert np.all(robots["lease_until"][controlled] <= operators["lease_sent"][controllers] + lease[e])
            assert np.array_equal(robots["mode"] == Mode.AUTONOMOUS, robots["controller"] == NOBODY)
            assert np.array_equal(operators["session"] == Session.REST, operators["robot"] == NOBODY)
            held = operators[operators["session"] == Session.HELD]
            assert np.array_equal(held["leased"], held["robot"])
        assert np.all((state.operators["fatigue"] >= 0) & (state.operators["fatigue"] <= 1))

    @staticmethod
    def check_ownership(state):
        for robots, tasks in zip(state.robots, state.tasks):
            owned = np.flatnonzero(tasks["owner"] != NOBODY)
            busy = np.flatnonzero(robots["task"] != NOBODY)
            assert np.array_equal(robots["task"][tasks["owner"][owned]], owned)
            assert np.array_equal(np.sort(tasks["owner"][owned]), busy)
            working = np.isin(robots["activity"], (Activity.TRAVELLING, Activity.SERVICING))
            assert np.array_equal(working, robots["task"] != NOBODY)
            serviced = robots["task"][robots["activity"] == Activity.SERVICING]
            assert np.array_equal(np.sort(serviced), np.flatnonzero(tasks["status"] == Status.SERVICED))
            done = tasks["status"] == Status.DONE
            assert np.array_equal(done, tasks["done_at"] >= 0) and np.all(tasks["progress"][done] == 1)
            assert np.all(tasks["released"][done] == 1) and np.all(tasks["released"][owned] == 1)
            assert np.all((tasks["progress"] >= 0) & (tasks["progress"] <= 1))

    @staticmethod
    def check_evidence(state):
        now = state.missions["now"][:, None, None]
        for table in (state.beliefs, state.peers, state.resources, state.tips):
            assert np.all(table["time"] <= now), "evidence out of the future"
        known = state.beliefs["time"] >= 0
        assert np.all(~known | (state.tasks["released"] == 1)[:, None]), "evidence of a task before its release"
        assert np.all(~known | (state.beliefs["time"] >= state.tasks["release"][:, None]))

    @staticmethod
    def check_end(state, scenario):
        failed = np.all(state.robots["activity"] == Activity.FAILED, axis=1)
        done = np.all(state.tasks["status"] == Status.DONE, axis=1)
        ended = (state.missions["now"] >= scenario.time_limit) | failed | done
        assert np.array_equal(state.missions["over"] == 1, ended)
        pending = (state.tasks["released"] == 1) & (state.tasks["status"] != Status.DONE)
        value = np.sum(state.tasks["value"] * pending, axis=1)
        np.testing.assert_allclose(state.missions["pending_value"], value, atol=1e-9 * state.tasks["value"].sum())

    @staticmethod
    def check_terminal(old, new):
        assert np.all(new.tasks["status"][old.tasks["status"] == Status.DONE] == Status.DONE)
        assert np.all(
            new.tasks["done_at"][old.tasks["done_at"] >= 0] == old.tasks["done_at"][old.tasks["done_at"] >= 0]
        )
        was_done = (old.beliefs["status"] == Status.DONE) & (old.beliefs["time"] >= 0)
        assert np.all(new.beliefs["status"][was_done] == Status.DONE), "completion is terminal"
        for name in ("beliefs", "peers", "resources", "tips"):
            assert np.all(getattr(new, name)["time"] >= getattr(old, name)["time"]), f"{name}: newer evidence was lost"
        failed = old.robots["activity"] == Activity.FAILED
        robots = new.robots[failed]
        assert np.all(robots["activity"] == Activity.FAILED)
        assert np.all((robots["due"] == 0) & (robots["task"] == NOBODY) & (robots["controller"] == NOBODY))
        assert np.all((robots["x"] == old.robots["x"][failed]) & (robots["y"] == old.robots["y"][failed]))
        assert np.all(robots["tokens"] == old.robots["tokens"][failed])
        over = old.missions["over"] == 1
        assert np.array_equal(new.tasks[over], old.tasks[over]) and np.array_equal(new.robots[over], old.robots[over])


@settings(max_examples=8)
@given(scenarios(), seeds, link_models, limitations, st.sampled_from([0.02, 0.2, 0.9]))
def test_rules_hold_at_every_step_of_any_mission(scenario, seed, links, limitation, restless):
    batch = WatchedBatch(scenario, [seed, seed // 2], links, limitation, watch=Auditor())
    fly(batch, Wanderer(seed % 1000, restless))


@settings(max_examples=7)
@given(scenarios(), seeds, limitations, st.sampled_from(["random", "greedy", "omniscient"]))
def test_reference_policies_fly_any_scenario_legally(scenario, seed, limitation, name):
    batch, policy = prepare(name, scenario, [seed, seed // 2], limitation=limitation)
    auditor = Auditor()
    while not batch.over.all():
        batch.step(policy(batch.observations))
        auditor(batch, False)


@settings(max_examples=15)
@given(scenarios(), seeds, limitations)
def test_rewards_and_metric_are_what_the_final_record_says(scenario, seed, limitation):
    batch, policy = prepare("greedy", scenario, [seed], limitation=limitation)
    rewards = batch.rewards.copy()
    while not batch.over.all():
        batch.step(policy(batch.observations))
        rewards += batch.rewards
    (score,), tasks, mission = batch.scores(), batch.state.tasks[0], batch.state.missions[0]
    total, reward, mission_value = tasks["value"].sum(), scenario.reward, 0.0
    for task in tasks[tasks["done_at"] >= 0]:
        mission_value += task["value"] * np.exp(-max(0.0, task["done_at"] - task["deadline"]) / task["decay"])
    assert score.twcr == pytest.approx(mission_value / total) and -1e-12 <= score.twcr <= 1 + 1e-12
    assert 0 <= score.on_time <= score.completion <= 1 and score.lateness_loss >= -1e-12
    seconds = np.arange(1, mission["now"] + 1)[:, None]
    open_then = (tasks["release"] <= seconds) & ((tasks["done_at"] < 0) | (tasks["done_at"] > seconds))
    pending = np.sum(open_then * tasks["value"]) / total
    assert score.reward_mission == pytest.approx(mission_value - reward.pending * pending)
    costs = score.switches * reward.switch_cost + score.incompatibles * reward.incompatible_cost
    costs += score.conflicts * reward.conflict_cost
    assert score.reward_coordination == pytest.approx(-costs * np.mean(scenario.tasks.values))
    np.testing.assert_allclose(rewards[0], [score.reward_mission, score.reward_coordination], rtol=1e-9, atol=1e-9)


def test_a_steps_rewards_are_discounted_by_the_second():
    gamma, batch = 0.9, MissionBatch("small", [3], record=True)
    batch.discount = gamma
    for _ in range(30):
        since = batch.time[0]
        batch.step(stay(batch.observations))
        rows = batch.log.rewards[0][since : batch.time[0]]
        fade = gamma ** np.arange(len(rows))
        expected = np.sum(fade * rows["mission"]), np.sum(fade * rows["coordination"])
        np.testing.assert_allclose(batch.rewards[0], expected, rtol=1e-9)
    assert batch.time[0] > 60, "steps of several seconds"


@settings(max_examples=15)
@given(scenarios(), seeds, limitations)
def test_bytes_leave_only_against_tokens(scenario, seed, limitation):
    batch = flown(scenario, [seed], Wanderer(seed % 99), limitation=limitation, record=True)
    rules, log, end = scenario.communication, batch.log, int(batch.time[0])
    n_robots = scenario.n_robots
    sizes = batch.rules["message_bytes"][0]
    rows = log.messages[0][: batch.state.missions["messages"][0]]
    sent = rows[(rows["sent"] >= 0) & (rows["kind"] != Kind.BROADCAST)]
    spent = np.zeros((end + 1, n_robots + scenario.n_operators))
    np.add.at(spent, (sent["sent"], sent["sender"]), sizes[sent["kind"]])
    tokens = np.concatenate([log.robots["tokens"][0], log.operators["tokens"][0]], axis=1)[: end + 1].astype(float)
    expected = np.minimum(rules.bucket, tokens[:-1] + rules.refill) - spent[1:]
    frozen = np.zeros(expected.shape, bool)
    frozen[:, :n_robots] = (log.robots["activity"][0] == Activity.FAILED)[:end]  # its last report leaves when it fails
    assert np.all(spent[1:][frozen] == 0)
    np.testing.assert_allclose(tokens[1:][~frozen], expected[~frozen], rtol=1e-5, atol=1e-2)
    assert np.all(tokens >= 0)


@settings(max_examples=15)
@given(scenarios(), seeds, link_models)
def test_every_logged_message_has_one_fate_and_the_log_agrees_with_the_counters(scenario, seed, links):
    batch = flown(scenario, [seed], Wanderer(seed % 99, 0.3), links=links, record=True)
    rows = batch.log.messages[0]
    assert batch.state.missions["messages"][0] <= len(rows), "the log is too short"
    rows, counters = rows[: batch.state.missions["messages"][0]], batch.state.counters[0]
    assert np.all(rows["ended"] >= rows["queued"])
    for kind in Kind:
        mine = rows[rows["kind"] == kind]
        assert np.array_equal(np.bincount(mine["fate"], minlength=len(Fate)), counters["fate"][kind])
        assert np.sum(mine["sent"] >= 0) == counters["sent"][kind] and mine["late"].sum() == counters["late"][kind]
        delivered = mine[mine["fate"] == Fate.DELIVERED]
        assert np.sum(delivered["ended"] - delivered["sent"]) == counters["latency_sum"][kind]
        low, high = scenario.communication.late_delay
        late = delivered[delivered["late"] == 1]
        assert np.all((late["ended"] - late["sent"] >= low) & (late["ended"] - late["sent"] <= high))
        on_time = delivered[delivered["late"] == 0]
        assert np.all(on_time["ended"] - on_time["sent"] == scenario.communication.delay)


@settings(max_examples=10)
@given(scenarios(), seeds)
def test_robots_move_at_their_speed_and_failed_ones_not_at_all(scenario, seed):
    batch = flown(scenario, [seed], Wanderer(seed % 99), record=True)
    log, rules = batch.log.robots[0][: batch.time[0] + 1], scenario.robots
    step = np.hypot(np.diff(log["x"], axis=0), np.diff(log["y"], axis=0))
    ground = np.arange(scenario.n_robots) >= scenario.n_uav
    slow, fast = (np.where(ground, pair[1], pair[0]) for pair in (rules.autonomous_speed, rules.controlled_speed))
    # A mode ends or begins between two rows: only rows of one mode tell the speed.
    controlled = log["mode"] == Mode.CONTROLLED
    limit = np.where(
        controlled[1:] & controlled[:-1], fast, np.where(controlled[1:] | controlled[:-1], np.maximum(slow, fast), slow)
    )
    assert np.all(step <= limit * (1 + 1e-5) + 1e-2)
    failed = log["activity"] == Activity.FAILED
    assert np.all(step[failed[1:] & failed[:-1]] == 0) and np.all(failed[1:] >= failed[:-1])


@pytest.mark.parametrize("name", SCENARIOS)
def test_rules_hold_on_the_named_scenarios(name):
    fly(WatchedBatch(name, [5], watch=Auditor()), Wanderer(3, 0.05), seconds=250)


@pytest.mark.parametrize("sizes", [(1, 0, 0, 1), (0, 1, 0, 1), (0, 1, 24, 1), (32, 32, 24, 1024), (64, 0, 0, 2)])
def test_rules_hold_at_the_limits_of_size(sizes):
    n_uav, n_ugv, n_operators, n_tasks = sizes
    scenario = change(
        SCENARIOS["large"], n_uav=n_uav, n_ugv=n_ugv, n_operators=n_operators, n_tasks=n_tasks, time_limit=60,
        poi_spacing=0.01, sensing_radius=0.2, malfunction=0.5, service_base=2.0, service_per_difficulty=4.0,
    )  # fmt: skip
    batch = fly(WatchedBatch(scenario, [1], watch=Auditor()), Wanderer(1, 0.1))
    assert batch.over.all()
