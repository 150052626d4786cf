"""Where the documentation of 0.1.0 had it; it is `commhg_mj.flights.fly` now."""

from ..flights.fly import fly

__all__ = ["fly"]
