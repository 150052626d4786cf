"""What commands share: where they print, progress bars, checks of their options."""

import contextlib
import dataclasses
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from typing import Literal

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..base.files import naming, target_of

for name in ("stdout", "stderr"):
    if getattr(sys, name) is None:  # the caller has closed it: what is printed there goes nowhere
        setattr(sys, name, open(os.devnull, "w"))

Limitation = Literal["nominal", "low", "high"]
Profile = Literal["matched", "edge", "radio"]
OUT = Console(width=None if sys.stdout.isatty() else 160)
WIDE = Console(width=1000)  # for tables that go into pages: their lines are not broken
LOG = Console(stderr=True)


@contextlib.contextmanager
def progress(what, total) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error; yields how to advance it, by parts, too."""
    columns = TextColumn(what), BarColumn(), MofNCompleteColumn() if total > 1 else TextColumn("{task.percentage:.0f} %")
    with Progress(*columns, TimeRemainingColumn(), console=LOG, transient=True, disable=not LOG.is_terminal) as progress:
        task = progress.add_task(what, total=total)
        yield lambda amount: progress.advance(task, amount)


def say(text, console=OUT, **style) -> None:
    """Print one line as it is: paths are neither wrapped nor read as markup."""
    console.print(text, markup=False, highlight=False, soft_wrap=True, **style)


def show(value) -> str:
    return ", ".join(map(show, value)) if isinstance(value, tuple) else f"{value:g}" if isinstance(value, float) else str(value)


def parse_size(text) -> tuple[int, int]:
    width, x, height = text.partition("x")
    if not (x and width.isdecimal() and height.isdecimal()):
        raise ValueError(f"--size must be WIDTHxHEIGHT, for example 1280x720, is {text!r}")
    return int(width), int(height)


def at_least(name, value, least) -> None:
    if value < least:
        raise ValueError(f"--{name} must be at least {least}, is {value}")


def without_effect(command, beside, **names) -> None:
    """Refuse options of other than their default values that have no effect beside another one.

    Args:
      names: fields of the command, each with its option's name.
    """
    for field in dataclasses.fields(command):
        if field.name in names and getattr(command, field.name) != field.default:
            raise ValueError(f"--{names[field.name]} has no effect beside --{beside}")


def check_png(out) -> None:
    """Refuse a picture by any other ending, or where there can be none."""
    if out is not None and out.suffix.lower() != ".png":
        raise ValueError(f"--out {out}: the name must end in .png")
    check_file(out)


def check_file(out) -> None:
    """Refuse before the work what `whole_file` would refuse after it."""
    if out is not None:
        with naming(out), tempfile.TemporaryFile(dir=target_of(out).parent):
            pass


def load_mujoco() -> None:
    """MuJoCo loads the backend that MUJOCO_GL names when it is imported, and fails however that one fails."""
    try:
        import mujoco  # noqa: F401
    except Exception as error:
        needs = "libegl1 libgl1-mesa-dri libopengl0 (MUJOCO_GL=egl) or libosmesa6 (MUJOCO_GL=osmesa)"
        backend = os.environ.get("MUJOCO_GL")
        raise RuntimeError(f"MUJOCO_GL={backend} does not work here ({error}): install {needs}, or unset it") from None


def check_folder(out) -> None:
    """Refuse before the work what `make_folder` would refuse after it."""
    there = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not there.is_dir():
        raise ValueError(f"--out {out}: {there} is no folder")
    if not os.access(there, os.W_OK):
        raise ValueError(f"--out {out}: permission denied")


def make_folder(path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"--out {path}: {error.strerror}") from None
    if not os.access(path, os.W_OK):
        raise ValueError(f"--out {path}: permission denied")
