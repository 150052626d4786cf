"""The command's beginning: an interrupt is one line from the first moment on."""

import signal
import subprocess
import sys
import tomllib
from functools import partial
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
INTERRUPTED = """
import signal, sys

class Interrupter:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            signal.raise_signal(signal.SIGINT)
            sys.exit("uninterrupted")

sys.path.insert(0, {root!r})
sys.meta_path.insert(0, Interrupter())
from {module} import {function} as run
sys.exit(run())
"""


def begin(name, handler=signal.SIG_DFL):
    """Run the installed command's entry; an interrupt comes when the module `name` is imported."""
    entry = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]["commhg-mj"]
    module, _, function = entry.partition(":")
    code = INTERRUPTED.format(name=name, root=str(ROOT), module=module, function=function)
    ready = partial(signal.signal, signal.SIGINT, handler)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, preexec_fn=ready)


@pytest.mark.parametrize("name", ["commhg_mj", "numba", "commhg_mj.cli.training"])
def test_an_interrupt_while_the_command_is_imported(name):
    done = begin(name)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_interrupts_that_are_ignored_stay_so():
    assert begin("commhg_mj", signal.SIG_IGN).stderr == "uninterrupted\n"
