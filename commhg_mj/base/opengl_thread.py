"""OpenGL without a display, on a thread of its own.

A thread has one current context, and whoever draws in the caller's, as dm_control does, counts on its own to stay that;
nor can a context be current in two threads. So whatever touches one of ours is called in a thread that is ours.
"""

import os
import threading
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any

_starting = threading.Lock()
_thread = None  # ours, once it is needed
_user = None  # the process that has used OpenGL
_inherited = []  # what a forked process must not free


class _GLThread(threading.Thread):
    """Calls functions, one after the other."""

    def __init__(self):
        super().__init__(name="OpenGL", daemon=True)
        self._calls = SimpleQueue()
        self.start()

    def run(self):
        while True:
            self._answer(*self._calls.get())

    @staticmethod
    def _answer(future, function, args):
        try:
            future.set_result(function(*args))
        except BaseException as error:  # noqa: BLE001  the caller's
            future.set_exception(error)

    def call(self, function, *args):
        """What the function returns or raises."""
        if threading.current_thread() is self:  # the garbage collector frees things wherever it runs
            return function(*args)
        future = Future()
        self._calls.put((future, function, args))
        return future.result()


def use_gl() -> None:
    """Note that this process uses OpenGL.

    Raises:
      RuntimeError: it was forked from one that did: drawing would wait for ever for threads that were not forked along.
    """
    global _user
    if _user not in (None, os.getpid()):
        raise RuntimeError('a process forked from one that has drawn cannot draw: start processes with context="spawn"')
    _user = os.getpid()


def on_gl_thread(function, *args) -> Any:
    """What the function returns or raises, called in the thread of all our contexts.

    Raises:
      RuntimeError: as `use_gl`.
    """
    global _thread
    use_gl()
    with _starting:
        _thread = _thread or _GLThread()
    return _thread.call(function, *args)


def free_on_gl_thread(free) -> None:
    """As `on_gl_thread`; in a forked process nothing is freed, since it is the other's."""
    if _thread and _user == os.getpid():
        _thread.call(free)
    else:
        _inherited.append(free)
