"""OpenGL shared with dm_control, with other threads, and not with forked processes."""

import threading
import warnings
from contextlib import closing

import gymnasium
import numpy as np
import pytest
from dm_control.suite.wrappers import pixels
from playing import BRIEF

from commhg_mj.mission.trace import make_traces
from commhg_mj.render import render_image
from commhg_mj.tasks import MissionEnv, surveillance

KWARGS = {"height": 48, "width": 64, "camera_id": "overview"}
WAIT = 30  # s: what hangs fails then


def make():
    """An environment that has begun and can be looked at."""
    env = MissionEnv(BRIEF, render_mode="rgb_array", size=(192, 108))
    env.reset(seed=1)
    return env


@pytest.fixture
def takes():
    """Functions that take a picture by dm_control, of an environment that has its OpenGL context."""
    env = surveillance.make(BRIEF, random=3, period=20)
    wrapped = pixels.Wrapper(env, render_kwargs=KWARGS)

    def observe():
        env.reset(seed=3)
        return wrapped.step(np.zeros(env.action_spec().shape, int)).observation["pixels"]

    yield observe, lambda: env.physics.render(**KWARGS)
    env.physics.free()


def test_pictures_leave_dm_controls_alone(takes, tmp_path):
    """Whether made, taken or closed in between, or forgotten."""
    before = [take().copy() for take in takes]

    def check():
        for picture, take in zip(before, takes):
            np.testing.assert_array_equal(take(), picture)

    env = make()
    first = env.render()
    check()
    np.testing.assert_array_equal(env.render(), first, "nor do they change ours")
    check()
    (trace,) = make_traces(env.team.batch, "nobody")
    render_image(trace, tmp_path / "picture.png", size=(192, 108))
    check()
    env.close()
    check()
    make().render()
    check()


def test_pictures_from_any_thread():
    found = []
    with closing(make()) as env:
        first = env.render()
        for _ in range(2):
            thread = threading.Thread(target=lambda: found.append(env.render()))
            thread.start(), thread.join()
            found.append(env.render())
    assert len(found) == 4
    for picture in found:
        np.testing.assert_array_equal(picture, first)


def test_an_error_in_another_thread_is_the_callers(monkeypatch):
    def fail(*_):
        raise RuntimeError("no OpenGL here")

    monkeypatch.setattr("commhg_mj.render.stage.make_context", fail)
    with pytest.raises(RuntimeError, match="no OpenGL here"):
        make().render()


def test_forked_processes_are_refused_pictures_and_nothing_else():
    with closing(make()) as env, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # gymnasium reports the error in a warning, too
        picture = env.render()
        envs = gymnasium.vector.AsyncVectorEnv([make], context="fork", daemon=True)
        try:
            envs.reset_async(seed=5), envs.reset_wait(WAIT)
            envs.step_async(envs.action_space.sample()), envs.step_wait(WAIT)
            envs.call_async("render")
            with pytest.raises(RuntimeError, match='^a process forked .* cannot draw: .*context="spawn"$'):
                envs.call_wait(WAIT)
        finally:
            envs.close_extras(terminate=True)
        np.testing.assert_array_equal(env.render(), picture)
