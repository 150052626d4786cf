"""The Gymnasium environment: its checker, masks, seeds, ends, pictures, copies, and how vector environments take it."""

import copy
import dataclasses
import pickle
import warnings
from contextlib import closing

import gymnasium
import numpy as np
import pytest
from flying import fingerprint
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from playing import BRIEF, BRITTLE, LONELY, Dice, open_everywhere
from strategies import change

from commhg_mj.mission.score import Score
from commhg_mj.mission.trace import make_traces
from commhg_mj.radio import LINK_MODELS
from commhg_mj.scenarios import LIMITATIONS, SCENARIOS
from commhg_mj.scenarios.heightmap import PIXELS, to_text
from commhg_mj.tasks import MissionEnv
from commhg_mj.tasks.registration import ID

every_scenario = pytest.mark.parametrize("scenario", SCENARIOS)
HILLY = change(BRIEF, heightmap=to_text(np.pad(np.ones((20, 20)), (0, PIXELS - 20))))
SMALL_PICTURE = {"render_mode": "rgb_array", "size": (192, 108)}


def fly(env, dice, seed=None, most_steps=10_000):
    """Yield (observation, reward, terminated, truncated, info) of a mission, its start included."""
    seen, info = env.reset(seed=seed)
    step = seen, 0.0, False, False, info
    yield step
    while not step[2] and most_steps:
        step, most_steps = env.step(dice.open(step[0]["action_mask"])), most_steps - 1
        yield step


@every_scenario
def test_gymnasium_makes_it(scenario):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(ID.format(scenario))
        assert env.unwrapped.team.scenario is SCENARIOS[scenario] and env.spec.nondeterministic is False
        env.reset(seed=1)
        for _ in range(3):
            env.step(env.action_space.sample())  # within gymnasium's own PassiveEnvChecker
        env.close()


@pytest.mark.parametrize("scenario", ["small", *(pytest.param(name, marks=pytest.mark.slow) for name in ("medium", "large"))])
def test_gymnasiums_checker_of_an_environment_that_renders(scenario):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(ID.format(scenario), **SMALL_PICTURE)
        check_env(env.unwrapped, skip_render_check=False)
        env.close()


def test_the_registry_has_every_scenario():
    ids = {name for name in gymnasium.registry if name.startswith("commhg_mj/")}
    assert ids == {ID.format(name) for name in SCENARIOS}
    for name in ids:
        spec = gymnasium.registry[name]
        assert gymnasium.envs.registration.EnvSpec.from_json(spec.to_json()) == spec, "specs can be written down"


@pytest.mark.parametrize(
    "options",
    [
        {"seeds": range(10, 20, 3)}, {"seeds": range(10**9)}, {"seeds": np.arange(5)}, {"seeds": (3, np.int64(4))},
        {"scenario": BRIEF}, {"scenario": HILLY}, {"period": np.int64(9), "size": (64, 64)},
    ],
    ids=["range", "endless", "array", "tuple", "scenario", "heightmap", "numbers"],
)  # fmt: skip
def test_specs_survive_json(options):
    env = gymnasium.make(ID.format("small"), **options)
    text = env.spec.to_json()
    other = gymnasium.make(EnvSpec.from_json(text))
    assert other.spec.to_json() == text and len(text) < 20_000
    assert other.unwrapped.team.scenario == env.unwrapped.team.scenario
    for seed in (5, None, None):
        np.testing.assert_equal(env.reset(seed=seed), other.reset(seed=seed))
    np.testing.assert_equal(env.step(0 * env.action_space.nvec), other.step(0 * env.action_space.nvec))


def test_specs_of_vector_environments_survive_json():
    env = gymnasium.make_vec(
        ID.format("small"), num_envs=2, vectorization_mode="vector_entry_point", scenario=BRIEF, seeds=range(9)
    )  # fmt: skip
    other = gymnasium.make_vec(EnvSpec.from_json(env.spec.to_json()))
    assert other.num_envs == 2 and other.unwrapped.team.scenario == BRIEF and other.unwrapped.team.seeds == range(9)
    np.testing.assert_equal(env.reset(seed=5)[0], other.reset(seed=5)[0])


def test_a_scenarios_table_is_the_scenario():
    assert MissionEnv({"base": "small", "n_uav": 3}).team.scenario == change(SCENARIOS["small"], n_uav=3)
    for scenario, said in (({"base": "tiny"}, "base must be one of"), ({"n_uavs": 3}, "unknown field n_uavs")):
        with pytest.raises(ValueError, match=said):
            MissionEnv(scenario)
    for seeds in ({"range": 3}, {"range": ["a"]}, {"range": []}, {"range": [3, 3]}, {"range": [0, 3, 0]}, {"from": 3}):
        with pytest.raises(ValueError, match="seeds must be a list or range"):
            MissionEnv(BRIEF, seeds=seeds)


@every_scenario
@pytest.mark.parametrize("links", LINK_MODELS)
def test_observations_lie_in_their_space(scenario, links):
    """The beginning of every mission and, in steps of 30 s, the rest of it."""
    limitation = LIMITATIONS[list(LINK_MODELS).index(links) % 3]
    for period, most_steps in ((0, 10), (30, 100)):
        env = MissionEnv(scenario, links=links, limitation=limitation, period=period)
        for seen, *_ in fly(env, Dice(SCENARIOS[scenario], stays=0.8), 4, most_steps):
            assert env.observation_space.contains(seen)
    assert env.team.over[0]


@pytest.mark.parametrize("links", LINK_MODELS)
@pytest.mark.parametrize("limitation", LIMITATIONS)
def test_observations_lie_in_their_space_along_whole_missions(links, limitation):
    env, dice = MissionEnv(BRIEF, links=links, limitation=limitation), Dice(BRIEF)
    for seen, *_ in fly(env, dice, 4):
        assert env.observation_space.contains(seen)
    assert env.team.over[0]


@pytest.mark.parametrize("scenario", [BRITTLE, LONELY], ids=["brittle", "lonely"])
def test_observations_of_odd_teams_lie_in_their_space(scenario):
    env = MissionEnv(scenario)
    for seen, *_ in fly(env, Dice(scenario), 4):
        assert env.observation_space.contains(seen)
    assert env.action_space.contains(env.action_space.sample())
    assert env.observation_space.contains(env.observation_space.sample())


@every_scenario
def test_masks_serve_the_action_space(scenario):
    env = MissionEnv(scenario)
    seen, info = env.reset(seed=1)
    env.action_space.seed(0)
    for _ in range(20):
        masks = info["action_mask"]
        assert isinstance(masks, tuple) and [len(mask) for mask in masks] == env.action_space.nvec.tolist()
        assert all(mask.dtype == np.int8 and mask.any() for mask in masks)
        np.testing.assert_array_equal(np.concatenate(masks), seen["action_mask"])
        np.testing.assert_array_equal(env.action_masks(), seen["action_mask"] == 1)
        assert env.action_masks().dtype == bool
        seen, _, _, _, info = env.step(env.action_space.sample(masks))
        assert info["replaced"] == 0, "nothing was masked"


def test_masked_choices_are_counted_one_by_one():
    env, dice, counts = MissionEnv(BRIEF), Dice(BRIEF), set()
    seen, _ = env.reset(seed=1)
    is_over = False
    while not is_over:
        action, mask = dice.any(), seen["action_mask"]
        seen, _, is_over, _, info = env.step(action)
        assert info["replaced"] == np.sum(~open_everywhere(mask, action, BRIEF))
        counts.add(info["replaced"])
    assert len(counts) > 3


def test_a_masked_choice_is_staying():
    env, other = MissionEnv(BRIEF), MissionEnv(BRIEF)
    dice, seen = Dice(BRIEF), None
    env.reset(seed=1)
    seen, _ = other.reset(seed=1)
    is_over = False
    while not is_over:
        action, mask = dice.any(), seen["action_mask"]
        stays = np.where(mask[dice.choices.starts] != 0, 0, 1)  # an actor that holds nothing drops it
        env.step(action)
        seen, _, is_over, _, info = other.step(np.where(open_everywhere(mask, action, BRIEF), action, stays))
        assert info["replaced"] == 0
        assert fingerprint(env.team.batch.state) == fingerprint(other.team.batch.state)


@pytest.mark.parametrize("scenario", [BRIEF, BRITTLE], ids=["brief", "brittle"])
def test_rewards_and_infos_add_up_to_the_score(scenario):
    env = MissionEnv(scenario)
    steps = list(fly(env, Dice(scenario), 4))
    infos = [step[-1] for step in steps]
    for (_, reward, terminated, truncated, info), following in zip(steps, [*steps[1:], None]):
        assert reward == pytest.approx(info["mission_reward"] + info["coordination_reward"])
        assert type(reward) is float and type(terminated) is bool and truncated is False
        assert terminated == (following is None), "terminated at the end, and nowhere else"
        assert info["coordination_reward"] <= 0 and info["seed"] == 4
    fields = {field.name for field in dataclasses.fields(Score)}
    assert all(list(info) == list(infos[0]) for info in infos) and fields <= set(infos[0])
    assert all(info["twcr"] == 0 == info["duration"] and not info["messages"]["query"]["sent"] for info in infos[:-1])
    assert all(types_of(info) == types_of(infos[0]) for info in infos)
    (score,) = env.team.batch.scores()
    assert dataclasses.asdict(score) == {name: infos[-1][name] for name in fields}
    assert infos[-1]["reward_mission"] == pytest.approx(sum(info["mission_reward"] for info in infos))
    assert infos[-1]["reward_coordination"] == pytest.approx(sum(info["coordination_reward"] for info in infos))
    assert infos[-1]["duration"] == infos[-1]["time"] == sum(info["elapsed"] for info in infos)
    for name, value in infos[-1].items():
        assert type(value) in (int, float, dict, tuple), name


def types_of(info):
    """By name, as collectors of datasets want them to stay the same."""
    return {name: types_of(value) if isinstance(value, dict) else type(value) for name, value in info.items()}


@pytest.mark.parametrize("period", [1, 7, 60])
def test_steps_of_fixed_length(period):
    times = [info["time"] for *_, info in fly(MissionEnv(BRIEF, period=period), Dice(BRIEF), 4)]
    assert times == [min(k * period, 60) for k in range(-(-60 // period) + 1)]


def test_steps_after_the_end_change_nothing():
    env = MissionEnv(BRIEF, period=60)
    env.reset(seed=1)
    end = env.step(np.zeros(env.action_space.shape, int))
    before = fingerprint(env.team.batch.state)
    seen, reward, terminated, _, info = env.step(env.action_space.sample())
    assert end[2] and terminated and reward == 0.0 and info["elapsed"] == 0
    assert fingerprint(env.team.batch.state) == before


def test_seeds():
    env, other = MissionEnv(BRIEF), MissionEnv(BRIEF)

    def next_seeds(env, seed):
        return [env.reset(seed=seed)[1]["seed"], *(env.reset()[1]["seed"] for _ in range(4))]

    first = next_seeds(env, 9)
    assert first[0] == 9 and len(set(first)) == 5 and next_seeds(other, 9) == first == next_seeds(env, 9)
    assert next_seeds(env, 10)[1:] != first[1:]
    one, two = env.reset(seed=9), other.reset(seed=9)
    np.testing.assert_equal(one, two)
    assert MissionEnv(BRIEF).reset()[1]["seed"] != MissionEnv(BRIEF).reset()[1]["seed"]


@pytest.mark.parametrize("seeds", [range(40, 43), [40, 41, 42], np.arange(40, 43), (42, 41, 40)])
def test_unseeded_missions_come_from_the_allowed_seeds(seeds):
    env = MissionEnv(BRIEF, seeds=seeds)
    assert {env.reset()[1]["seed"] for _ in range(30)} == {40, 41, 42}
    assert env.reset(seed=7)[1]["seed"] == 7, "a given seed is the mission itself"


def test_environments_do_not_disturb_one_another():
    alone = [list(fly(MissionEnv(BRIEF), Dice(BRIEF, seed), seed)) for seed in (7, 11)]
    together = zip(*(fly(MissionEnv(BRIEF), Dice(BRIEF, seed), seed) for seed in (7, 11)))
    for k, steps in enumerate(together):
        for mine, step in zip(alone, steps):
            np.testing.assert_equal(mine[k], step)
    assert k >= 40


@pytest.mark.parametrize("copy_of", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
@pytest.mark.parametrize("links", ["abstract", "raycast"])
def test_a_copy_flies_on_to_the_same_bits(copy_of, links):
    env, dice = gymnasium.make(ID.format("small"), links=links), Dice(SCENARIOS["small"])
    seen, _ = env.reset(seed=3)
    for _ in range(30):
        seen, *_ = env.step(dice.open(seen["action_mask"]))
    other = copy_of(env)
    for _ in range(30):
        action = dice.open(seen["action_mask"])
        one, two = env.step(action), other.step(action)
        np.testing.assert_equal(one, two)
        seen = one[0]
    np.testing.assert_equal(env.reset(), other.reset())


def test_what_was_returned_stays_as_it_was():
    env, dice, steps = MissionEnv(BRIEF), Dice(BRIEF), []
    for step in fly(env, dice, 3):
        steps.append((step, copy.deepcopy(step)))
    env.reset()
    steps[0][0][-1]["messages"]["query"].clear(), steps[0][1][-1]["messages"]["query"].clear()  # nobody else's
    for step, as_it_was in steps:
        np.testing.assert_equal(step, as_it_was)


def test_pictures():
    env, dice = MissionEnv(BRIEF, camera="map", **SMALL_PICTURE), Dice(BRIEF)
    seen, _ = env.reset(seed=1)
    first, again = env.render(), env.render()
    assert first.shape == (108, 192, 3) and first.dtype == np.uint8 and first.std() > 5
    np.testing.assert_array_equal(first, again)
    for _ in range(30):
        seen, *_ = env.step(dice.open(seen["action_mask"]))
    later = env.render()
    assert np.any(later != first, axis=-1).mean() > 0.005, "robots have moved"
    env.reset(seed=2)
    env.close()
    env.close()
    assert np.any(env.render() != first, axis=-1).mean() > 0.05, "another world, by a film that opens again"
    env.close()


def test_a_picture_does_not_depend_on_earlier_ones():
    """Of the same mission, of another one in the same world, or of one in another world."""
    with closing(MissionEnv(BRIEF, **SMALL_PICTURE)) as env, closing(MissionEnv(BRIEF, **SMALL_PICTURE)) as fresh:
        for k, _ in enumerate(fly(env, Dice(BRIEF), 1, 40)):
            k % 20 or env.render()
        list(fly(fresh, Dice(BRIEF), 1, 40))
        for seed in (1, 2):
            np.testing.assert_array_equal(env.render(), fresh.render())
            env.reset(seed=seed), fresh.close(), fresh.reset(seed=seed)
            picture = env.render()
            env.reset(seed=seed)
            np.testing.assert_array_equal(env.render(), picture)
        np.testing.assert_array_equal(picture, fresh.render())


def test_a_camera_that_follows():
    with closing(MissionEnv(BRIEF, camera="follow:ugv1", **SMALL_PICTURE)) as env:
        env.reset(seed=1)
        assert env.render().std() > 5


def test_an_environment_that_has_rendered_can_be_copied():
    with closing(MissionEnv(BRIEF, **SMALL_PICTURE)) as env:
        env.reset(seed=1)
        picture = env.render()
        with closing(pickle.loads(pickle.dumps(env))) as other:
            np.testing.assert_array_equal(other.render(), picture)


def test_recorded_missions_leave_traces():
    env = MissionEnv(BRIEF, record=True)
    list(fly(env, Dice(BRIEF), 1))
    (trace,) = make_traces(env.team.batch, "dice")
    assert trace.ticks == 60 and trace.seed == 1 and env.render() is None, "and none is filmed"


def test_without_a_render_mode_there_is_nothing_to_see():
    env = MissionEnv(BRIEF)
    env.reset(seed=1)
    assert env.render() is None and not env.team.batch.record
    env.close()
    env.close()


def test_gymnasium_records_videos(tmp_path):
    pytest.importorskip("moviepy")
    env = gymnasium.make(ID.format("small"), period=600, **SMALL_PICTURE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # moviepy's
        env = gymnasium.wrappers.RecordVideo(env, str(tmp_path), disable_logger=True)
        list(fly(env, Dice(SCENARIOS["small"]), 1))
        env.close()
    (video,) = tmp_path.glob("*.mp4")
    assert video.stat().st_size > 1000


def make_brief():
    return MissionEnv(BRIEF, period=20)


@pytest.mark.slow  # processes begin anew
def test_gymnasiums_vector_environments_of_processes():
    here = gymnasium.vector.SyncVectorEnv([make_brief] * 2)
    there = gymnasium.vector.AsyncVectorEnv([make_brief] * 2, context="spawn")
    try:
        np.testing.assert_equal(here.reset(seed=5)[0], there.reset(seed=5)[0])
        here.action_space.seed(1)
        for _ in range(5):
            actions = here.action_space.sample()
            for one, two in zip(here.step(actions)[:4], there.step(actions)[:4]):
                np.testing.assert_equal(one, two)
    finally:
        there.close()
