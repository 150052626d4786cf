"""Files appear whole or not at all."""

import contextlib
import os
from pathlib import Path

_parts = set()  # under way in this process


@contextlib.contextmanager
def whole_file(out):
    """A path to write to in the folder of `out`, renamed to `out` at the end, removed after an error.

    Raises:
      ValueError: `out` cannot be written, or is a folder itself; the message names it.
    """
    out = Path(out)
    if out.is_dir():
        raise ValueError(f"cannot write {out}: it is a folder")
    part = out.with_name(f".{out.stem}.{os.getpid()}.part{out.suffix}")
    _parts.add(part)
    try:
        part.touch()
        yield part
        os.replace(part, out)
    except OSError as error:
        raise ValueError(f"cannot write {out}: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        _parts.discard(part)


def remove_parts() -> None:
    """Remove what is half-written, for a process that is about to end on the spot."""
    for part in list(_parts):
        with contextlib.suppress(OSError):
            part.unlink()
