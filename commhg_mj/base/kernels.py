"""One decorator for every compiled kernel, and the rules of its on-disk cache.

numba notices an edited file only for the functions defined in it, not for their callers elsewhere. So
the cache folder carries a hash of every kernel's source: an edited kernel is never served stale. What is damaged there is
compiled anew.
"""

import contextlib
import hashlib
import os
import sys
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core.caching import FunctionCache

PACKAGE = Path(__file__).parent.parent
FIRST_START = []  # what compiles every kernel, by running it: policies/warm.py's


def kernel_files() -> list[Path]:
    """The files of every room in which a file imports this one: there kernels and what they are made of live."""
    rooms = {path.parent for path in PACKAGE.rglob("*.py") if b"kernels import" in path.read_bytes()}
    return sorted(path for room in rooms for path in room.glob("*.py"))


def _source_hash() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for source in map(Path.read_bytes, kernel_files()):
        if b"kernel" in source or b"formula" in source or b"Enum" in source or b"record(" in source:
            digest.update(source)
    return digest.hexdigest()[:16]


def _cache_dir() -> Path:
    """Of this user and of these sources; works for read-only installs and unwritable homes."""
    home = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for base in (home, f"{tempfile.gettempdir()}/cache-{os.getuid()}"):
        if base.startswith("~"):  # nobody's home
            continue
        folder = Path(base).absolute() / "commhg_mj" / f"kernels-{_source_hash()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            # numba runs what it finds there: nobody else may have made the folder.
            if os.access(folder, os.W_OK) and folder.stat().st_uid == os.getuid():
                return folder
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix="commhg_mj-kernels-"))


def _installation() -> str:
    """numba files its work by the paths and times of sources: another installation compiles for itself."""
    newest = max(path.stat().st_mtime_ns for path in kernel_files())
    return hashlib.sha256(f"{PACKAGE} {newest}".encode()).hexdigest()[:8]


CACHE_DIR = _cache_dir()
COMPILED = CACHE_DIR / f"compiled-{_installation()}"  # left behind once every kernel has been compiled
numba.config.CACHE_DIR = str(CACHE_DIR)


class KernelCache(FunctionCache):
    """numba's own takes a damaged file for an error of its caller."""

    def load_overload(self, sig, target_context) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # unpickling raises whatever it meets
            _tell_damage(numba.config.CACHE_DIR)
            with contextlib.suppress(OSError):
                self.flush()
            return None


@cache
def _tell_damage(folder):
    print(f"damaged kernels in {folder}: compiling them anew", file=sys.stderr, flush=True)


def _kept(compile):
    """A decorator of numba's that keeps what it compiles in a `KernelCache`."""

    def keep(function):
        compiled = compile(function)
        if isinstance(compiled, numba.np.ufunc.dufunc.DUFunc):
            compiled._dispatcher.cache = KernelCache(function)
        else:
            compiled._cache = KernelCache(function)
        return compiled

    return keep


kernel = _kept(numba.njit(nogil=True, error_model="numpy"))
reduction = _kept(numba.njit(nogil=True, error_model="numpy", fastmath={"reassoc", "contract"}))  # long sums, any order
formula = _kept(numba.vectorize())  # of numbers inside kernels, of arrays outside


def ensure_compiled() -> None:
    """Compile what is not compiled yet for these sources, and say so while it runs (on standard error)."""
    if COMPILED.exists() or not FIRST_START:
        return
    compile_all = FIRST_START.pop()  # it begins missions itself
    print("compiling kernels, once for this version (one to three minutes) ...", end=" ", file=sys.stderr, flush=True)
    start = time.perf_counter()
    compile_all()
    COMPILED.touch()
    print(f"done in {time.perf_counter() - start:.0f} s", file=sys.stderr)


def record(**fields) -> np.dtype:
    """A record type for kernels from field=type or field=(type, shape)."""
    return np.dtype([(name, *(kind if isinstance(kind, tuple) else (kind,))) for name, kind in fields.items()], align=True)
