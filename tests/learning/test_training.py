"""Runs: what the collector remembers, and going on to the same bits after any interruption."""

import contextlib
import csv
import dataclasses
import json
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from flying import Wanderer, copied, differences, fingerprint, fly
from learners import FAMILIES, QUICK, SHORT, run, same_bits, updated
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from strategies import change

from commhg_mj.learning import rollout, train
from commhg_mj.learning.features import OPERATOR, ROBOT
from commhg_mj.learning.graphs import GraphBuilder
from commhg_mj.learning.registry import make_method
from commhg_mj.learning.rollout import from_decisions, to_decisions
from commhg_mj.learning.run_log import LOG, Log
from commhg_mj.learning.state_features import STATE_MISSION, STATE_OPERATOR, STATE_ROBOT
from commhg_mj.learning.train import CLONED, STATE, WEIGHTS, Plan, Training, plan_from_json, plan_to_json
from commhg_mj.learning.weights import SCHEMA, load_weights, save_weights
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.policies import POLICIES, prepare


def collect(training, decisions, is_taught=False, gamma=QUICK.gamma, lam=QUICK.lam):
    return training.collector.collect(decisions, training.method.critic, training.method.scale, gamma, lam, is_taught=is_taught)


def watched(training, look):
    """Call `look(batch, robots, operators)` whenever the collector has decided."""
    collector = training.collector
    decide = collector.actors.decide

    def watch(*seen, **how):
        result = decide(*seen, **how)
        look(collector.batch, *result[:2])
        return result

    collector.actors.decide = watch


# Decisions


@pytest.mark.parametrize("policy", ["greedy", "random", "wanderer"])
def test_choices_and_decisions_are_one_another(policy):
    batch, act = prepare("greedy" if policy == "wanderer" else policy, SHORT, range(4))
    act, builder = Wanderer(restless=0.3) if policy == "wanderer" else act, GraphBuilder(batch)
    while not batch.over.all():
        robots, operators = builder.robots(batch.observations), builder.operators(batch.observations)
        decisions = act(batch.observations)
        choices, picks = from_decisions(robots, operators, decisions)
        again = to_decisions(robots, choices, picks)
        assert all(np.array_equal(a, b) and a.dtype == b.dtype for a, b in zip(decisions, again))
        edges = choices.task[choices.task >= 0]
        assert np.all(robots.task_legal[edges]), "the edge that was found is another robot's, or not open"
        batch.step(decisions)


# The collector


@pytest.mark.parametrize("decisions", [40, pytest.param(300)], ids=["one mission", "across missions"])
def test_every_decision_remembers_its_missions_public_table(tmp_path, decisions):
    training, seeds = run(tmp_path), []
    watched(training, lambda batch, robots, operators: seeds.extend(batch.seeds[e] for e in robots.mission))
    data = collect(training, decisions)
    assert len(seeds) == len(data.robots.mission)
    for seed in set(seeds):
        fresh = MissionBatch(SHORT, [seed])
        table = GraphBuilder(fresh).public(fresh.state.tasks)[0]
        rows = data.robots.mission[np.array(seeds) == seed]
        assert np.array_equal(data.public[rows], np.broadcast_to(table, (len(rows), *table.shape))), seed


def test_every_decision_lies_in_the_state_that_it_was_made_in(tmp_path):
    """Across the ends of missions: a robot's own features are those of the critic's state."""
    data = collect(run(tmp_path), 300)
    assert np.all(np.diff(data.robot_state) >= 0) and np.all(np.diff(data.operator_state) >= 0)
    pairs = (
        (data.states.robot[data.robot_state, data.robots.robot], STATE_ROBOT, data.robots, ROBOT, ("x", "y")),
        (data.states.mission[data.robot_state], STATE_MISSION, data.robots, ROBOT, ("time",)),
        (data.states.mission[data.operator_state], STATE_MISSION, data.operators, OPERATOR, ("time",)),
        (data.states.operator[data.operator_state, data.operators.operator], STATE_OPERATOR, data.operators, OPERATOR,
         ("fatigue",)),
    )  # fmt: skip
    for state, truth, actors, known, names in pairs:
        np.testing.assert_allclose(state[:, truth.columns(*names)], actors.itself[:, known.columns(*names)], atol=1e-6)


def test_missions_follow_one_another_by_their_seeds_and_pay_their_own_rewards(tmp_path):
    training, flown = run(tmp_path, side_by_side=2, seed=3), {}

    def look(batch, robots, operators):
        for e, seed in enumerate(batch.seeds):
            flown[seed] = batch.state.missions["reward"][e].copy()

    watched(training, look)
    collector = training.collector
    ends, step = {}, collector.batch.step_legal

    def stepped(decisions):
        result = step(decisions)
        for e in np.flatnonzero(collector.batch.over):
            reward = collector.batch.state.missions["reward"][e].copy()
            ends[collector.batch.seeds[e]] = reward, collector.batch.scores()[e].twcr
        return result

    collector.batch.step_legal = stepped
    data = collect(training, 400, gamma=1.0, lam=1.0)
    first = 4 * 10**6
    assert sorted(flown) == list(range(first, first + len(flown))) and len(flown) > 4
    counted = [twcr for seed, (_, twcr) in ends.items() if seed in flown]
    assert sorted(collector.scores) == sorted(counted[: len(collector.scores)]) and collector.next_seed == max(flown) + 1
    # Without discount, what follows a mission's first decision is all that it pays.
    begins = (data.robots.itself[:, ROBOT.index("time")] == 0) & (data.robots.robot == 0)
    totals = [reward for seed, (reward, _) in sorted(ends.items()) if seed in flown]
    assert len(totals) > 4 and any(reward[1] != 0 for reward in totals)
    for reward in totals:
        assert np.isclose(data.returns[0][begins], reward, atol=1e-6).all(axis=1).any()


def test_rewards_within_a_step_are_discounted_by_the_second(tmp_path, monkeypatch):
    """The k-th second's counts gamma ** k, by the same mission flown second by second."""
    training, gamma, told = run(tmp_path, side_by_side=1), 0.9, []
    estimate = rollout.estimate_advantages
    monkeypatch.setattr(rollout, "estimate_advantages", lambda *a: (told.append(a), estimate(*a))[1])
    collect(training, 60, is_taught=True, gamma=gamma)
    rewards, elapsed, over = (column[:, 0] for column in told[0][2:5])
    until = int(np.flatnonzero(over)[0]) + 1  # the first mission's steps
    alone = MissionBatch(SHORT, [10**6])
    policy, seconds = POLICIES["greedy"].make(alone), []
    while not alone.over[0]:
        alone.step(policy(alone.observations), 1)
        seconds.append(alone.rewards[0])
    starts = np.cumsum([0, *elapsed[:until]]).astype(int)
    assert starts[-1] == len(seconds) and max(elapsed[:until]) > 2
    for reward, a, b in zip(rewards, starts, starts[1:]):
        np.testing.assert_allclose(reward, sum(gamma**k * paid for k, paid in enumerate(seconds[a:b])), atol=1e-9)


def test_a_teacher_decides_and_its_choices_are_kept(tmp_path):
    training, said = run(tmp_path), []
    greedy = training.collector.teacher

    def teacher(seen):
        decisions = greedy(seen)
        said.append(decisions)
        return decisions

    training.collector.teacher = teacher
    data = collect(training, 150, is_taught=True)
    assert np.array_equal(np.concatenate([d.broadcast for d in said]), data.robot_choices.gate)
    chosen = data.robot_choices.task
    tasks = np.where(chosen >= 0, data.robots.task[np.maximum(chosen, 0)], chosen)
    assert np.array_equal(np.concatenate([d.task for d in said]), tasks)


def test_a_run_that_clones_the_planner_goes_on_with_what_the_planner_remembers(tmp_path):
    options = dict(method="mappo", learner=("clone",), teacher="planner", plans=True)
    whole = updated(run(tmp_path / "whole", **options), 4)
    cut = updated(run(tmp_path / "cut", **options), 2)
    cut.save()
    assert same_bits(updated(Training.resume(tmp_path / "cut"), 2), whole) and whole.aim == "clone"


def test_one_mission_alone_trains(tmp_path):
    """Steps in which only operators are due, or nobody."""
    updated(run(tmp_path, side_by_side=1, first_updates=0, hyper=dataclasses.replace(QUICK, decisions=50)), 2)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("method", FAMILIES)
def test_a_mission_without_operators_trains_in_silence(tmp_path, method):
    updated(run(tmp_path, method, change(SHORT, n_operators=0)), 2)


# Going on


@pytest.mark.parametrize("links", ["abstract", "raycast"])
def test_a_restored_batch_goes_on_to_the_same_bits(links):
    scenario = change(SHORT, time_limit=100)
    batch, policy = prepare("random", scenario, [5, 6], links)
    fly(batch, policy, seconds=40)
    kept = {name: array.copy() for name, array in batch.state._asdict().items()}
    seen = copied(batch.observations)
    fly(batch, policy)
    other, again = prepare("random", scenario, [5, 6], links)
    assert differences(seen, other.restore(kept)) == []
    assert all(np.array_equal(a, b) for a, b in zip(other.observations, seen))
    fly(other, again)
    assert fingerprint(other.state) == fingerprint(batch.state)


def test_a_batch_is_restored_after_the_end_of_some_missions():
    batch, policy = prepare("random", SHORT, [5, 6])
    fly(batch, policy)
    batch.restart(0, 9)
    fly(batch, policy, seconds=10)
    kept = {name: array.copy() for name, array in batch.state._asdict().items()}
    other = MissionBatch(SHORT, batch.seeds)
    other.restore(kept)
    assert batch.seeds == [9, 6] and other.over.tolist() == [False, True]
    fly(batch, policy), fly(other, policy)
    assert fingerprint(other.state) == fingerprint(batch.state)


@pytest.mark.parametrize("method", FAMILIES)
def test_a_run_that_is_thrown_away_goes_on_to_the_same_bits(tmp_path, method):
    few = dict(hyper=dataclasses.replace(QUICK, decisions=80), side_by_side=3)
    whole, first = (run(tmp_path / name, method, **few) for name in ("whole", "first"))
    assert same_bits(whole, first)
    updated(first, 2).save()
    assert len(first.collector.scores) > 0, "no mission has ended: restarts are not tried"
    del first
    resumed = Training.resume(tmp_path / "first")
    assert resumed.plan == whole.plan and resumed.updates == 2
    assert not same_bits(whole, resumed)
    assert same_bits(updated(whole, 3), updated(resumed, 1))
    resumed.save()
    assert same_bits(whole, Training.resume(tmp_path / "first"))


def test_the_same_seed_leads_to_the_same_weights_after_twenty_updates(tmp_path):
    hyper = dataclasses.replace(QUICK, decisions=20, minibatches=1)
    one, other = (updated(run(tmp_path / name, hyper=hyper, side_by_side=3), 20) for name in ("one", "other"))
    assert one.missions > 5 and same_bits(one, other)


def test_seeds_matter(tmp_path):
    one, other = (updated(run(tmp_path, seed=seed), 1).method.state_dict() for seed in (1, 2))
    weights = [name for name in one if name.endswith("weight") and not name.startswith("scale")]
    assert weights and not any(torch.equal(one[name], other[name]) for name in weights)


KILLED = """
import os, signal, sys
sys.path[:0] = [{tests!r}, {here!r}]
from learners import run
training = run({folder!r})
training.update()
training.save()
collect = training.collector.collect
def die(*arguments):
    collect(*arguments)
    os.kill(os.getpid(), signal.SIGKILL)
training.collector.collect = die
training.update()
"""


@pytest.fixture(scope="module", autouse=True)
def killed(tmp_path_factory):
    """(folder, process) of a run that kills itself amid its second update, while other tests run."""
    folder, here = tmp_path_factory.mktemp("killed"), Path(__file__).parent
    code = KILLED.format(tests=str(here.parent), here=str(here), folder=str(folder))
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True)
    yield folder, process
    process.kill()
    process.communicate()


def test_a_killed_run_goes_on_to_the_same_bits(killed, tmp_path):
    folder, process = killed
    _, errors = process.communicate(timeout=120)
    assert process.returncode == -signal.SIGKILL, errors
    resumed, whole = Training.resume(folder), run(tmp_path)
    assert resumed.updates == 1
    assert same_bits(updated(whole, 2), updated(resumed, 1))


@contextlib.contextmanager
def largest_file(size):
    """As on a full disk: no file can become larger."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_the_state_is_whole_or_old(tmp_path):
    training = updated(run(tmp_path), 1)
    training.save()
    before = (tmp_path / STATE).read_bytes()
    updated(training, 1)
    with largest_file(len(before) // 2), pytest.raises(ValueError, match=f"cannot write {tmp_path / STATE}: File too large$"):
        training.save()
    assert (tmp_path / STATE).read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([STATE, WEIGHTS, CLONED])
    assert Training.resume(tmp_path).updates == 1


def test_weights_and_log_on_a_full_disk_are_named(tmp_path):
    with largest_file(1000), pytest.raises(ValueError, match=f"cannot write {tmp_path / WEIGHTS}: File too large$"):
        run(tmp_path).save()
    log = Log(tmp_path, {"update": 1})
    with largest_file(log.path.stat().st_size), pytest.raises(ValueError, match=f"cannot write {log.path}: File too large$"):
        log.write({"update": 1})


def test_a_plan_is_itself_after_a_round_trip():
    learner, rest = ("clone", "rollouts"), dict(plans=True, first_updates=1, init="x.safetensors", hyper=QUICK)
    plan = Plan("mappo", SHORT, 3, "raycast", "high", 10, 2, 2, learner, "planner", **rest)
    assert plan_from_json(plan_to_json(plan)) == plan


def logged(folder):
    with open(folder / LOG, newline="") as file:
        return list(csv.DictReader(file))


def test_the_log_is_a_table(tmp_path):
    training = run(tmp_path)
    for _ in range(2):
        training.log(training.update())
    rows = logged(tmp_path)
    assert [row["update"] for row in rows] == ["1", "2"] and float(rows[1]["decisions"]) > float(rows[0]["decisions"])


@pytest.fixture(scope="module")
def ahead(tmp_path_factory):
    """The folder of a run whose log has a row more than its state."""
    folder = tmp_path_factory.mktemp("ahead") / "run"
    training = run(folder)
    for n in range(3):
        row = training.update()
        training.log(row)
        if n < 2:
            training.save()
    return folder


@pytest.mark.parametrize("cut", [0, 3, 40], ids=["whole", "almost whole", "hardly begun"])
def test_rows_beyond_the_saved_update_are_not_told_twice(ahead, tmp_path, cut):
    """Killed after a row, or amid one, and before the state."""
    shutil.copytree(ahead, tmp_path, dirs_exist_ok=True)
    whole, path = logged(tmp_path), tmp_path / LOG
    path.write_bytes(path.read_bytes()[: -cut or None])
    resumed = Training.resume(tmp_path)
    for _ in range(2):
        resumed.log(resumed.update())
    rows, same = logged(tmp_path), ("update", "missions", "decisions", "value_loss", "kl")
    assert [row["update"] for row in rows] == ["1", "2", "3", "4"]
    assert [[row[name] for name in same] for row in rows[:3]] == [[row[name] for name in same] for row in whole]


def test_a_log_of_other_columns_goes_on_in_line(tmp_path):
    Log(tmp_path, {"update": 1, "old": 0, "kl": 0}).write({"update": 1, "old": 7, "kl": 0.5})
    with open(tmp_path / LOG, "a") as file:
        file.write("2")  # of a 20 that was cut short
    Log(tmp_path, {"update": 20, "kl": 0, "new": 0}).write({"update": 20, "kl": 0.25, "new": 3})
    assert logged(tmp_path) == [{"update": "1", "kl": "0.5", "new": ""}, {"update": "20", "kl": "0.25", "new": "3"}]


def test_the_log_is_in_tensorboard_too(tmp_path, scalars):
    training = run(tmp_path)
    training.log(first := training.update())
    training.save()
    resumed = Training.resume(tmp_path)
    resumed.log(second := resumed.update())
    told = [(name, value, row["update"]) for row in (first, second) for name, value in row.items()]
    purges = [("began", str(tmp_path), 1), ("began", str(tmp_path), 2)]
    np.testing.assert_equal(scalars, [purges[0], *told[: len(first)], purges[1], *told[len(first) :]])


# Beginning with weights


def test_init_begins_with_the_weights_which_stay_until_the_critic_knows_the_missions(tmp_path):
    first = updated(run(tmp_path / "first"), 2)
    first.save()
    second = run(tmp_path / "second", seed=8, init=str(tmp_path / "first" / WEIGHTS), scenario=change(SHORT, n_tasks=5))
    actors = lambda training: [*training.method.robot.parameters(), *training.method.operator.parameters()]
    kept = lambda part, other: all(map(torch.equal, part, other))
    assert kept(actors(second), actors(first)) and kept(second.method.critic.parameters(), first.method.critic.parameters())
    assert second.method.scale.weight.sum() == 0, "returns of other missions say nothing of these"
    assert first.plan.first_updates == 1 and second.aim == "value"
    updated(second, 1)
    assert kept(actors(second), actors(first)) and not kept(second.method.critic.parameters(), first.method.critic.parameters())
    assert second.aim == "improve"
    assert not kept(actors(updated(second, 1)), actors(first))
    with pytest.raises(ValueError, match=r"first.*holds commhg, not mappo"):
        run(tmp_path, "mappo", init=str(tmp_path / "first" / WEIGHTS))
    with pytest.raises(ValueError, match="nowhere"):
        run(tmp_path, init=str(tmp_path / "nowhere.safetensors"))


def test_a_run_goes_on_when_the_weights_that_it_began_with_are_gone(tmp_path):
    run(tmp_path / "first").save()
    updated(run(tmp_path / "second", init=str(tmp_path / "first" / WEIGHTS)), 1).save()
    (tmp_path / "first" / WEIGHTS).unlink()
    assert Training.resume(tmp_path / "second").updates == 1


# Refusals


def rewrite(path, **changes):
    state = torch.load(path, weights_only=True) | changes
    torch.save({name: value for name, value in state.items() if value is not None}, path)


class Foreign:
    pass


def flip_a_bit(path):
    """In the middle of the weights, where torch does not look at the archive's checksum."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


DAMAGES = {
    "cut": lambda path: path.write_bytes(path.read_bytes()[:5000]),
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("hello, world\n" * 100),
    "nonsense": lambda path: path.write_bytes(b"nonsense"),
    "a list": lambda path: torch.save([1, 2], path),
    "a tensor": lambda path: torch.save(torch.zeros(3), path),
    "an object": lambda path: torch.save({"format": Foreign()}, path),
    "another format": lambda path: rewrite(path, format="commhg_mj training 0"),
    "no plan": lambda path: rewrite(path, plan=None),
    "a plan of no JSON": lambda path: rewrite(path, plan="{"),
    "an unknown field": lambda path: rewrite(path, plan='{"scenario": {}, "hyper": {}, "what": 1}'),
    "no networks": lambda path: rewrite(path, method={}),
    "no optimiser": lambda path: rewrite(path, optimizer={"state": {}, "param_groups": []}),
    "no workers": lambda path: rewrite(path, workers=[]),
    "no missions": lambda path: rewrite(
        path, workers=[{"collector": {"seeds": [], "next_seed": 0, "arrays": {}, "scores": []}, "rng": {}}]
    ),
    "counts": lambda path: rewrite(path, counts=[1]),
    "a flipped bit": lambda path: flip_a_bit(path),
}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("saved")
    updated(run(folder), 1).save()
    return folder


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_or_foreign_state_is_refused_by_name(saved, tmp_path, damage):
    path = tmp_path / STATE
    path.write_bytes((saved / STATE).read_bytes())
    DAMAGES[damage](path)
    with pytest.raises(ValueError, match=str(path)) as caught:
        Training.resume(tmp_path)
    assert "\n" not in str(caught.value)
    assert ("another format" in str(caught.value)) == (damage == "another format")


@pytest.mark.parametrize("workers", [0, 33, "2", 1.5])
def test_a_plan_has_as_many_workers_as_missions_at_most(workers):
    with pytest.raises(ValueError, match=r"workers must be a whole number in 1\.\.32, is "):
        Plan("mappo", SHORT, workers=workers)


def test_a_device_that_is_missing_is_no_damage(saved, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match="device: torch finds no CUDA"):
        Training.resume(saved, device="cuda")


def test_a_run_of_several_workers_is_not_resumed_by_one(tmp_path):
    training = run(tmp_path)
    training.plan = dataclasses.replace(training.plan, workers=2)
    training.save()
    with pytest.raises(ValueError, match=f"{tmp_path / STATE} is a run of 2 workers, not 1"):
        Training.resume(tmp_path)


def test_a_folder_without_a_run_is_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match=f"{tmp_path}.*no run to resume"):
        Training.resume(tmp_path)


def reweigh(path, tensors=lambda t: t, **changes):
    with safe_open(path, "pt") as file:
        metadata = file.metadata() | changes
    save_file(tensors(load_file(path)), path, {name: value for name, value in metadata.items() if value is not None})


WEIGHT_DAMAGES = {
    "cut": lambda path: path.write_bytes(path.read_bytes()[:5000]),
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("hello, world\n" * 100),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
    "gone": lambda path: path.unlink(),
    "no word on it": lambda path: save_file({"x": torch.zeros(2)}, path),
    "another format": lambda path: reweigh(path, format="commhg_mj weights 0"),
    "other features": lambda path: reweigh(path, schema="[1, 2]"),
    "no schema": lambda path: reweigh(path, schema=None),
    "an unknown method": lambda path: reweigh(path, method="nonsense"),
    "no method": lambda path: reweigh(path, method=None),
    "another method": lambda path: reweigh(path, method="mappo"),
    "facts of no JSON": lambda path: reweigh(path, facts="{"),
    "no facts": lambda path: reweigh(path, facts=None),
    "facts of no object": lambda path: reweigh(path, facts="[1]"),
    "no number": lambda path: reweigh(path, lambda t: t | {"robot.itself.0.bias": t["robot.itself.0.bias"] * torch.nan}),
    "an infinite bias": lambda path: reweigh(path, lambda t: t | {"robot.itself.0.bias": t["robot.itself.0.bias"] / 0.0}),
    "older rules": lambda path: reweigh(path, format="commhg_mj weights 1"),
    "another critic's features": lambda path: reweigh(path, schema=json.dumps(SCHEMA).replace('"pending"', '"pending_share"')),
    "a tensor less": lambda path: reweigh(path, lambda t: dict(list(t.items())[1:])),
    "a shape": lambda path: reweigh(path, lambda t: t | {"robot.itself.0.weight": torch.zeros(2, 2)}),
}


@pytest.mark.parametrize("plans", [False, True])
def test_columns_of_plans_matter_to_who_reads_them_alone(tmp_path, plans):
    path = tmp_path / WEIGHTS
    save_weights(make_method("mappo", plans), path, {})
    reweigh(path, schema=json.dumps(SCHEMA).replace('"is_pick"', '"is_chosen"'))
    if plans:
        with pytest.raises(ValueError, match="other features"):
            load_weights(path)
    else:
        assert load_weights(path)[0].plan is None


@pytest.mark.parametrize("damage", WEIGHT_DAMAGES)
def test_damaged_or_foreign_weights_are_refused_by_name(saved, tmp_path, damage):
    path = tmp_path / WEIGHTS
    path.write_bytes((saved / WEIGHTS).read_bytes())
    WEIGHT_DAMAGES[damage](path)
    with pytest.raises(ValueError, match=str(path)) as caught:
        load_weights(path)
    assert "\n" not in str(caught.value)


def test_a_number_that_is_not_finite_is_named_by_its_tensor(saved, tmp_path):
    path = tmp_path / WEIGHTS
    path.write_bytes((saved / WEIGHTS).read_bytes())
    WEIGHT_DAMAGES["an infinite bias"](path)
    with pytest.raises(ValueError, match="robot.itself.0.bias holds a number that is not finite"):
        load_weights(path)


def test_weights_say_where_they_come_from(saved):
    method, facts = load_weights(saved / WEIGHTS)
    assert method.name == "commhg" and not method.training
    assert plan_from_json(json.dumps(facts["plan"])).scenario == SHORT and facts["updates"] == 1


def test_weights_are_those_that_were_saved(saved, tmp_path):
    method, facts = load_weights(saved / WEIGHTS)
    save_weights(method, tmp_path / WEIGHTS, facts)
    again, same = load_weights(tmp_path / WEIGHTS)
    assert facts == same
    assert all(map(torch.equal, method.state_dict().values(), again.state_dict().values()))


def test_numbers_that_are_none_stop_the_run(tmp_path, monkeypatch):
    training = updated(run(tmp_path), 1)
    training.save()
    before = (tmp_path / STATE).read_bytes()
    collect = training.collector.collect
    spoil = lambda *a: (data := collect(*a))._replace(returns=tuple(part * np.nan for part in data.returns))
    monkeypatch.setattr(training.collector, "collect", spoil)
    with pytest.raises(FloatingPointError, match=f"update 2: .*value_loss is nan.*{tmp_path}"):
        training.update()
    assert (tmp_path / STATE).read_bytes() == before and Training.resume(tmp_path).updates == 1


def test_validation_changes_no_bits(tmp_path, monkeypatch):
    monkeypatch.setattr(train, "VALIDATE_EVERY", 1)
    watched, alone = (run(tmp_path / name, first_updates=0) for name in ("watched", "alone"))
    seen = [watched.update()["validation"] for _ in range(2)]
    monkeypatch.setattr(train, "VALIDATE_EVERY", 10**9)
    assert all(np.isnan(alone.update()["validation"]) for _ in range(2))
    assert np.isfinite([*seen, watched.validation.greedy]).all()
    assert same_bits(watched, alone)
