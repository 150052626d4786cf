"""An OpenGL context without a display: EGL, or OSMesa where EGL does not work."""

import importlib
import os
import sys

PACKAGES = {"egl": "libegl1 libgl1-mesa-dri libopengl0", "osmesa": "libosmesa6"}


def make_context(width: int, height: int):
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
            context = _load(backend).GLContext(width, height)
            context.make_current()
            return context
        except Exception as error:  # noqa: BLE001  PyOpenGL says that a library is missing by whatever fails first
            failures.append(f"{backend}: {str(error).splitlines()[0] if str(error) else type(error).__name__}")
    needs = " or ".join(f"`{packages}`" for packages in PACKAGES.values())
    raise RuntimeError(f"no OpenGL without a display ({'; '.join(failures)}): install the Debian packages {needs}")


def choose_backend() -> None:
    """Set MUJOCO_GL for dm_control, which reads it when it is imported and asks for a screen unless told otherwise."""
    if sys.platform != "linux" or any(name in os.environ for name in ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY")):
        return
    for backend in PACKAGES:
        try:
            _load(backend)
        except Exception:  # noqa: BLE001  as above
            continue
        os.environ["MUJOCO_GL"] = backend
        return


def _load(backend):
    """MuJoCo's wrapper of a backend; PyOpenGL, once loaded for another one, must be loaded anew."""
    if os.environ.get("PYOPENGL_PLATFORM", backend) != backend:
        for name in [name for name in sys.modules if name.split(".")[0] == "OpenGL"]:
            del sys.modules[name]
    os.environ["PYOPENGL_PLATFORM"] = backend
    return importlib.import_module(f"mujoco.{backend}")
