"""Processes end with the one that started them, at once, and leave nothing half-written."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from commhg_mj.base.files import whole_file
from commhg_mj.base.processes import Terminated, Worker, interruptible, pool_of


def write_for_ever(folder):
    with whole_file(Path(folder) / f"{os.getpid()}.txt"):
        (Path(folder) / f"here-{os.getpid()}").touch()
        time.sleep(60)


def begin_to_write(pool, folder):
    """Two workers with a file under way each; returns their ids."""
    for _ in range(2):
        pool.submit(write_for_ever, folder)
    return wait_for_two(folder)


def wait_for_two(folder):
    while len(here := list(folder.glob("here-*"))) < 2:
        time.sleep(0.05)
    return [int(path.name.removeprefix("here-")) for path in here]


def is_alive(pid):
    """Whether a process is there; one that has ended may wait for its parent to ask."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


def check_gone(pids, folder):
    for _ in range(200):
        if not any(map(is_alive, pids)):
            break
        time.sleep(0.05)
    assert not any(map(is_alive, pids))
    assert not list(folder.glob("*.part*")) and not list(folder.glob(".*.part*"))


def test_an_error_ends_workers_in_the_midst_of_their_work(tmp_path):
    with pytest.raises(KeyboardInterrupt), pool_of(2) as pool:
        pids = begin_to_write(pool, tmp_path)
        raise KeyboardInterrupt
    check_gone(pids, tmp_path)


def test_workers_that_have_not_begun_end_too(tmp_path):
    with pytest.raises(KeyboardInterrupt), pool_of(1) as pool:
        pool.submit(write_for_ever, tmp_path)
        [worker] = pool.workers
        raise KeyboardInterrupt
    assert worker.exitcode and not list(tmp_path.iterdir())


def test_an_interrupt_leaves_no_process_half_started(monkeypatch):
    """It meets the main thread while another one starts the process."""
    monkeypatch.setattr("commhg_mj.base.processes.resource_tracker.ensure_running", lambda: signal.raise_signal(signal.SIGINT))
    worker = Worker(target=time.sleep, args=(60,))
    with pytest.raises(KeyboardInterrupt):
        worker.start()
    worker.end()
    if worker.pid:  # the interrupt may have come first
        worker.join()
        assert worker.exitcode
    worker.start()
    assert not worker.is_alive(), "never again"


def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    code = "from pathlib import Path; from test_processes import *\nif __name__ == '__main__':\n with pool_of(2) as pool:"
    code += f"\n  begin_to_write(pool, Path({str(tmp_path)!r})); time.sleep(60)"
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    parent = subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": path}, stderr=subprocess.DEVNULL)
    pids = wait_for_two(tmp_path)
    parent.kill()
    parent.wait()
    check_gone(pids, tmp_path)


@pytest.mark.parametrize("number, error", [(signal.SIGTERM, Terminated), (signal.SIGINT, KeyboardInterrupt)])
def test_an_interrupt_that_got_lost_in_a_callback_comes_again(number, error):
    @ctypes.CFUNCTYPE(None)
    def callback():
        signal.raise_signal(number)

    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(error), interruptible():
        callback()
        time.sleep(20)
    assert signal.getsignal(signal.SIGTERM) is before


def test_two_terminations_in_a_row_are_one():
    with pytest.raises(Terminated), interruptible():
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGTERM)
            cleaned_up = True
    assert cleaned_up
