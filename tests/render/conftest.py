import pytest
from synthetic import make_trace


@pytest.fixture(scope="session")
def trace():
    """A minute of a small mission; the last robot fails halfway."""
    return make_trace("small", seed=1, ticks=60)
