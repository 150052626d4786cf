"""dm_control's own contracts for its suite (its suite_test.py), kept by every task of ours, and what ours add to them.

Two of them read otherwise here. Actions are numbers of choices, so that their range is not [-1, 1] but 0 to the last choice.
And some observed facts never change, which are listed.
"""

import pickle

import dm_env
import numpy as np
import pytest
import tree
from absl.testing import absltest
from dm_control.rl import control
from dm_control.suite.wrappers import pixels
from dm_env import test_utils
from flying import fingerprint
from playing import BRIEF, BRITTLE, LONELY, Dice
from strategies import change

from commhg_mj.scenarios import SCENARIOS
from commhg_mj.tasks import MissionEnv, suite, surveillance

every_task = pytest.mark.parametrize("domain, task", suite.ALL_TASKS)
NAMED = (
    "body", "joint", "geom", "site", "camera", "light", "mesh", "hfield", "texture", "material", "equality", "tendon",
    "actuator", "sensor", "numeric", "text", "tuple",
)  # fmt: skip
SIZES = dict(zip(NAMED, (
    "nbody", "njnt", "ngeom", "nsite", "ncam", "nlight", "nmesh", "nhfield", "ntex", "nmat", "neq", "ntendon",
    "nu", "nsensor", "nnumeric", "ntext", "ntuple",
)))  # fmt: skip
FACTS = {  # never change; who is proficient in what is the same in every mission with three operators or more
    "robots/embodiment", "robot_peers/embodiment", "operator_reports/embodiment",
    "operators/proficiency_uav", "operators/proficiency_ugv",
}  # fmt: skip
TIRING = change(SCENARIOS["small"], fatigue_rate=0.02, recovery_rate=0.0, time_limit=300)
CROWDED = change(
    SCENARIOS["small"], n_uav=8, n_operators=1, refill=3.0, time_to_live=100.0, broadcast_bucket=160.0, time_limit=300,
)  # fmt: skip
SLOW = change(SCENARIOS["small"], refill=1.0, time_to_live=100.0, time_limit=600)
RARE = {  # few actions at random tire an operator or fill a queue; here they do
    "robot_operators/fatigue_class": TIRING, "robot_operators/queue": CROWDED, "robots/request_waits": SLOW,
    "operators/queue": CROWDED, "robots/can_broadcast": CROWDED, "robots/query_waits": SLOW, "robot_operators/legal": SLOW,
}  # fmt: skip


def load(domain, task, seed=None, environment_kwargs=None, **options):
    """The environment, without pictures unless they are asked for."""
    options = {"random": seed, "pictures": False, **options}
    return suite.load(domain, task, task_kwargs=options, environment_kwargs=environment_kwargs)


def fly(env, dice, episodes=1, most_steps=10_000):
    """Yield the time steps of random episodes; some actions ignore the mask."""
    for _ in range(episodes):
        timestep = env.reset()
        yield timestep
        for k in range(most_steps):
            timestep = env.step(dice.open(env.task.team.mask[0]) if k % 10 else dice.any())
            yield timestep
            if timestep.last():
                break


def leaves(timestep):
    """{path: array} of an observation."""
    return {"/".join(path): array for path, array in tree.flatten_with_path(timestep.observation)}


@pytest.fixture(scope="module", params=suite.ALL_TASKS, ids="-".join)
def flight(request):
    """(environment, time steps): the beginnings of two missions."""
    env = load(*request.param, seed=0)
    return env, list(fly(env, Dice(env.task.team.scenario, stays=0.98), episodes=2, most_steps=300))


@every_task
def test_components_have_names(domain, task):
    env = load(domain, task, pictures=True)
    for kind in NAMED:
        for i in range(getattr(env.physics.model, SIZES[kind])):
            assert env.physics.model.id2name(i, kind) != "", (kind, i)


@every_task
def test_models_have_at_least_two_cameras(domain, task):
    """With pictures or without, whose cameras are the same (tests/models/test_mjcf.py)."""
    assert load(domain, task).physics.model.ncam >= 2


def test_observations_rewards_and_discounts_conform_to_their_specs(flight):
    env, timesteps = flight
    spec = env.observation_spec()
    names = [leaf.name for leaf in tree.flatten(spec)]
    assert len(set(names)) == len(names) and names == ["/".join(path) for path, _ in tree.flatten_with_path(spec)]
    for timestep in timesteps[::9] + timesteps[-1:]:
        tree.assert_same_structure(timestep.observation, spec)
        tree.map_structure(lambda leaf, array: leaf.validate(array), spec, timestep.observation)
        if timestep.first():
            assert timestep.reward is None and timestep.discount is None
            continue
        assert type(timestep.reward) is float and type(timestep.discount) is float
        env.reward_spec().validate(timestep.reward)
        env.discount_spec().validate(timestep.discount)
        assert timestep.discount == (0.0 if timestep.last() else 1.0)


def test_actions_are_numbers_of_choices(flight):
    env, _ = flight
    spec, scenario = env.action_spec(), env.task.team.scenario
    names = spec.name.split("\t")
    assert spec.dtype == np.int32 and spec.shape == (len(names),) == (3 * scenario.n_robots + scenario.n_operators,)
    assert np.all(spec.minimum == 0), "0 changes nothing"
    robot, operator = [scenario.n_tasks + 1, 1, scenario.n_operators + 1], [scenario.n_robots + 1]
    assert spec.maximum.tolist() == robot * scenario.n_robots + operator * scenario.n_operators
    assert names[:4] == ["uav0 task", "uav0 broadcast", "uav0 message", "uav1 task"] and names[-1].startswith("operator")


def test_rewards_keep_their_range(flight):
    """A completion is worth its task; waiting costs a hundredth a second, and everybody's mistakes some more."""
    env, timesteps = flight
    rules, scenario = env.task.team.scenario.reward, env.task.team.scenario
    mistakes = rules.incompatible_cost * scenario.n_robots + (rules.switch_cost + rules.conflict_cost) * scenario.n_operators
    mistakes *= np.mean(scenario.tasks.values)
    for timestep in timesteps:
        if not timestep.first():
            waiting = rules.pending * float(timestep.observation["elapsed"][0])
            assert -waiting - mistakes <= timestep.reward <= scenario.n_robots * max(scenario.tasks.values)
    rewards = [timestep.reward for timestep in timesteps if not timestep.first()]
    assert min(rewards) < 0 < max(rewards)


def test_observations_share_no_memory(flight):
    _, timesteps = flight
    for one, two in zip(timesteps[:6], timesteps[1:]):
        arrays = [*tree.flatten(one.observation), *tree.flatten(two.observation)]
        ends = sorted((a.__array_interface__["data"][0], a.nbytes) for a in arrays)
        assert all(start + size <= following for (start, size), (following, _) in zip(ends, ends[1:]))


def test_observations_hold_no_constants(flight):
    env, timesteps = flight
    firsts, varies = leaves(timesteps[0]), set()
    for timestep in timesteps:
        varies |= {name for name, array in leaves(timestep).items() if not np.array_equal(array, firsts[name])}
    constants = set(firsts) - varies
    assert constants <= FACTS | set(RARE), constants - FACTS - set(RARE)


@pytest.mark.parametrize("name", RARE)
def test_rare_observations_occur_in_other_scenarios(name):
    scenario = RARE[name]
    flown = fly(surveillance.make(scenario, random=0, pictures=False), Dice(scenario, stays=0.8))
    values = {value for timestep in flown for value in leaves(timestep)[name].flat}
    assert len(values) > 1 and (scenario is not TIRING or values >= {0, 1})


@every_task
def test_seeds_and_actions_determine_everything(domain, task):
    def trajectory():
        env = load(domain, task, seed=0)
        return list(fly(env, Dice(env.task.team.scenario), episodes=3, most_steps=10))

    for one, two in zip(trajectory(), trajectory(), strict=True):
        assert one[:3] == two[:3]
        np.testing.assert_equal(one.observation, two.observation)


@every_task
def test_initial_states_vary(domain, task):
    env = load(domain, task, seed=42)
    one, two = env.reset(), env.reset()
    assert not np.array_equal(one.observation["robot_tasks"]["x"], two.observation["robot_tasks"]["x"])
    assert env.task.team.batch.seeds != [42], "the first episode's alone is the given one"


@every_task
def test_tasks_pass_arguments_on_to_their_environment(domain, task):
    env, plain = load(domain, task, 1, {"flat_observation": True}), load(domain, task, 1)
    dice = Dice(env.task.team.scenario)
    assert set(env.observation_spec()) == {control.FLAT_OBSERVATION_KEY}
    for _ in range(2):
        for k in range(3):
            action = dice.any()
            flat, nested = (env.step(action), plain.step(action)) if k else (env.reset(), plain.reset())
            array = flat.observation[control.FLAT_OBSERVATION_KEY]
            env.observation_spec()[control.FLAT_OBSERVATION_KEY].validate(array)
            expected = np.concatenate([np.ravel(leaf) for leaf in tree.flatten(nested.observation)])
            np.testing.assert_array_equal(array, expected)
        env.step(action)  # FIRST after LAST takes another way


def test_flat_observations_of_steps_that_begin_an_episode():
    env = surveillance.make(BRIEF, random=1, pictures=False, environment_kwargs={"flat_observation": True}, period=60)
    nothing = np.zeros(env.action_spec().shape)
    for kind in (dm_env.StepType.FIRST, dm_env.StepType.LAST) * 2:
        timestep = env.step(nothing)
        assert timestep.step_type is kind
        env.observation_spec()[control.FLAT_OBSERVATION_KEY].validate(timestep.observation[control.FLAT_OBSERVATION_KEY])


def test_the_registry_is_complete():
    assert [task for _, task in suite.ALL_TASKS] == list(SCENARIOS)
    assert {domain for domain, _ in suite.ALL_TASKS} == set(suite.DOMAINS) == {"surveillance"}
    assert set(suite.BENCHMARKING) == set(suite.ALL_TASKS)
    assert set(suite.EASY) | set(suite.HARD) < set(suite.ALL_TASKS) and not set(suite.EASY) & set(suite.HARD)


@every_task
def test_a_task_is_its_scenario(domain, task):
    options = {"random": 3, "pictures": False, "links": "perfect", "limitation": "low"}
    env = suite.load(domain, task, options, {"gamma": 0.5}, visualize_reward=True)
    env.reset()
    batch = env.task.team.batch
    assert (batch.scenario, batch.seeds, batch.links, batch.limitation) == (SCENARIOS[task], [3], "perfect", "low")
    assert env.task.visualize_reward is True


class MissionContract(test_utils.EnvironmentTestMixin):
    """dm_env's own contract; whole episodes, in steps of 100 s where missions are long."""

    scenario, options = BRIEF, {}

    def make_object_under_test(self):
        return surveillance.make(self.scenario, random=3, pictures=False, **self.options)

    def make_action_sequence(self):
        team, dice = self.environment.task.team, Dice(self.scenario)
        for _ in range(2):
            while not team.over[0]:
                yield dice.open(team.mask[0])
            yield dice.any()  # begins the next episode


def _contract(scenario, environment_kwargs=None, **options):
    options["environment_kwargs"] = environment_kwargs
    return type("Contract", (MissionContract, absltest.TestCase), {"scenario": scenario, "options": options})


TestSmall, TestMedium, TestLarge = (_contract(SCENARIOS[task], period=200) for _, task in suite.ALL_TASKS)
TestBrief, TestBrittle, TestLonely = _contract(BRIEF), _contract(BRITTLE, period=2), _contract(LONELY)
TestFlat = _contract(BRIEF, {"flat_observation": True, "gamma": 0.9}, period=5)


def test_seconds_are_discounted():
    env = surveillance.make(BRIEF, random=3, pictures=False, environment_kwargs={"gamma": 0.9})
    lasted = set()
    for timestep in fly(env, Dice(BRIEF)):
        elapsed = float(timestep.observation["elapsed"][0])
        if timestep.mid():
            lasted.add(elapsed)
            assert timestep.discount == 0.9**elapsed
    assert timestep.last() and timestep.discount == 0.0 and len(lasted) > 2
    assert elapsed > 0, "a discount that the mission's end overrules"


@pytest.mark.parametrize("gamma, discount", [(None, 1.0), (1, 1.0), (0.0, 0.0)])
def test_discounts_at_the_ends_of_their_range(gamma, discount):
    env = surveillance.make(BRIEF, random=3, pictures=False, environment_kwargs={"gamma": gamma}, period=2)
    env.reset()
    timestep = env.step(np.zeros(env.action_spec().shape))
    assert timestep.discount == discount and type(timestep.discount) is float and timestep.mid()


@pytest.mark.parametrize("period", [1, 7, 60])
def test_steps_of_fixed_length(period):
    env = surveillance.make(BRIEF, random=3, pictures=False, period=period)
    timesteps = list(fly(env, Dice(BRIEF)))
    times = [float(timestep.observation["time"][0]) for timestep in timesteps]
    assert times == [min(k * period, 60.0) for k in range(len(timesteps))] and times[-1] == 60
    assert [float(timestep.observation["elapsed"][0]) for timestep in timesteps] == [0, *np.diff(times)]
    assert env.physics.timestep() == env.control_timestep() == period


def test_the_world_and_its_clock_follow_the_mission():
    env = surveillance.make(BRIEF, random=3, pictures=False)
    for timestep in fly(env, Dice(BRIEF), episodes=2):
        team = env.task.team
        assert env.physics.time() == team.time[0] == timestep.observation["time"][0]
        assert env.physics.world is team.batch.worlds[0] and env.physics.world.seed == team.batch.seeds[0]


def test_a_seed_given_to_reset_is_the_mission():
    env, other = (surveillance.make(BRIEF, random=seed, pictures=False) for seed in (1, 2))
    for e in (env, other):
        e.reset()
        e.reset(seed=77)
        assert e.task.team.batch.seeds == [77]
    env.reset(), other.reset()
    assert env.task.team.batch.seeds == other.task.team.batch.seeds != [77], "and those after it follow"
    np.testing.assert_equal(env.reset(seed=77).observation, other.reset(seed=77).observation)


def test_a_random_state_draws_the_first_seed():
    def seeds(random):
        env = surveillance.make(BRIEF, random=random, pictures=False)
        return [(env.reset(), env.task.team.batch.seeds[0])[1] for _ in range(3)]

    assert seeds(np.random.RandomState(5)) == seeds(np.random.RandomState(5)) != seeds(np.random.RandomState(6))
    assert seeds(None) != seeds(None)


def test_seeds_in_the_manner_of_dm_controls_suite():
    """As shimmy's and TorchRL's wrappers give them: a RandomState in the place of the task's."""
    env = surveillance.make(BRIEF, random=8, pictures=False, period=60)

    def missions(n=2):
        return [(env.reset(), env.task.team.batch.seeds[0])[1] for _ in range(n)]

    found = []
    for seed in (3, 3, 4):
        assert isinstance(env.task._random, np.random.RandomState) and env.task.random is env.task._random
        env.task._random = np.random.RandomState(seed)
        upcoming = env.task.next_seed
        found.append(missions())
        assert found[-1][0] == upcoming
    assert found[0] == found[1] != found[2] and len({*found[0], *found[2], 8}) == 5
    env.task.random.seed(3)
    assert missions() == found[0], "seeded in its place"
    drawer = np.random.RandomState(3)
    assert surveillance.make(BRIEF, random=drawer, pictures=False).task.random is drawer
    with pytest.raises(ValueError, match="random must be a numpy RandomState"):
        env.task._random = 3


def test_the_missions_that_follow_a_seed_are_gymnasiums():
    env, other = surveillance.make(BRIEF, random=8, pictures=False), MissionEnv(BRIEF)
    mine = [(env.reset(), env.task.team.batch.seeds[0])[1] for _ in range(3)]
    assert mine == [other.reset(seed=seed)[1]["seed"] for seed in (8, None, None)]


def test_episodes_draw_from_the_seeds_that_are_allowed():
    env = surveillance.make(BRIEF, pictures=False, seeds=range(40, 43))
    drawn = {(env.reset(), env.task.team.batch.seeds[0])[1] for _ in range(30)}
    assert drawn == {40, 41, 42}


@pytest.mark.parametrize("flat", [False, True])
def test_a_copy_flies_on_to_the_same_bits(flat):
    env = surveillance.make(BRIEF, random=3, pictures=False, environment_kwargs={"flat_observation": flat, "gamma": 0.9})
    dice = Dice(BRIEF)
    env.reset()
    for _ in range(25):
        env.step(dice.any())
    copied = pickle.loads(pickle.dumps(env))
    assert copied.physics.data.qpos is not env.physics.data.qpos
    for _ in range(60):  # beyond the end, into the next mission
        action = dice.any()
        one, two = env.step(action), copied.step(action)
        np.testing.assert_equal(one, two)
        assert fingerprint(env.task.team.batch.state) == fingerprint(copied.task.team.batch.state)
        np.testing.assert_array_equal(env.physics.data.xpos, copied.physics.data.xpos)
    assert env.task.team.batch.seeds == copied.task.team.batch.seeds != [3]


def test_the_wrapper_for_pixels():
    kwargs = {"height": 48, "width": 64, "camera_id": "map"}
    env = pixels.Wrapper(surveillance.make(BRIEF, random=3, period=20), pixels_only=False, render_kwargs=kwargs)
    assert set(pixels.Wrapper(env, render_kwargs=kwargs).observation_spec()) == {"pixels"}
    first = env.reset()
    second = env.step(np.full(env.action_spec().shape, 5) % (env.action_spec().maximum + 1))
    for timestep in (first, second):
        tree.assert_same_structure(timestep.observation, env.observation_spec())
        picture = timestep.observation["pixels"]
        assert picture.shape == (48, 64, 3) and picture.dtype == np.uint8 and picture.std() > 5
    assert {"robots", "action_mask"} < set(first.observation)
    assert not np.array_equal(first.observation["pixels"], second.observation["pixels"]), "robots have moved"


@every_task
def test_pictures_are_not_blank(domain, task):
    env = load(domain, task, seed=1, pictures=True)
    env.reset()
    pictures = [env.physics.render(48, 64, camera_id=camera) for camera in range(env.physics.model.ncam)]
    assert all(picture.shape == (48, 64, 3) and picture.std() > 5 for picture in pictures)
    assert not np.array_equal(*pictures[:2])
