"""Fixtures of the learning tests."""

import sys
from types import SimpleNamespace

import pytest


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
