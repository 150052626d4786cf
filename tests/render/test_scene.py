"""A second of a trace and the simulator's state at that second are one scene."""

import numpy as np

from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.trace import make_traces
from commhg_mj.policies import POLICIES
from commhg_mj.render.scene import scene_of_state, scene_of_trace


def test_trace_and_state_are_one_scene():
    batch = MissionBatch("small", [5], record=True)
    policy, scenes = POLICIES["random"].make(batch), {}
    while not batch.over[0]:
        state = batch.state
        # Somebody may decide twice in a second: the trace's row is how things stood before.
        scenes.setdefault(
            int(batch.time[0]), scene_of_state(state.tasks[0].copy(), state.robots[0].copy(), state.operators[0].copy())
        )
        batch.step(policy(batch.observations))
    (trace,) = make_traces(batch, "random")
    assert len(scenes) > 100 and any(scene.status.max() == 2 for scene in scenes.values())
    for second, scene in scenes.items():
        kept = scene_of_trace(trace, second)
        for name in ("task_xy", "released", "kind", "status", "robot_task", "activity", "session", "operator_robot"):
            np.testing.assert_array_equal(getattr(kept, name), getattr(scene, name), f"{name} at {second} s")
        np.testing.assert_allclose(kept.robot_xy, scene.robot_xy, atol=1e-3)
        at_work = scene.status == 1
        np.testing.assert_allclose(kept.progress[at_work], scene.progress[at_work], atol=1e-6)
