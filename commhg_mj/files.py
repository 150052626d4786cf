"""Files appear whole or not at all."""

import contextlib
import os
from pathlib import Path


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
    try:
        part.touch()
        yield part
        os.replace(part, out)
    except OSError as error:
        raise ValueError(f"cannot write {out}: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
