"""What an actor remembers of earlier reports: its own past, once each, of this mission alone."""

import numpy as np
from flying import copied
from learners import SHORT
from strategies import change

from commhg_mj.learning.features import PAST
from commhg_mj.learning.graphs import GraphBuilder, Wants
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.policies import POLICIES

N = 3
MISSION = change(SHORT, time_limit=200)
KNOWN, X, SINCE = PAST.columns("exists", "x", "since")


def flown(seeds, seconds):
    """Every second's (observations, graphs) of robots and operators."""
    batch = MissionBatch(MISSION, seeds, links="perfect")
    greedy, builder, told = POLICIES["greedy"].make(batch), GraphBuilder(batch, Wants(n_past=N)), []
    while not batch.over.all() and batch.time.max() < seconds:
        seen = batch.observations
        told.append((copied(seen), builder.robots(seen), builder.operators(seen)))
        batch.step(greedy(seen))
    return batch, builder, told


def test_the_last_reports_are_remembered_newest_last_and_each_once():
    _, _, told = flown([1], 100)
    heard = {}  # (robot, peer): [(evidence time, x)] by the observations alone
    for seen, graphs, _ in told:
        e = 0
        for i, robot in enumerate(seen.robots):
            for peer, row in enumerate(seen.robot_peers[i]):
                if row["age"] < 0:
                    continue
                past = heard.setdefault((robot["robot"], peer), [])
                time = robot["time"] - row["age"]
                if not past or time > past[-1][0]:
                    past.append((time, row["x"] / MISSION.map_side))
                window, wanted = graphs.peer_past[e], past[-N:]
                assert graphs.peer[e] == peer and window[:, KNOWN].sum() == len(wanted)
                np.testing.assert_allclose(window[N - len(wanted) :, X], [x for _, x in wanted], atol=1e-6)
                ages = [np.exp(-(robot["time"] - time) / 200.0) for time, _ in wanted]
                np.testing.assert_allclose(window[N - len(wanted) :, SINCE], ages, atol=1e-5)
                e += 1
    assert max(map(len, heard.values())) > N


def test_to_look_twice_remembers_nothing_twice():
    batch, builder, _ = flown([1, 2], 40)
    seen = batch.observe_everyone()
    one, other = builder.robots(seen), builder.robots(seen)
    assert np.array_equal(one.peer_past, other.peer_past) and one.peer_past[..., KNOWN].any()
    reports = builder.operators(seen).past, builder.operators(seen).past
    assert np.array_equal(*reports) and reports[0][..., KNOWN].any()


def test_a_mission_forgets_the_one_before():
    batch, builder, _ = flown([1], 60)
    seen = batch.reset()
    builder.robots(seen), builder.operators(seen)
    assert not any(columns[..., KNOWN].any() for columns in builder.memory.columns())


def test_nobody_else_remembers():
    """A mission's memory does not depend on its neighbours."""
    alone, beside = flown([7], 60)[2], flown([3, 7], 60)[2]

    def windows(told, mission):
        of_mission = (np.repeat(graphs.mission, np.diff(graphs.peer_ptr)) == mission for _, graphs, _ in told)
        return [window for (_, graphs, _), mine in zip(told, of_mission) for window in graphs.peer_past[mine]]

    pairs = list(zip(windows(alone, 0), windows(beside, 1)))
    assert len(pairs) > 50 and all(np.array_equal(*pair) for pair in pairs)
