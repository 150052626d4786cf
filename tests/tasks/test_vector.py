"""The native vector environment against gymnasium's own over the same missions, step by step."""

import copy
import pickle
import warnings
from contextlib import closing

import gymnasium
import numpy as np
import pytest
from flying import fingerprint
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import DictInfoToList
from playing import BRIEF, BRITTLE, LONELY, Dice

from commhg_mj.radio import LINK_MODELS
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.tasks import MissionEnv, MissionVectorEnv
from commhg_mj.tasks.registration import ID

COMMON = ("seed", "time", "elapsed", "replaced", "mission_reward", "coordination_reward", "twcr")
SMALL_PICTURE = {"render_mode": "rgb_array", "size": (64, 64), "camera": "map"}
BRISK = 10  # s a step: ends come often


def side_by_side(scenario, n, **options):
    """(gymnasium's, ours) over the same missions."""
    theirs = SyncVectorEnv([lambda: MissionEnv(scenario, **options) for _ in range(n)])
    return theirs, MissionVectorEnv(n, scenario, **options)


def check_infos(theirs, ours):
    """Ours are the same, name by name and type by type; their order does not count."""
    assert set(ours) == set(theirs)
    for name in ours:
        one, two = theirs[name], ours[name]
        assert type(one) is type(two), name
        if isinstance(one, dict):
            check_infos(one, two)
        elif one.dtype == object:
            for expected, found in zip(one, two, strict=True):
                assert type(found) is tuple
                np.testing.assert_equal(found, expected)
        else:
            np.testing.assert_array_equal(two, one, name, strict=True)


def check_steps(theirs, ours):
    for name, array in theirs[0].items():
        np.testing.assert_array_equal(ours[0][name], array, name, strict=True)
    for one, two in zip(theirs[1:4], ours[1:4]):
        np.testing.assert_array_equal(one, two, strict=True)
    check_infos(theirs[4], ours[4])


@pytest.mark.parametrize("scenario", [BRIEF, BRITTLE, LONELY], ids=["brief", "brittle", "lonely"])
@pytest.mark.parametrize("period", [0, BRISK])
def test_ours_equals_gymnasiums_step_by_step_across_new_missions(scenario, period):
    theirs, ours = side_by_side(scenario, 2, period=period)
    dice, ends = Dice(scenario), 0
    one, two = theirs.reset(seed=5), ours.reset(seed=5)
    for name, array in one[0].items():
        np.testing.assert_array_equal(two[0][name], array, strict=True)
    check_infos(one[1], two[1])
    seen = two[0]
    for _ in range(400 if period == 0 else 45):
        actions = dice.open(seen["action_mask"])
        one, two = theirs.step(actions), ours.step(actions)
        check_steps(one, two)
        seen, ends = two[0], ends + two[2].sum()
        if ends >= 5:
            break
    assert ends >= 5, "several missions after one another"


def test_the_action_that_begins_a_mission_counts_for_nothing():
    theirs, ours = side_by_side(BRIEF, 2, period=60)
    dice = Dice(BRIEF)
    theirs.reset(seed=5), ours.reset(seed=5)
    for _ in range(4):
        actions = dice.any((2,))
        one, two = theirs.step(actions), ours.step(actions)
        np.testing.assert_array_equal(two[4]["replaced"], one[4]["replaced"])


def test_whatever_actions_say():
    theirs, ours = side_by_side(BRIEF, 2, period=BRISK)
    dice = Dice(BRIEF)
    theirs.reset(seed=5), ours.reset(seed=5)
    for _ in range(20):
        actions = dice.any((2,))
        check_steps(theirs.step(actions), ours.step(actions))


@pytest.mark.parametrize("links", LINK_MODELS)
def test_with_every_link_model(links):
    theirs, ours = side_by_side(BRIEF, 2, period=20, links=links, limitation="high", seeds=range(3))
    theirs.reset(seed=1), ours.reset(seed=1)
    dice = Dice(BRIEF)
    for _ in range(8):
        actions = dice.any((2,))
        check_steps(theirs.step(actions), ours.step(actions))
    assert set(ours.team.batch.seeds) <= {0, 1, 2}


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_gymnasium_makes_it(scenario):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ours = gymnasium.make_vec(ID.format(scenario), num_envs=2, vectorization_mode="vector_entry_point", period=60)
        theirs = gymnasium.make_vec(ID.format(scenario), num_envs=2, vectorization_mode="sync", period=60)
    assert isinstance(ours, MissionVectorEnv) and ours.num_envs == 2
    assert ours.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert ours.single_action_space == theirs.single_action_space and ours.action_space == theirs.action_space
    assert ours.single_observation_space == theirs.single_observation_space
    assert ours.observation_space == theirs.observation_space
    one, two = theirs.reset(seed=[7, 9]), ours.reset(seed=[7, 9])
    np.testing.assert_equal(dict(one[0]), two[0])
    ours.action_space.seed(3)
    for _ in range(4):
        assert ours.observation_space.contains(two[0])
        actions = ours.action_space.sample()
        one, two = theirs.step(actions), ours.step(actions)
        check_steps(one, two)
    ours.close()
    ours.close()


def test_seeds():
    ours = MissionVectorEnv(3, BRIEF)
    _, info = ours.reset(seed=7)
    assert info["seed"].tolist() == [7, 8, 9]
    following = ours.reset()[1]["seed"].tolist()
    assert len({*following, 7, 8, 9}) == 6
    assert ours.reset(seed=(7, 8, 9))[1]["seed"].tolist() == [7, 8, 9] and ours.reset()[1]["seed"].tolist() == following
    ours.reset(seed=7)
    mixed = ours.reset(seed=[None, 4, None])[1]["seed"].tolist()
    assert mixed == [following[0], 4, following[2]], "None goes on where it was"
    assert ours.reset(seed=np.array([1, 2, 3]))[1]["seed"].tolist() == [1, 2, 3]
    alone = MissionEnv(BRIEF)
    alone.reset(seed=8)
    assert following[1] == alone.reset()[1]["seed"]


@pytest.mark.parametrize("copies", [True, False])
def test_observations_are_copies_or_overwritten(copies):
    ours, dice = MissionVectorEnv(2, BRIEF, copy=copies), Dice(BRIEF)
    first, info = ours.reset(seed=1)
    kept, masks = copy.deepcopy(first), copy.deepcopy(info["action_mask"])
    for _ in range(10):
        second, *_ = ours.step(dice.open(ours.team.mask))
    for name in ("robots", "robot_tasks", "robot_peers", "operators", "operator_reports", "due", "action_mask"):
        assert np.array_equal(first[name], kept[name]) is copies, name
        assert np.shares_memory(first[name], second[name]) is not copies, name
    same = [np.array_equal(*pair) for one, two in zip(masks, info["action_mask"]) for pair in zip(one, two)]
    assert all(same) is copies
    other_way, dice = MissionVectorEnv(2, BRIEF, copy=not copies), Dice(BRIEF)
    other_way.reset(seed=1)
    for _ in range(10):
        other, *_ = other_way.step(dice.open(other_way.team.mask))
    np.testing.assert_equal(second, other)


def test_rewards_that_were_returned_stay_as_they_were():
    ours, dice = MissionVectorEnv(2, BRIEF, copy=False), Dice(BRIEF)
    ours.reset(seed=1)
    first = ours.step(dice.any((2,)))
    kept = copy.deepcopy((*first[1:4], {name: first[4][name] for name in COMMON if name in first[4]}))
    for _ in range(5):
        ours.step(dice.any((2,)))
    np.testing.assert_equal((*first[1:4], {name: first[4][name] for name in COMMON if name in first[4]}), kept)


@pytest.mark.parametrize("copy_of", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
def test_a_copy_flies_on_to_the_same_bits(copy_of):
    ours, dice = MissionVectorEnv(2, BRIEF, period=7), Dice(BRIEF)
    ours.reset(seed=1)
    ours.step(dice.any((2,)))
    other = copy_of(ours)
    for _ in range(20):  # into the next missions
        actions = dice.any((2,))
        one, two = ours.step(actions), other.step(actions)
        np.testing.assert_equal(one[:4], two[:4])
        check_infos(one[4], two[4])
        assert fingerprint(ours.team.batch.state) == fingerprint(other.team.batch.state)


def test_a_refused_action_changes_nothing():
    ours = MissionVectorEnv(2, BRIEF, period=20)
    seen, _ = ours.reset(seed=1)
    bad = np.zeros(ours.action_space.shape, int)
    bad[1, 3] = -1
    before, kept = fingerprint(ours.team.batch.state), copy.deepcopy(seen)
    with pytest.raises(ValueError, match="uav1 task must lie in 0..23, is -1"):
        ours.step(bad)
    assert fingerprint(ours.team.batch.state) == before
    np.testing.assert_equal(seen, kept)


def test_a_refused_action_begins_no_mission():
    ours = MissionVectorEnv(2, BRIEF, period=60)
    ours.reset(seed=1)
    fine = np.zeros(ours.action_space.shape, int)
    ours.step(fine)
    before = fingerprint(ours.team.batch.state)
    with pytest.raises(ValueError, match="uav0 task"):
        ours.step(fine - 1)
    assert fingerprint(ours.team.batch.state) == before and ours.team.batch.seeds == [1, 2]


def test_infos_as_a_list():
    theirs, ours = (DictInfoToList(envs) for envs in side_by_side(BRIEF, 2, period=30))
    check = lambda one, two: [np.testing.assert_equal(dict(sorted(b.items())), dict(sorted(a.items()))) for a, b in zip(one, two)]
    check(theirs.reset(seed=5)[1], ours.reset(seed=5)[1])
    for _ in range(4):
        actions = Dice(BRIEF).any((2,))
        one, two = theirs.step(actions)[4], ours.step(actions)[4]
        check(one, two)
    assert len({frozenset(info) for info in two}) == 1


def test_masks_serve_the_action_space():
    ours = MissionVectorEnv(3, BRIEF)
    _, infos = ours.reset(seed=5)
    for _ in range(5):
        *_, infos = ours.step(np.stack([ours.single_action_space.sample(mask) for mask in infos["action_mask"]]))
        assert not infos["replaced"].any()


def test_scores_that_were_returned_stay_as_they_were():
    ours = MissionVectorEnv(2, BRIEF, period=30)
    infos = [ours.reset(seed=1)[1]] + [ours.step(Dice(BRIEF).any((2,)))[4] for _ in range(4)]
    assert [info["duration"].tolist() for info in infos] == [[0, 0], [0, 0], [60, 60], [0, 0], [0, 0]]
    assert infos[2]["messages"]["broadcast"]["_sent"].all() and not infos[1]["messages"]["broadcast"]["sent"].any()
    with pytest.raises(ValueError, match="read-only"):
        infos[0]["twcr"][0] = 1.0


def test_pictures_are_gymnasiums():
    theirs, ours = side_by_side(BRIEF, 2, period=30, **SMALL_PICTURE)
    with closing(theirs), closing(ours):
        assert ours.render_mode == "rgb_array"
        theirs.reset(seed=5), ours.reset(seed=5)
        for _ in range(2):
            actions = Dice(BRIEF).any((2,))
            theirs.step(actions), ours.step(actions)
        one, two = theirs.render(), ours.render()
        assert type(two) is tuple and not np.array_equal(*two)
        np.testing.assert_array_equal(two, one)


def test_without_a_render_mode_there_is_nothing_to_see():
    ours = MissionVectorEnv(2, BRIEF)
    ours.reset(seed=5)
    assert ours.render() is None and not ours.team.batch.record
    with pytest.raises(ValueError, match="render_mode must be None or 'rgb_array'"):
        MissionVectorEnv(2, BRIEF, render_mode="human")
