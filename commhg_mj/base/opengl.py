"""An OpenGL context without a display: EGL, or OSMesa where EGL does not work."""

import atexit
import importlib
import os
import sys
import warnings
from typing import Any

PACKAGES = {"egl": "libegl1 libgl1-mesa-dri libopengl0", "osmesa": "libosmesa6"}


def make_context(width: int, height: int) -> Any:
    """A current off-screen context. MUJOCO_GL=egl or osmesa allows that one alone.

    Mesa's software rasteriser gets one thread, since pictures are rendered in parallel by process.

    Raises:
      RuntimeError: no backend works; the message names the packages that bring one.
    """
    os.environ.setdefault("LP_NUM_THREADS", "1")
    wanted = os.environ.get("MUJOCO_GL", "").lower()
    failures = []
    for backend in [wanted] if wanted in PACKAGES else PACKAGES:
        try:
            context = _own_class(_load(backend))(width, height)
            context.make_current()
            return context
        except Exception as error:  # noqa: BLE001  PyOpenGL says that a library is missing by whatever fails first
            failures.append(f"{backend}: {str(error).splitlines()[0] if str(error) else type(error).__name__}")
    needs = " or ".join(f"`{packages}`" for packages in PACKAGES.values())
    raise RuntimeError(f"no OpenGL without a display ({'; '.join(failures)}): install the Debian packages {needs}")


def _own_class(module):
    """MuJoCo's context, which nobody but its owner frees, and that ends with the process.

    By itself it is also freed wherever it is collected, and for EGL the display is shut before the process ends, with the
    contexts of all who use it.
    """

    class GLContext(module.GLContext):
        def __init__(self, width, height):
            super().__init__(width, height)
            if hasattr(module, "EGL"):
                atexit.unregister(module.EGL.eglTerminate)

        def __del__(self):
            pass

    return GLContext


def choose_backend() -> None:
    """Set MUJOCO_GL for dm_control, which reads it when it is imported and asks for a screen unless told otherwise."""
    if sys.platform != "linux" or "MUJOCO_GL" in os.environ or _has_screen():
        return
    for backend in PACKAGES:
        try:
            module = _load(backend)
            if backend == "egl" and module.create_initialized_egl_device_display() == module.EGL.EGL_NO_DISPLAY:
                continue
        except Exception:  # noqa: BLE001  as above
            continue
        os.environ["MUJOCO_GL"] = backend
        return


def _has_screen():
    """Whether dm_control would find one: DISPLAY may name one that nobody answers at."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that there is none
            import glfw

            return bool(glfw.init())
    except Exception:  # noqa: BLE001  however it says that it cannot work here
        return False


def _load(backend):
    """MuJoCo's wrapper of a backend; PyOpenGL, once loaded for another one, must be loaded anew."""
    if os.environ.get("PYOPENGL_PLATFORM", backend) != backend:
        for name in [name for name in sys.modules if name.split(".")[0] == "OpenGL"]:
            del sys.modules[name]
    os.environ["PYOPENGL_PLATFORM"] = backend
    return importlib.import_module(f"mujoco.{backend}")
