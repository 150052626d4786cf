"""Files appear whole or not at all."""

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

LOCK = ".lock"  # stays in a folder that was held, empty
_parts = set()  # under way in this process


@contextlib.contextmanager
def whole_file(out) -> Iterator[Path]:
    """A path to write to in the folder of `out`, renamed to `out` at the end, removed after an error.

    Raises:
      ValueError: `out` cannot be written, or is refused by `target_of`; the message names it.
    """
    target = target_of(out)
    part = target.with_name(f".{secrets.token_hex(8)}.part{Path(out).suffix}")  # fits wherever the name of `out` does
    _parts.add(part)
    try:
        with naming(out):
            part.touch()
            yield part
            os.replace(part, target)
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        _parts.discard(part)


@contextlib.contextmanager
def naming(out) -> Iterator[None]:
    """Let a file or folder that cannot be written, be it for a full disk, be named in one line, as a ValueError."""
    try:
        yield
    except OSError as error:
        raise ValueError(f"cannot write {out}: {error.strerror or error}") from None


@contextlib.contextmanager
def held(folder) -> Iterator[None]:
    """A folder for this process alone, within a block or until it is killed.

    Raises:
      ValueError: another process holds it, or it cannot be written to; the message names it.
    """
    lock = FileLock(Path(folder) / LOCK)
    with naming(folder):
        try:
            lock.acquire(timeout=0)
        except Timeout:
            raise ValueError(f"{folder} is in use by another process") from None
    try:
        yield
    finally:
        lock.release()


def target_of(out) -> Path:
    """The file that `out` names: a link leads to what is replaced, and stays.

    Raises:
      ValueError: it is a folder, a device, a pipe or the like, which a new file would destroy; the message names it.
    """
    target = os.path.realpath(out)
    if os.path.isdir(target):
        raise ValueError(f"cannot write {out}: it is a folder")
    if os.path.lexists(target) and not os.path.isfile(target):
        raise ValueError(f"cannot write {out}: it is no regular file")
    return Path(target)


def remove_parts() -> None:
    """Remove what is half-written, for a process that is about to end on the spot."""
    for part in list(_parts):
        with contextlib.suppress(OSError):
            part.unlink()
