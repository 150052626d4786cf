"""What the interfaces refuse: every option and every action that is impossible, by name, and without a trace."""

import copy
import re
import warnings

import numpy as np
import pytest
from flying import fingerprint
from gymnasium.error import ResetNeeded
from playing import BRIEF, Dice

from commhg_mj import tasks
from commhg_mj.tasks import MissionEnv, MissionVectorEnv, parallel_env, surveillance
from commhg_mj.tasks.team import Team


def make(scenario, **options):
    return surveillance.make(scenario, pictures=False, **options)


MAKERS = {"dm_control": make, "gymnasium": MissionEnv, "vector": MissionVectorEnv, "pettingzoo": parallel_env}
every_interface = pytest.mark.parametrize("interface", MAKERS)
PERIOD = "period must be a whole number in 0..86400"


@every_interface
@pytest.mark.parametrize(
    "options, said",
    [
        ({"scenario": "tiny"}, "unknown scenario 'tiny'"),
        ({"scenario": "nowhere.toml"}, "nowhere.toml"),
        ({"scenario": 7}, "unknown scenario '7'"),
        ({"scenario": None}, "unknown scenario 'None'"),
        ({"links": "wires"}, "unknown link model 'wires'"),
        ({"links": None}, "unknown link model None"),
        ({"links": 2}, "unknown link model 2"),
        ({"limitation": "total"}, "unknown limitation 'total'"),
        ({"limitation": None}, "unknown limitation None"),
        ({"period": -1}, PERIOD),
        ({"period": 1.0}, PERIOD),
        ({"period": True}, PERIOD),
        ({"period": "1"}, PERIOD),
        ({"period": None}, PERIOD),
        ({"period": np.nan}, PERIOD),
        ({"period": 2**70}, PERIOD),
        ({"seeds": 5}, "seeds must be a list or range"),
        ({"seeds": []}, "seeds must be a list or range"),
        ({"seeds": range(0)}, "seeds must be a list or range"),
        ({"seeds": "123"}, "seeds must be a list or range"),
        ({"seeds": {1, 2}}, "seeds must be a list or range"),
        pytest.param({"seeds": iter([1])}, "seeds must be a list or range", id="iterator"),
        ({"seeds": [-1]}, "seeds? must be"),
        ({"seeds": [1.0]}, "seeds? must be"),
        ({"seeds": ["one"]}, "seeds? must be"),
        ({"seeds": [2**63]}, "seeds? must be"),
        ({"seeds": [True]}, "seeds? must be"),
        ({"seeds": np.zeros((2, 2), int)}, "seeds? must be"),
        ({"seeds": np.array(3)}, "seeds must be a list or range"),
    ],
    ids=str,
)
def test_impossible_missions(interface, options, said):
    """At the latest when one is to begin."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ValueError, match=said) as error:
            env = MAKERS[interface](**{"scenario": BRIEF} | options)
            env.reset()
            env.step({} if interface == "pettingzoo" else Dice(BRIEF).any((1,) if interface == "vector" else ()))
    assert "\n" not in str(error.value)


@every_interface
def test_unknown_options_are_refused_and_never_ignored(interface):
    with pytest.raises(TypeError, match="limits"):
        MAKERS[interface](BRIEF, limits="low") if interface != "vector" else MissionVectorEnv(1, BRIEF, limits="low")


@pytest.mark.parametrize("interface", ["gymnasium", "pettingzoo"])
@pytest.mark.parametrize(
    "options, said",
    [
        ({"render_mode": "human"}, "render_mode must be None or 'rgb_array', is 'human'"),
        ({"render_mode": 1}, "render_mode must be None or 'rgb_array', is 1"),
        ({"render_mode": True}, "render_mode must be None or 'rgb_array', is True"),
        ({"render_mode": ""}, "render_mode must be None or 'rgb_array', is ''"),
        ({"camera": "above"}, "unknown camera 'above'"),
        ({"camera": "follow:uav9"}, "no robot 'uav9'"),
        ({"camera": ""}, "unknown camera ''"),
        ({"camera": None}, "unknown camera"),
        ({"size": (321, 180)}, "size must be two even numbers"),
        ({"size": (320,)}, "size must be two even numbers"),
        ({"size": (320, 180, 3)}, "size must be two even numbers"),
        ({"size": (2, 2)}, "size must be two even numbers"),
        ({"size": (320.0, 180)}, "size must be two even numbers"),
        ({"size": (-320, 180)}, "size must be two even numbers"),
        ({"size": "ab"}, "size must be two even numbers"),
        ({"size": 320}, "size must be two even numbers"),
        ({"size": None}, "size must be two even numbers"),
    ],
    ids=str,
)
def test_impossible_pictures(interface, options, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        MAKERS[interface](BRIEF, **{"render_mode": "rgb_array"} | options)


@pytest.mark.parametrize("n", [0, -1, 1.0, True, "2", None, [2]])
def test_impossible_numbers_of_missions(n):
    with pytest.raises(ValueError, match="num_envs must be a whole number in 1..1000000"):
        MissionVectorEnv(n, BRIEF)


def test_numbers_of_missions_may_be_numpys():
    assert MissionVectorEnv(np.int64(2), BRIEF).num_envs == 2


@pytest.mark.parametrize("seed", [-1, 1.5, "one", 2**63])
@pytest.mark.parametrize("interface", ["gymnasium", "vector", "pettingzoo"])
def test_impossible_seeds_of_a_reset(interface, seed):
    env = MAKERS[interface](scenario=BRIEF)
    if interface == "vector":
        seed = [seed]
    with pytest.raises(ValueError, match="seed must be a whole number") as error:
        env.reset(seed=seed)
    assert "\n" not in str(error.value)


@every_interface
@pytest.mark.parametrize("kind", [np.int64, np.uint8, np.int32])
def test_numpys_whole_numbers_are_seeds(interface, kind):
    env = MAKERS[interface](scenario=BRIEF)
    env.reset(seed=kind(5))
    assert (env.task.team if interface == "dm_control" else env.team).batch.seeds == [5]


@pytest.mark.parametrize("seed", [[1], [1, 2, 3], np.zeros((2, 2), int)], ids=str)
def test_as_many_seeds_as_missions(seed):
    with pytest.raises((ValueError, TypeError), match="seed must be one number or 2|seed must be a whole number"):
        MissionVectorEnv(2, BRIEF).reset(seed=seed)


@pytest.mark.parametrize("arguments", [("nowhere", "small"), (None, "small")])
def test_unknown_domains(arguments):
    with pytest.raises(ValueError, match=f"unknown domain {arguments[0]!r}: use surveillance"):
        tasks.load(*arguments)


@pytest.mark.parametrize("task", ["tiny", None, "Small", ""])
def test_unknown_tasks(task):
    with pytest.raises(ValueError, match=f"unknown task {task!r} of surveillance: use small, medium, large"):
        tasks.load("surveillance", task)


@pytest.mark.parametrize("gamma", [-0.1, 1.1, np.nan, np.inf, "much"])
def test_impossible_discounts(gamma):
    with pytest.raises(ValueError, match="gamma must be a number in 0..1"):
        make(BRIEF, environment_kwargs={"gamma": gamma})


@pytest.mark.parametrize("kwargs", [{"task_kwargs": {"speed": 2}}, {"environment_kwargs": {"time_limit": 3}}])
def test_unknown_keywords_of_load(kwargs):
    with pytest.raises(TypeError, match="speed|time_limit"):
        tasks.load("surveillance", "small", **kwargs)


@pytest.mark.parametrize(
    "random",
    [-1, True, 2**63, 1.5, "one", [1, 2]],
    ids=str,
)
def test_impossible_seeds_of_a_task(random):
    with pytest.raises(ValueError, match="seed|random"):
        make(BRIEF, random=random).reset()
    env = make(BRIEF, random=1)
    env.reset()
    with pytest.raises(ValueError, match="seed|random"):
        env.reset(seed=random)


def test_what_the_room_offers():
    assert set(tasks.__all__) == set(dir(tasks)) and all(getattr(tasks, name) is not None for name in tasks.__all__)
    with pytest.raises(AttributeError, match="no attribute 'MissionWorld'"):
        tasks.MissionWorld  # noqa: B018


def wrong(k, value, dtype=float):
    """An action of the team that is all right but for choice k."""
    action = np.zeros(14, dtype)
    action[k] = value
    return action


ACTIONS = [
    (wrong(0, -1), "uav0 task must lie in 0..23, is -1"),
    (wrong(0, 24), "uav0 task must lie in 0..23, is 24"),
    (wrong(4, 2), "uav1 broadcast must lie in 0..1, is 2"),
    (wrong(8, 4), "ugv0 message must lie in 0..3, is 4"),
    (wrong(13, 6, np.int8), "operator1 robot must lie in 0..5, is 6"),
    (wrong(13, -(2**62), np.int64), "operator1 robot must lie in 0..5"),
    (wrong(12, 1e18), "operator0 robot must be a whole number"),
    ([0] * 13, "shape"),
    ([0] * 15, "shape"),
    ([[0] * 14], "shape"),
    (0, "shape"),
    ([], "shape"),
    (None, "shape"),
    ("left", "shape"),
    ({"uav0": 1}, "shape"),
    (["0"] * 14, "whole numbers"),
    ([None] * 14, "whole numbers"),
    (wrong(3, True, bool), "whole numbers"),
    (wrong(3, 1j, complex), "whole numbers"),
    (wrong(3, 2**63 + 5, np.uint64), "uav1 task must lie in"),
    (wrong(3, 0.5), "uav1 task must be a whole number, is 0.5"),
    (wrong(3, np.nan), "uav1 task must be a whole number"),
    (wrong(3, -np.inf), "uav1 task must be a whole number"),
    (wrong(3, 1e300), "uav1 task must be a whole number"),
    ([[0, 1], [0]], "action must be whole numbers"),
]


@pytest.fixture(scope="module", params=["dm_control", "gymnasium", "vector"])
def underway(request):
    """(interface, environment within a mission), which no refusal may change."""
    env = MAKERS[request.param](scenario=BRIEF)
    env.reset(seed=1), env.step(np.zeros((1, 14) if request.param == "vector" else 14, int))
    return request.param, env


@pytest.mark.parametrize("action, said", ACTIONS)
def test_impossible_actions_change_nothing(underway, action, said):
    interface, env = underway
    action = [action] if interface == "vector" else action
    team = env.task.team if interface == "dm_control" else env.team
    names = ("tables", "mask", "due", "time", "elapsed", "rewards", "replaced")
    before, kept = fingerprint(team.batch.state), copy.deepcopy([getattr(team, name) for name in names])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ValueError, match=said):
            env.step(action)
    assert fingerprint(team.batch.state) == before
    np.testing.assert_equal([getattr(team, name) for name in names], kept)


def test_a_refused_action_does_not_count_as_replaced():
    team = Team(BRIEF)
    team.begin([1])
    action = wrong(1, 1, int)
    action[0], action[13] = 1, 99  # the prescribed first target is not dropped
    with pytest.raises(ValueError, match="operator1"):
        team.step(action[None])
    assert team.replaced.tolist() == [0]


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int32, np.int64, np.uint64, np.float16, np.float32, np.float64])
def test_whole_numbers_of_every_type_are_actions(dtype):
    env, other, dice = MissionEnv(BRIEF), MissionEnv(BRIEF), Dice(BRIEF)
    env.reset(seed=1), other.reset(seed=1)
    for _ in range(5):
        action = dice.any()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            step = env.step(action.astype(dtype))
        np.testing.assert_equal(step, other.step(action.tolist()))


def test_the_callers_action_is_left_alone():
    env, dice = MissionEnv(BRIEF), Dice(BRIEF)
    env.reset(seed=1)
    action = dice.any()
    kept = action.copy()
    env.step(action)
    np.testing.assert_array_equal(action, kept)


@pytest.mark.parametrize("interface", ["gymnasium", "vector", "pettingzoo"])
def test_a_step_before_the_first_reset_says_so(interface):
    env = MAKERS[interface](scenario=BRIEF)
    with pytest.raises(ResetNeeded, match="reset"):
        env.step({} if interface == "pettingzoo" else np.zeros((1, 14) if interface == "vector" else 14, int))


@pytest.mark.parametrize("shape", [(14,), (2, 14), (1, 13)])
def test_a_refusal_says_which_shape_it_was(shape):
    env = MissionVectorEnv(1, BRIEF)
    env.reset(seed=1)
    with pytest.raises(ValueError, match=re.escape(f"of shape (1, 14), is int64 of shape {shape}") + "$"):
        env.step(np.zeros(shape, int))


@pytest.mark.parametrize("interface", ["dm_control", "gymnasium"])
def test_a_team_that_is_alone_reads_of_its_own_shape(interface):
    env = MAKERS[interface](BRIEF)
    env.reset()
    with pytest.raises(ValueError, match=re.escape("of shape (14,), is int64 of shape (1, 14)") + "$"):
        env.step(np.zeros((1, 14), int))


def test_a_refusal_says_which_number_it_was():
    env = MissionEnv(BRIEF)
    env.reset(seed=1)
    with pytest.raises(ValueError, match=f"uav1 task must lie in 0..23, is {2**63 + 5}"):
        env.step(wrong(3, 2**63 + 5, np.uint64))


@pytest.mark.parametrize("size", [np.array([320, 180]), (np.int64(320), np.int64(180))], ids=["array", "tuple"])
def test_sizes_may_be_numpys(size):
    MissionEnv(BRIEF, render_mode="rgb_array", size=size)


@pytest.mark.parametrize("interface", ["gymnasium", "pettingzoo"])
def test_a_picture_before_the_first_reset_says_so(interface):
    env = MAKERS[interface](scenario=BRIEF, render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="reset"):
        env.render()


def test_masks_before_the_first_reset_say_so():
    with pytest.raises(ResetNeeded, match="reset"):
        MissionEnv(BRIEF).action_masks()
