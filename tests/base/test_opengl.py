"""The choice of an OpenGL backend and the end of its contexts, each in a process of its own."""

import os
import subprocess
import sys
from ctypes.util import find_library
from pathlib import Path
from types import SimpleNamespace

import pytest

import commhg_mj
from commhg_mj.base.opengl import PACKAGES, choose_backend

HIDE = "sys.modules['mujoco.{}'] = None"
FAKE = """
class GLContext:
    def __init__(self, width, height): pass
    def make_current(self): pass
module = type(sys)('mujoco.osmesa')
module.GLContext = GLContext
sys.modules['mujoco.osmesa'] = module
"""
BROKEN = """
os.environ['PYOPENGL_PLATFORM'] = 'egl'
import mujoco.egl
mujoco.egl.create_initialized_egl_device_display = lambda: mujoco.egl.EGL.EGL_NO_DISPLAY
"""
ALONE = f"""
package = type(sys)("commhg_mj")
package.__path__ = [{str(Path(commhg_mj.__file__).parent)!r}]
sys.modules["commhg_mj"] = package
"""
MAKE = """
from commhg_mj.base.opengl import make_context
try:
    context = make_context(16, 16)
    print(type(context).__base__.__module__, os.environ['PYOPENGL_PLATFORM'])
    getattr(context, 'free', lambda: None)()
except RuntimeError as error:
    print(error)
"""


CHOOSE = """
from commhg_mj.base.opengl import choose_backend
choose_backend()
print(os.environ.get('MUJOCO_GL'))
"""
THEIRS = """
from dm_control import suite
poles = suite.load('cartpole', 'balance').physics
print(poles.render(16, 16).std() > 5)
"""
OURS = """
import commhg_mj
from commhg_mj.render.stage import Stage
stage = Stage(commhg_mj.make_world(commhg_mj.SCENARIOS['small'], 1), (64, 64))
"""
FORK = f"""
import signal, time
import cv2, numpy
sys.path.append({str(Path(__file__).parents[1] / "render")!r})
from synthetic import make_trace
from commhg_mj.render.film import Film
cv2.setNumThreads(2)
cv2.resize(numpy.ones((2000, 2000, 3), 'f4'), (500, 500), interpolation=cv2.INTER_AREA)
time.sleep(0.5)  # OpenCV's threads fall asleep
if os.fork() == 0:
    signal.alarm(30)
    os._exit(Film(make_trace('small', ticks=5), 'map', (64, 64), 9.0).picture(1.0).std() > 5)
print(os.waitstatus_to_exitcode(os.wait()[1]))
"""
IMPORT = """
import commhg_mj.tasks
print('mujoco' in sys.modules, os.environ.get('MUJOCO_GL'))
"""


def run(*code, **variables) -> subprocess.CompletedProcess:
    """A fresh process without a screen or a choice of OpenGL, but for those variables."""
    choices = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")
    clean = {k: v for k, v in os.environ.items() if k not in choices} | variables
    command = [sys.executable, "-c", "\n".join(["import os, sys", *code])]
    return subprocess.run(command, env=clean, capture_output=True, text=True, check=True)


def choose(*preparations) -> str:
    """What `make_context` says in a fresh process, which imports no other room."""
    return run("import mujoco", ALONE, *preparations, MAKE).stdout.strip()


def test_egl_is_the_default():
    assert choose() == "mujoco.egl egl"


def test_osmesa_is_the_fallback():
    assert choose(HIDE.format("egl"), FAKE).endswith(" osmesa")


def test_fallback_after_egl_fails_late():
    """EGL may load and yet open no display; its traces must not keep OSMesa from loading."""
    said = choose(BROKEN, FAKE, "import atexit; atexit.register(lambda: print('OpenGL' in sys.modules))")
    assert said.split() == ["__main__", "osmesa", "False"]


def test_the_error_names_packages():
    """Whatever MUJOCO_GL asks for."""
    again = [f"os.environ['MUJOCO_GL'] = '{wanted}'\n{MAKE}" for wanted in ("", "egl")]
    said = choose(HIDE.format("egl"), HIDE.format("osmesa"), *again, "os.environ['MUJOCO_GL'] = 'osmesa'").splitlines()
    assert len(said) == 3
    assert all("libegl1 libgl1-mesa-dri libopengl0" in line and "libosmesa6" in line for line in said)


@pytest.mark.parametrize("screen", [{}, {"DISPLAY": ":4711"}], ids=["none", "dead"])
def test_dm_control_finds_opengl_without_a_screen(screen):
    """If ours is imported before, which itself costs nothing."""
    said = run(IMPORT, THEIRS, "print(os.environ['MUJOCO_GL'])", **screen).stdout.split()
    assert said[:3] == ["False", "None", "True"] and said[3] in PACKAGES


@pytest.mark.parametrize("broken", [HIDE.format("egl"), BROKEN], ids=["no EGL", "EGL without a display"])
def test_dm_control_falls_back_on_osmesa(broken):
    assert run(ALONE, broken, FAKE, CHOOSE).stdout.split() == ["osmesa"]


@pytest.mark.parametrize("chosen, screen", [(None, True), ("off", False)])
def test_screens_and_choices_of_the_users_stay(chosen, screen, monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    if chosen:
        monkeypatch.setenv("MUJOCO_GL", chosen)
    monkeypatch.setitem(sys.modules, "glfw", SimpleNamespace(init=lambda: screen))
    choose_backend()
    assert os.environ.get("MUJOCO_GL") == chosen


@pytest.mark.parametrize(
    "scripts",
    [[OURS], pytest.param([IMPORT, THEIRS, OURS], marks=pytest.mark.slow), pytest.param([OURS, THEIRS], marks=pytest.mark.slow)],
    ids=["alone", "after", "before"],
)
def test_forgotten_films_end_in_silence(scripts):
    """Beside those that dm_control closes itself, too."""
    done = run(*scripts)
    assert "Exception" not in done.stderr


@pytest.mark.skipif(not find_library("OSMesa"), reason="libosmesa6 is not installed")
@pytest.mark.slow
def test_forgotten_films_of_osmesa_end_in_silence():
    done = run(OURS, MUJOCO_GL="osmesa")
    assert "Exception" not in done.stderr


def test_a_process_forked_before_anything_was_drawn_draws():
    """Though OpenCV has lost the threads that it had."""
    assert run(FORK).stdout.split() == ["1"]
