"""Contracts of everything that is registered: whatever is added is tested here without a line more."""

import dataclasses

import gymnasium
import numpy as np
import pytest
from flying import Wanderer, copied, differences, fingerprint, fly
from strategies import change

from commhg_mj.base.terms import Kind
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.decide import Decisions
from commhg_mj.mission.propagation import link_between, link_to_station
from commhg_mj.mission.state import LUCK
from commhg_mj.policies import POLICIES, prepare
from commhg_mj.radio import LINK_MODELS
from commhg_mj.scenarios import LIMITATIONS, SCENARIOS, CommunicationRules, describe, from_json, load_scenario, to_json
from commhg_mj.tasks import ALL_TASKS, MissionEnv, MissionVectorEnv, load, parallel_env
from commhg_mj.tasks.registration import ID

SHORT = change(SCENARIOS["small"], time_limit=120)
every_scenario = pytest.mark.parametrize("scenario", SCENARIOS)
every_policy = pytest.mark.parametrize("policy", POLICIES)
every_link_model = pytest.mark.parametrize("links", LINK_MODELS)
every_limitation = pytest.mark.parametrize("limitation", LIMITATIONS)


@every_scenario
def test_a_scenario_is_itself_after_a_round_trip(scenario):
    built = SCENARIOS[scenario]
    assert built.name == scenario and load_scenario(scenario) is built
    assert from_json(to_json(built)) == built and len(list(describe(built))) > 70


@every_scenario
@every_policy
def test_every_policy_flies_every_scenario(scenario, policy):
    batch, pilot = prepare(policy, scenario, [1])
    fly(batch, pilot, seconds=60)
    assert batch.time[0] >= 60 and batch.state.counters["attempted"].sum() > 0


@every_policy
@every_link_model
@every_limitation
def test_every_policy_flies_with_every_link_model_and_limitation(policy, links, limitation):
    batch, pilot = prepare(policy, SHORT, [1, 2], links=links, limitation=limitation)
    fly(batch, pilot)
    assert batch.over.all() and all(0 <= score.twcr <= 1 for score in batch.scores())


@every_policy
def test_a_policy_answers_in_the_shape_of_its_observations(policy):
    batch, pilot = prepare(policy, SHORT, [1, 2, 3])
    for _ in range(20):
        seen = batch.observations
        frozen = copied(seen)
        decisions = pilot(seen)
        assert isinstance(decisions, Decisions) and differences(seen, frozen) == [], "observations are not a notepad"
        assert [len(values) for values in decisions] == [len(seen.robots)] * 4 + [len(seen.operators)]
        batch.step(decisions)


@every_policy
def test_a_policy_is_deterministic_and_seeds_matter(policy):
    def ends(seeds):
        batch, pilot = prepare(policy, SHORT, seeds)
        fly(batch, pilot)
        return [fingerprint(batch.state, slice(e, e + 1)) for e in range(len(seeds))]

    assert ends([1, 2]) == ends([1, 2]) == ends([2, 1])[::-1]
    assert len(set(ends(range(5)))) == 5


@every_policy
@pytest.mark.parametrize("sizes", [(1, 0, 0, 1), (0, 1, 0, 1), (1, 1, 5, 2), (0, 3, 1, 30), (32, 32, 3, 70)])
def test_a_policy_flies_the_smallest_and_the_largest_teams(policy, sizes):
    names = ("n_uav", "n_ugv", "n_operators", "n_tasks")
    batch, pilot = prepare(policy, change(SHORT, **dict(zip(names, sizes))), [1])
    assert fly(batch, pilot).over.all()


@every_link_model
def test_links_are_shares_symmetric_and_pure(links):
    batch = MissionBatch("medium", [1], links=links)
    fly(batch, Wanderer(), seconds=120)
    before, mission = copied(batch.state), batch.state.missions[0]
    n = batch.scenario.n_robots
    shares = np.array([[link_between(mission, a, b, Kind.BROADCAST) for b in range(n)] for a in range(n)])
    assert np.all((shares >= 0) & (shares <= 1)) and np.all((np.diag(shares) > 0) == (links != "silent"))
    np.testing.assert_allclose(shares, shares.T, rtol=1e-9)
    assert all(0 <= link_to_station(mission, r, Kind.QUERY) <= 1 for r in range(n))
    assert differences(before, batch.state) == []


@every_link_model
def test_co_located_radios_hear_each_other(links):
    batch = MissionBatch("small", [1], links=links)
    batch.state.robots["x"], batch.state.robots["y"] = 100.0, 20.0
    assert (link_between(batch.state.missions[0], 0, 1, Kind.BROADCAST) > 0) == (links != "silent")


@every_limitation
def test_every_limitation_has_its_numbers(limitation):
    index, rules = LIMITATIONS.index(limitation), CommunicationRules()
    batch = MissionBatch("small", [1], limitation=limitation)
    assert batch.rules["radio"]["range"][0] == rules.range[index] * 500
    assert batch.rules["radio"]["on_time"][0] == pytest.approx(1 - rules.unavailable_or_delayed[index])


def test_limitations_grow_harsher_in_their_order():
    rules = CommunicationRules()
    assert list(rules.range) == sorted(rules.range, reverse=True)
    assert list(rules.unavailable_or_delayed) == sorted(rules.unavailable_or_delayed)
    assert len(rules.range) == len(rules.unavailable_or_delayed) == len(LIMITATIONS)


def test_every_message_kind_has_its_size():
    sizes = {f"{kind.name.lower()}_bytes" for kind in Kind}
    assert sizes == {field.name for field in dataclasses.fields(CommunicationRules) if field.name.endswith("_bytes")}


@every_policy
def test_scores_are_finite_shares_counts_and_times(policy):
    batch, pilot = prepare(policy, SHORT, range(3))
    for score in fly(batch, pilot).scores():
        values = dataclasses.asdict(score)
        messages, luck = values.pop("messages"), values.pop("luck")
        assert all(np.isfinite(value) for value in [*values.values(), *luck.values()]) and set(luck) == set(LUCK)
        assert set(messages) == {kind.name.lower() for kind in Kind}
        assert values["bytes_sent"] == sum(counts["bytes"] for counts in messages.values())
        for counts in messages.values():
            ends = ("underway", "delivered", "out_of_range", "terrain", "lost", "no_tokens", "expired")
            assert counts["attempted"] == sum(counts[end] for end in ends)


@every_scenario
def test_every_interface_offers_every_scenario(scenario):
    assert ("surveillance", scenario) in ALL_TASKS and ID.format(scenario) in gymnasium.registry
    teams = [load("surveillance", scenario, {"pictures": False}).task.team]
    teams += [make(scenario=scenario).team for make in (MissionEnv, MissionVectorEnv, parallel_env)]
    teams += [gymnasium.make(ID.format(scenario)).unwrapped.team, gymnasium.make_vec(ID.format(scenario)).team]
    assert all(team.scenario is SCENARIOS[scenario] for team in teams)


@every_link_model
@every_limitation
def test_every_interface_flies_with_every_link_model_and_limitation(links, limitation):
    options, nothing = {"links": links, "limitation": limitation, "period": 60}, np.zeros(14, int)
    control = load("surveillance", "small", {"random": 1, "pictures": False, **options})
    team, vector, agents = (make(scenario="small", **options) for make in (MissionEnv, MissionVectorEnv, parallel_env))
    for env in (team, vector, agents):
        env.reset(seed=1)
    control.reset()
    ends = control.step(nothing).reward, team.step(nothing)[1], vector.step(nothing[None])[1][0], agents.step({})[1]["uav_0"]
    assert len(set(ends)) == 1
    for env in (control.task, team, vector, agents):
        assert (env.team.batch.links, env.team.batch.limitation) == (links, limitation)
