"""Fixtures of the learning tests."""

import importlib.util
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"


@pytest.fixture
def script(monkeypatch):
    """Load a script of scripts/ by its name."""

    def load(name):
        monkeypatch.syspath_prepend(str(SCRIPTS))
        spec = importlib.util.spec_from_file_location(f"scripts_{name}", SCRIPTS / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        monkeypatch.delitem(sys.modules, "architecture", raising=False)
        return module

    return load


@pytest.fixture
def scalars(monkeypatch):
    """What a stand-in for TensorBoard is told: ("began", folder, purge_step), then (name, value, step) each."""
    told = []

    class Writer:
        def __init__(self, folder, purge_step):
            told.append(("began", folder, purge_step))

        def add_scalar(self, *scalar):
            told.append(scalar)

        def flush(self):
            pass

    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", SimpleNamespace(SummaryWriter=Writer))
    return told
