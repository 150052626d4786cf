"""Processes that share work and end with the one that started them: none stays behind, nothing is left half-written.

An error, an interrupt or the termination of the first process ends its workers at once; where it is killed, they notice.
The command line alone handles signals of the first process: elsewhere this package is a guest.
"""

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import connection, parent_process, resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess

from .files import remove_parts

GRACE = 1.0  # s: who does not end by then is killed
AGAIN = 0.05  # s after which a lost interrupt comes again


class Worker(SpawnProcess):
    """A new Python process, deaf to the terminal's interrupt from its first moment: that is the first process's to handle."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self._lock, self._is_ended = threading.Lock(), False

    def start(self) -> None:
        """In a thread: an interrupt, which meets the main thread, leaves no process half-started."""
        with ThreadPoolExecutor(1) as thread:
            thread.submit(self._start).result()

    def end(self) -> None:
        """Terminate it, or let it never start."""
        with self._lock:
            self._is_ended = True
            if self.pid:
                self.terminate()

    def _start(self):
        with self._lock:
            if self._is_ended:
                return
            resource_tracker.ensure_running()  # started by the first of them, it would lift the block
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # of this thread; inherited
            super().start()

    def __getstate__(self):
        return self.__dict__ | {"_lock": None}


class Pool(ProcessPoolExecutor):
    """An executor of `Worker`s, each of which first calls `begin(*arguments)`."""

    def __init__(self, size: int, begin: Callable | None = None, arguments: tuple = ()):
        self.workers, context = [], SpawnContext()
        context.Process = self._make_worker  # type: ignore: the one way to workers of our own
        super().__init__(size, context, _begin, (begin, arguments))

    def _make_worker(self, **options):
        self.workers.append(Worker(**options))
        return self.workers[-1]


@contextlib.contextmanager
def pool_of(size: int, begin: Callable | None = None, arguments: tuple = ()) -> Iterator[Pool]:
    """A `Pool` for a block; an error that leaves the block ends the workers at once."""
    pool = Pool(size, begin, arguments)
    try:
        yield pool
    except BaseException:
        end(pool.workers)
        raise
    finally:
        pool.shutdown()


def end(workers: list[Worker]) -> None:
    """Terminate workers, and kill whoever is still there after a while."""
    for worker in workers:
        worker.end()
    deadline = time.monotonic() + GRACE
    for worker in workers:
        if worker.pid:
            worker.join(max(0.0, deadline - time.monotonic()))
            worker.kill()
            worker.join()


def end_with_parent() -> None:
    """Let this process end, without a file half-written, when it is terminated or its parent is no more."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer)
    signal.signal(signal.SIGTERM, lambda number, frame: None)  # told through the pipe
    threading.Thread(target=_watch, args=(reader,), daemon=True).start()


def _watch(reader):
    """Not in the main thread: that may be deep in a library, where exceptions of handlers come late or get lost."""
    parent = parent_process()
    connection.wait([reader, *([parent.sentinel] if parent else [])])
    remove_parts()
    os._exit(1)


def _begin(begin, arguments):
    end_with_parent()
    if begin:
        begin(*arguments)


class Terminated(KeyboardInterrupt):
    """SIGTERM: an interrupt with an exit code of its own."""


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """SIGTERM raises `Terminated` within the block, as an interrupt does `KeyboardInterrupt`, and neither gets lost.

    Python raises them wherever the main thread happens to be: out of a callback of numba's or a destructor they go nowhere.
    Other threads handle no signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def terminate(number, frame):
        signal.signal(number, signal.SIG_IGN)  # cleaning up is left in peace: `timeout` sends two
        raise Terminated("terminated")

    def come_again(lost):
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            return tell(lost)
        if is_termination := lost.exc_type is Terminated:
            signal.signal(signal.SIGTERM, terminate)
        again = signal.SIGTERM if is_termination else signal.SIGINT
        threading.Timer(AGAIN, os.kill, (os.getpid(), again)).start()

    handler, tell = signal.signal(signal.SIGTERM, terminate), sys.unraisablehook
    sys.unraisablehook = come_again
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, handler)
        sys.unraisablehook = tell
