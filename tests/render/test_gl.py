"""The choice of an OpenGL backend, each in a process of its own."""

import os
import subprocess
import sys

HIDE = "sys.modules['mujoco.{}'] = None"
FAKE = """
class GLContext:
    def __init__(self, width, height): pass
    def make_current(self): pass
module = type(sys)('mujoco.osmesa')
module.GLContext = GLContext
sys.modules['mujoco.osmesa'] = module
"""
MAKE = """
from commhg_mj.render.gl import make_context
try:
    context = make_context(16, 16)
    print(type(context).__module__, os.environ['PYOPENGL_PLATFORM'])
    getattr(context, 'free', lambda: None)()
except RuntimeError as error:
    print(error)
"""


def choose(*preparations) -> str:
    """What `make_context` says in a fresh process."""
    clean = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    code = "\n".join(["import os, sys, mujoco", *preparations, MAKE])
    done = subprocess.run([sys.executable, "-c", code], env=clean, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_egl_is_the_default():
    assert choose() == "mujoco.egl egl"


def test_osmesa_is_the_fallback():
    assert choose(HIDE.format("egl"), FAKE).endswith(" osmesa")


def test_fallback_after_egl_fails_late():
    """EGL may load and yet open no display; its traces must not keep OSMesa from loading."""
    broken = """
os.environ['PYOPENGL_PLATFORM'] = 'egl'
import mujoco.egl
mujoco.egl.create_initialized_egl_device_display = lambda: mujoco.egl.EGL.EGL_NO_DISPLAY
"""
    said = choose(broken, FAKE, "import atexit; atexit.register(lambda: print('OpenGL' in sys.modules))")
    assert said.split() == ["__main__", "osmesa", "False"]


def test_the_error_names_packages():
    """Whatever MUJOCO_GL asks for."""
    again = [f"os.environ['MUJOCO_GL'] = '{wanted}'\n{MAKE}" for wanted in ("", "egl")]
    said = choose(HIDE.format("egl"), HIDE.format("osmesa"), *again, "os.environ['MUJOCO_GL'] = 'osmesa'").splitlines()
    assert len(said) == 3
    assert all("libegl1 libgl1-mesa-dri libopengl0" in line and "libosmesa6" in line for line in said)
