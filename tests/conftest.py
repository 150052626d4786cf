"""Fixtures and settings of the whole suite."""

import os

import pytest
from filelock import FileLock
from hypothesis import HealthCheck, settings

SLOW = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
settings.register_profile("steady", deadline=None, derandomize=True, database=None, suppress_health_check=SLOW)
settings.register_profile("explore", deadline=None, max_examples=200, suppress_health_check=SLOW)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))


def pytest_sessionstart():
    """Of several processes the first compiles the kernels, and the others wait for them."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        import commhg_mj  # noqa: F401
        from commhg_mj.base.kernels import CACHE_DIR, ensure_compiled

        with FileLock(CACHE_DIR / "tests.lock"):
            ensure_compiled()


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Run a command in an empty folder: (exit code, standard output, standard error)."""
    from commhg_mj.cli import main

    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        return code, *capsys.readouterr()

    return run
