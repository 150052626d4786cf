"""The PettingZoo environment: its checkers, who is there, who is due, what agents may do, what they share."""

import copy
import pickle
import warnings

import numpy as np
import pytest
from flying import copied, differences, fingerprint
from pettingzoo import ParallelEnv
from pettingzoo.test import parallel_api_test, parallel_seed_test
from playing import BRIEF, BRITTLE, LONELY, Dice
from strategies import change

from commhg_mj.base.terms import Activity
from commhg_mj.radio import LINK_MODELS
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.tasks import MissionEnv, parallel_env

every_scenario = pytest.mark.parametrize("scenario", SCENARIOS)
OURS = {"brief": BRIEF, "brittle": BRITTLE, "lonely": LONELY}
odd_scenarios = pytest.mark.parametrize("scenario", OURS.values(), ids=OURS)


def sample(env, observations):
    """A random open action of every agent."""
    return {agent: env.action_space(agent).sample(observations[agent]["action_mask"]) for agent in env.agents}


def fly(env, seed=None, most_steps=10_000):
    """Yield (observations, rewards, terminations, truncations, infos) of a mission, its start included."""
    observations, infos = env.reset(seed=seed)
    for i, agent in enumerate(env.possible_agents):
        env.action_space(agent).seed(i)
    yield observations, {}, {}, {}, infos
    while env.agents and most_steps:
        step, most_steps = env.step(sample(env, observations)), most_steps - 1
        observations = step[0]
        yield step


def nested(one, two):
    """Are two nested observations equal?"""
    np.testing.assert_equal(one, two)
    return True


@every_scenario
def test_pettingzoos_checker_has_nothing_to_say(scenario):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(parallel_env(scenario), num_cycles=20)
        parallel_api_test(parallel_env(scenario, period=60), num_cycles=40)


@odd_scenarios
def test_pettingzoos_checker_along_whole_missions(scenario):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(parallel_env(scenario), num_cycles=1000)


@every_scenario
def test_pettingzoos_checker_of_seeds(scenario):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_seed_test(lambda: parallel_env(scenario), num_cycles=2)


@every_scenario
def test_agents_are_the_team(scenario):
    env, numbers = parallel_env(scenario), SCENARIOS[scenario]
    assert isinstance(env, ParallelEnv) and env.agents == [] and env.max_num_agents == len(env.possible_agents)
    counts = {"uav": numbers.n_uav, "ugv": numbers.n_ugv, "human": numbers.n_operators}
    assert env.possible_agents == [f"{kind}_{i}" for kind, n in counts.items() for i in range(n)]
    observations, infos = env.reset(seed=1)
    assert env.agents == env.possible_agents == list(observations) == list(infos) and env.agents is not env.possible_agents
    assert env.unwrapped is env and env.metadata["is_parallelizable"] and env.metadata["name"] == "commhg_mj_v0"


@every_scenario
def test_spaces_stay_the_same_objects(scenario):
    env = parallel_env(scenario)
    spaces = [(env.observation_space(agent), env.action_space(agent)) for agent in env.possible_agents]
    env.reset(seed=1)
    for agent, (sees, does) in zip(env.possible_agents, spaces):
        assert env.observation_space(agent) is sees and env.action_space(agent) is does
    assert len({id(does) for _, does in spaces}) == len(spaces), "each is seeded alone"


def test_names_may_be_keywords_of_a_method():
    """As TorchRL's specs take them."""
    env = parallel_env(BRIEF)
    for agent in env.possible_agents:
        names = set(env.observation_space(agent)["observation"])
        assert all(name.isidentifier() for name in names) and not names & {"self", "cls"}


@every_scenario
@pytest.mark.parametrize("links", LINK_MODELS)
def test_observations_lie_in_their_spaces(scenario, links):
    env = parallel_env(scenario, links=links, period=60)
    for observations, *_ in fly(env, 3, most_steps=12):
        for agent, seen in observations.items():
            assert env.observation_space(agent).contains(seen), agent


@odd_scenarios
def test_observations_lie_in_their_spaces_along_whole_missions(scenario):
    env = parallel_env(scenario)
    for observations, *_ in fly(env, 3):
        for agent, seen in observations.items():
            assert env.observation_space(agent).contains(seen), agent
    assert not env.agents


def test_who_is_not_due_keeps_what_it_saw_and_has_only_keep():
    env, waits = parallel_env(BRIEF), 0
    steps = list(fly(env, 7))
    for (before, *_), (now, *_, infos) in zip(steps, steps[1:]):
        for agent, seen in now.items():
            masks = seen["action_mask"] if isinstance(seen["action_mask"], tuple) else (seen["action_mask"],)
            nested(infos[agent]["action_mask"], seen["action_mask"])
            if not infos[agent]["due"]:
                waits += 1
                assert nested(seen["observation"], before[agent]["observation"])
                assert all(mask.tolist() == [1] + [0] * (len(mask) - 1) for mask in masks)
            else:
                assert any(mask[1:].any() for mask in masks), "whoever is due can do something"
                time = seen["observation"]["own"][0]
                assert time == infos[agent]["time"]
    assert waits > 100 and all(info["due"] for info in steps[0][-1].values())


def test_the_reward_is_the_teams():
    sturdy = change(BRIEF, malfunction=0.0)
    env, team, dice = parallel_env(sturdy), MissionEnv(sturdy), Dice(sturdy)
    env.reset(seed=3), team.reset(seed=3)
    while env.agents:
        action, agents = dice.any(), env.agents
        robots = action[:12].reshape(4, 3)
        _, rewards, terminations, truncations, infos = env.step(dict(zip(agents, [*robots, *action[12:]])))
        _, reward, is_over, _, info = team.step(action)
        assert rewards == dict.fromkeys(agents, reward) and set(truncations.values()) == {False}
        assert set(terminations.values()) == {is_over}
        assert all((i["time"], i["elapsed"]) == (info["time"], info["elapsed"]) for i in infos.values())
        assert ("twcr" in infos["uav_0"]) == is_over
    assert infos["human_1"]["twcr"] == info["twcr"] and env.agents == []


def test_robots_that_fail_leave():
    env, leaves, dice = parallel_env(BRITTLE), [], Dice(BRITTLE)
    env.reset(seed=2)
    while env.agents:
        agents, action = env.agents, dice.any()
        actions = dict(zip(env.possible_agents, [*action[:12].reshape(4, 3), *action[12:]]))
        actions |= {agent: "whatever" for agent in env.possible_agents if agent not in agents}
        before = copied(env.team.batch.state)
        twin = copy.deepcopy(env)
        step, without = env.step(actions), twin.step({agent: actions[agent] for agent in agents})
        assert nested(step, without), "actions of those who are gone are ignored"
        assert fingerprint(env.team.batch.state) == fingerprint(twin.team.batch.state)
        observations, rewards, terminations, _, infos = step
        assert set(observations) == set(rewards) == set(terminations) == set(infos) == set(agents)
        failed = env.team.batch.state.robots["activity"][0] == Activity.FAILED
        ended = {agent for agent, is_over in terminations.items() if is_over}
        assert env.agents == [agent for agent in agents if agent not in ended]
        if env.agents:
            assert ended == {agent for agent, has in zip(env.possible_agents, failed) if has} & set(agents)
            leaves += sorted(ended)
        assert differences(before, env.team.batch.state), "time goes on"
    assert len(leaves) >= 2 and not {"human_0", "human_1"} & set(leaves)
    assert env.reset()[0].keys() == set(env.possible_agents), "a new mission has them all"


def test_agents_without_an_action_stay():
    env, other = parallel_env(BRIEF), parallel_env(BRIEF)
    env.reset(seed=1), other.reset(seed=1)
    for _ in range(20):
        one = env.step({agent: np.zeros(3, int) if agent[0] == "u" else 0 for agent in env.agents})
        assert nested(one, other.step({}))


@pytest.mark.parametrize("action", [np.int64(3), np.array(3), 3, np.uint8(3)])
def test_numbers_of_every_kind_are_actions_of_humans(action):
    env, other = parallel_env(BRIEF), parallel_env(BRIEF)
    env.reset(seed=1), other.reset(seed=1)
    for _ in range(4):  # until the robot has been heard of
        env.step({}), other.step({})
    assert nested(env.step({"human_0": action}), other.step({"human_0": 3}))
    assert env.team.batch.state.operators["robot"][0, 0] == 1


@pytest.mark.parametrize("action", [[4, 1, 0], (4, 1, 0), np.array([4, 1, 0], np.float32), np.array([4, 1, 0], np.int8)])
def test_numbers_of_every_kind_are_actions_of_robots(action):
    env, other = parallel_env(BRIEF), parallel_env(BRIEF)
    env.reset(seed=1), other.reset(seed=1)
    assert nested(env.step({"uav_0": action}), other.step({"uav_0": np.array([4, 1, 0])}))


@pytest.mark.parametrize(
    "agent, action, said",
    [
        ("uav_9", [0, 0, 0], "unknown agent 'uav_9'"),
        ("uav0", [0, 0, 0], "unknown agent 'uav0'"),
        (0, [0, 0, 0], "unknown agent 0"),
        ("uav_0", [0, 0], "action of uav_0 "),
        ("uav_0", [0, 0, 0, 0], "action of uav_0 "),
        ("uav_0", [[0, 0, 0]], "action of uav_0 "),
        ("uav_0", [], "action of uav_0 "),
        ("uav_0", "left", "action of uav_0 "),
        ("uav_0", {"task": 1}, "action of uav_0 "),
        ("uav_0", 0, "action of uav_0 "),
        ("uav_0", [0], "action of uav_0 "),
        ("uav_0", "0", "action of uav_0 "),
        ("uav_0", ["0", "0", "0"], "action of uav_0 "),
        ("human_0", "0", "action of human_0 "),
        ("uav_0", [True, False, False], "action of uav_0 "),
        ("human_0", [0, 0], "action of human_0 "),
        ("human_1", [], "action of human_1 "),
        ("ugv_1", [-1, 0, 0], "ugv.?1 task must lie in 0..23"),
        ("ugv_1", [24, 0, 0], "ugv.?1 task must lie in 0..23"),
        ("ugv_1", [0, 2, 0], "ugv.?1 broadcast must lie in 0..1"),
        ("ugv_1", [0, 0, 4], "ugv.?1 message must lie in 0..3"),
        ("human_1", 6, "1 robot must lie in 0..5"),
        ("human_1", -1, "1 robot must lie in 0..5"),
        ("ugv_0", [0.5, 0, 0], "ugv.?0"),
        ("human_0", 0.5, "human_0|operator0"),
        ("ugv_0", [np.nan, 0, 0], "ugv.?0"),
        ("human_0", np.inf, "human_0|operator0"),
        ("human_0", None, "human_0|operator0"),
        ("uav_0", [0, [1, 2], 0], "action of uav_0 "),
        ("human_0", [[0], [1, 2]], "action of human_0 "),
    ],
)
def test_impossible_actions_are_refused_by_name_and_change_nothing(agent, action, said):
    env = parallel_env(BRIEF)
    env.reset(seed=1)
    env.step({})
    before = fingerprint(env.team.batch.state)
    kept = copied(env.team.tables)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ValueError, match=said):
            env.step({"uav_1": np.array([0, 0, 0]), agent: action})
    assert fingerprint(env.team.batch.state) == before and differences(kept, env.team.tables) == []
    assert env.agents == env.possible_agents


def test_seeds():
    env, other = parallel_env(BRIEF), parallel_env(BRIEF)

    def seeds(env, seed):
        return [(env.reset(seed=s), env.team.batch.seeds[0])[1] for s in (seed, None, None)]

    assert seeds(env, 7) == seeds(other, 7) and seeds(env, 7)[0] == 7 and len(set(seeds(env, 7))) == 3
    assert seeds(env, 7)[1:] != seeds(env, 8)[1:]
    gym = MissionEnv(BRIEF)
    assert [gym.reset(seed=s)[1]["seed"] for s in (7, None, None)] == seeds(env, 7), "as the Gymnasium environment draws them"
    env = parallel_env(BRIEF, seeds=[4, 5])
    assert {(env.reset(), env.team.batch.seeds[0])[1] for _ in range(20)} == {4, 5}


@pytest.mark.parametrize("copy_of", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
def test_a_copy_flies_on_to_the_same_bits(copy_of):
    env = parallel_env(BRITTLE)
    (*_, (observations, *_)) = fly(env, 2, most_steps=60)
    other = copy_of(env)
    while env.agents:
        actions = sample(env, observations)
        one, two = env.step(actions), other.step(actions)
        assert nested(one, two) and env.agents == other.agents
        observations = one[0]
    assert nested(env.reset(), other.reset())


def test_what_was_returned_stays_as_it_was():
    steps = [(step, copy.deepcopy(step)) for step in fly(parallel_env(BRIEF), 3)]
    assert all(nested(step, as_it_was) for step, as_it_was in steps)


def test_environments_do_not_disturb_one_another():
    alone = list(fly(parallel_env(BRIEF), 1, most_steps=15))
    for (k, step), _ in zip(enumerate(fly(parallel_env(BRIEF), 1, most_steps=15)), fly(parallel_env(BRIEF), 2)):
        assert nested(alone[k], step)


def test_pictures():
    env = parallel_env(change(BRIEF, n_uav=1), render_mode="rgb_array", size=(192, 108), period=20)
    env.reset(seed=1)
    first = env.render()
    env.step({"uav_0": [3, 0, 0]})
    later = env.render()
    assert first.shape == (108, 192, 3) and first.dtype == np.uint8 and first.std() > 5 and not np.array_equal(first, later)
    env.close()
    env.close()
    bare = parallel_env(BRIEF)
    bare.reset(seed=1)
    assert bare.render() is None
    bare.close()
