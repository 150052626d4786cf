"""What changes when communication loss is grounded in geometry: the comparison of the link models (docs/radio.md)."""

from .run import compare, count_flights

__all__ = ["compare", "count_flights"]
