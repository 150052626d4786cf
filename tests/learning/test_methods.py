"""Every registered learned method: it learns, is saved, is found by its file, flies, and knows no more than it may."""

import numpy as np
import pytest
import torch
from flying import Wanderer, copied, differences, fingerprint, fly
from learners import FAMILIES, NAMES, SHORT, run, shaken, updated
from mission.test_secrets import ARRAYS, keep_public, overwrite, scramble
from strategies import change

from commhg_mj import policies
from commhg_mj.flights.fly import fly as fly_missions
from commhg_mj.learning import pretrained
from commhg_mj.learning.learned_policy import VARIANTS, LearnedPolicy
from commhg_mj.learning.registry import find_method
from commhg_mj.learning.weights import save_weights
from commhg_mj.mission.batch import MissionBatch, stay
from commhg_mj.mission.decide import Decisions
from commhg_mj.policies.schedule import follow_schedule
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.study.evaluation import table_names

every_method = pytest.mark.parametrize("name", NAMES)
every_family = pytest.mark.parametrize("name", FAMILIES)
LONG = change(SHORT, time_limit=150, released_at_start=0.5)


def untrained(name, seed=0):
    """A method that is not indifferent between its choices."""
    torch.manual_seed(seed)
    return shaken(find_method(name)())


def arrays_of(decisions):
    return [column.tolist() for column in decisions]


def test_an_unknown_method_is_refused_by_name():
    with pytest.raises(ValueError, match="'nonsense': use .*commhg"):
        find_method("nonsense")


@every_method
def test_a_method_has_its_parts(name):
    method = find_method(name)()
    assert method.name == name and isinstance(method.communicates, bool) and method.__doc__
    parts = {key.partition(".")[0] for key in method.state_dict()}
    assert parts == {"robot", "operator", "critic", "scale"}
    assert all(part.dtype == torch.float32 for part in method.state_dict().values())


@every_family
def test_a_method_learns_is_saved_found_and_flies(name, tmp_path):
    training = run(tmp_path, name, first_updates=0)
    before = {key: value.clone() for key, value in training.method.state_dict().items()}
    updated(training, 1).save()
    after = training.method.state_dict()
    # Every part of both actors and of the critic has been moved.
    moved = {key.partition(".")[0] for key in after if not torch.equal(after[key], before[key])}
    assert moved == {"robot", "operator", "critic", "scale"}
    still = [key for key in after if torch.equal(after[key], before[key])]
    assert still == [], "parameters without a gradient"
    path = str(tmp_path / "weights.safetensors")
    info = policies.find_policy(path)
    assert not info.is_privileged and policies.label_of(path).startswith(f"{tmp_path.name}-")
    for way in (path, f"{path}+drawn"):
        scores = fly_missions(SHORT, way, range(3))
        assert all(0 <= score.twcr <= 1 for score in scores)
        assert fly_missions(SHORT, way, range(3)) == scores
    assert scores[0].messages["broadcast"]["attempted"] > 0


@every_family
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_method_flies_every_scenario_with_legal_decisions(name, scenario):
    batch = MissionBatch(scenario, [1])
    policy = LearnedPolicy(untrained(name), batch)
    fly(batch, policy, seconds=30)
    assert batch.time[0] >= 30


@every_family
@pytest.mark.parametrize("sizes", [(1, 0, 0, 1), (0, 1, 0, 1), (1, 1, 5, 2), (0, 12, 9, 30), (60, 4, 3, 70)])
def test_a_method_flies_any_team(name, sizes):
    limit = 40 if sum(sizes[:2]) < 64 else 12
    scenario = change(SHORT, time_limit=limit, **dict(zip(("n_uav", "n_ugv", "n_operators", "n_tasks"), sizes)))
    batch = MissionBatch(scenario, [1, 2])
    assert fly(batch, LearnedPolicy(untrained(name), batch)).over.all()


@every_method
def test_a_method_decides_from_observations_alone(name):
    """Scrambled true state, and another table of the tasks that are not released: the same decisions."""
    batch, rng = MissionBatch(LONG, [3, 4], limitation="low"), np.random.default_rng(0)
    method, hidden = untrained(name), 0
    for _ in range(20):
        seen, truth = batch.observations, copied(batch.state)
        frozen = copied(seen)
        one = LearnedPolicy(method, batch)
        decisions = one(seen)
        assert differences(seen, frozen) == [], "observations are not a notepad"
        scramble(batch.state, rng)
        keep_public(batch.state, truth)
        secret = truth.tasks["released"] == 0
        for field in ("x", "y", "difficulty", "value", "deadline", "decay"):
            batch.state.tasks[field][secret] = rng.uniform(1, 100, secret.sum())
        hidden += secret.sum()
        other = LearnedPolicy(method, batch)
        scramble(batch.state, rng)
        again = other(seen)
        overwrite(batch.state, truth)
        assert secret.sum() == 0 or not np.array_equal(one.public, other.public)
        assert isinstance(again, Decisions) and arrays_of(decisions) == arrays_of(again)
        batch.step(decisions)
    assert hidden > 0 and len(ARRAYS) > 10


@every_method
def test_a_method_uses_what_it_may_know(name):
    """The check above can fail: other observations, other scores."""
    batch = fly(MissionBatch(LONG, range(40)), Wanderer(), 40)
    seen, scores, rng = batch.observations, [], np.random.default_rng(0)
    torch.manual_seed(0)
    method, other = shaken(find_method(name)(), scale=1.0), copied(seen)
    for field, most in (("distance", 500.0), ("x", 500.0), ("y", 500.0), ("progress", 1.0)):
        other.robot_tasks[field] = rng.uniform(0, most, other.robot_tasks.shape)
    other.operators["fatigue"] = rng.uniform(0, 1, len(other.operators))
    for observations in (seen, other):
        policy = LearnedPolicy(method, batch)
        with torch.no_grad():
            scores.append(policy.actors.score(policy.builder.robots(observations), policy.public)[1].task)
    assert not torch.allclose(*scores, atol=1e-2)


@every_method
def test_who_follows_the_schedule_follows_it_exactly(name):
    batch = MissionBatch(LONG, range(3))
    method = untrained(name)
    policy, spoken, differs = LearnedPolicy(method, batch), 0, False
    for _ in range(25):
        if batch.over.all():
            break
        decisions = policy(batch.observations)
        wanted = stay(batch.observations)._replace(task=decisions.task)
        follow_schedule(batch.observations, wanted, True)
        mine, schedule = arrays_of(decisions)[1:4], arrays_of(wanted)[1:4]
        if not method.communicates:
            assert mine == schedule
        differs |= mine != schedule
        spoken += wanted.broadcast.sum()
        batch.step(decisions)
    assert spoken > 0 and differs == method.communicates


@every_method
def test_flights_take_the_best_and_draws_are_the_missions_own(name):
    batch = fly(MissionBatch(LONG, range(12)), Wanderer(), 40)  # at first nearly everything is prescribed
    method = untrained(name)
    best = [arrays_of(LearnedPolicy(method, batch)(batch.observations)) for _ in range(2)]
    policy, again = LearnedPolicy(method, batch, "drawn"), LearnedPolicy(method, batch, "drawn")
    drawn = [arrays_of(policy(batch.observations)) for policy in (policy, policy, again)]
    assert best[0] == best[1] != drawn[0]
    assert drawn[0] == drawn[1] == drawn[2], "draws hang on the mission's seed and the time, on nothing that was drawn before"


@every_family
def test_a_mission_does_not_depend_on_its_neighbours(name):
    """The contract of every policy (tests/contracts): results do not depend on which missions fly side by side."""

    def ends(seeds):
        batch = MissionBatch(SHORT, seeds)
        fly(batch, LearnedPolicy(method, batch))
        return [fingerprint(batch.state, slice(e, e + 1)) for e in range(len(seeds))]

    method = untrained(name)
    assert ends([1, 2]) == ends([1, 2]) == ends([2, 1])[::-1] == ends([1]) + ends([2])


def test_a_trained_method_may_lack_something(tmp_path):
    """No queries; gates by chance; draws in place of the best; and nothing else changes."""
    path = tmp_path / "weights.safetensors"
    method = untrained("commhg")
    torch.nn.init.constant_(method.robot.gate[2].bias, -50.0)  # it never speaks
    torch.nn.init.constant_(method.robot.nobody[2].bias, -5.0)  # it asks where it can
    save_weights(method, path, {})
    whole, silent, chatty = (
        fly_missions(LONG, name, range(4)) for name in (str(path), f"{path}+no-query", f"{path}+random-gates")
    )
    sent = lambda scores, kind: sum(score.messages[kind]["attempted"] for score in scores)
    assert sent(whole, "query") > 0 and sent(silent, "query") == 0 and sent(chatty, "query") > 0
    assert sent(whole, "broadcast") == sent(silent, "broadcast") == 0 < sent(chatty, "broadcast")
    assert policies.label_of(f"{path}+no-query") == f"{policies.label_of(path)}+no-query"
    assert set(pretrained.VARIANTS) == set(VARIANTS) - {""}
    save_weights(untrained("mappo"), path, {})
    whole, silent = (fly_missions(LONG, name, range(4)) for name in (str(path), f"{path}+no-query"))
    assert sent(whole, "query") > 0 == sent(silent, "query"), "who follows the schedule asks by it, or never"
    with pytest.raises(ValueError, match="mappo.random-gates: mappo speaks by rule"):
        fly_missions(LONG, f"{path}+random-gates", range(1))
    with pytest.raises(ValueError, match="unknown policy 'commhg.nothing'"):
        policies.find_policy("commhg+nothing")


def test_weights_come_along_for_every_method_and_fly_by_name(tmp_path, monkeypatch):
    assert set(pretrained.trained_methods()) >= {*NAMES, "commhg-rollouts"}
    assert all(policies.find_policy(name).make for name in (*NAMES, "commhg+no-query", "commhg-rollouts+drawn"))
    monkeypatch.setattr(pretrained, "WEIGHTS", tmp_path)
    for name, method in {"commhg-medium": "commhg", "ata-hrl-small": "ata-hrl", "commhg-rollouts-small": "mappo"}.items():
        path, known = tmp_path / f"{name}.safetensors", name.rpartition("-")[0]
        save_weights(untrained(method), path, {})
        assert known in pretrained.trained_methods()
        assert fly_missions(SHORT, known, [1]) == fly_missions(SHORT, str(path), [1])
        assert policies.find_policy(known).flown_in(SHORT) == policies.find_policy(str(path)).flown_in(SHORT)
    with pytest.raises(ValueError, match="unknown policy 'commgh'"):
        policies.find_policy("commgh")


def test_labels_differ_when_weights_do(tmp_path):
    paths = [tmp_path / run / "seed0" / "weights.safetensors" for run in ("e1", "e2")]
    for path, seed in zip(paths, (0, 1)):
        path.parent.mkdir(parents=True)
        save_weights(untrained("commhg", seed), path, {})
    first, second = map(policies.label_of, paths)
    assert first != second and first.startswith("seed0-") and second.startswith("seed0-")
    assert len(set(table_names([*map(str, paths), "greedy", f"{paths[0]}+no-query"]))) == 4
    save_weights(untrained("commhg", 2), paths[0], {})
    assert policies.label_of(paths[0]) not in (first, second), "written anew"
    paths[1].write_bytes(paths[0].read_bytes())
    assert table_names([*map(str, paths), "omniscient"]) == [*map(str, paths), "omniscient (privileged)"], "one content twice"
    with pytest.raises(ValueError, match="none.safetensors: No such file"):
        policies.label_of("none.safetensors")


def test_weights_that_were_written_anew_are_read_anew(tmp_path):
    path = tmp_path / "weights.safetensors"
    flown = []
    for seed in (0, 1):
        save_weights(untrained("commhg", seed), path, {})
        batch, policy = policies.prepare(str(path), SHORT, range(4))
        flown.append(policy.actors.method.state_dict()["robot.itself.0.weight"])
    assert not torch.equal(*flown)
