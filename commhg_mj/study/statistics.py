"""Means with confidence intervals (scipy's bootstrap)."""

from typing import NamedTuple

import numpy as np
from scipy.stats import bootstrap


class Interval(NamedTuple):
    mean: float
    low: float  # ends of the 95 % interval; nan for a single value
    high: float

    def __str__(self):
        digits = 3 if abs(self.mean) < 100 else 0
        mean, low, high = (f"{value:,.{digits}f}" for value in self)
        return mean if np.isnan(self.low) else f"{mean} [{low}, {high}]"


def mean_interval(values) -> Interval:
    """Mean of values [n] with its 95 % percentile-bootstrap interval over them (9999 resamples, fixed stream)."""
    values = np.asarray(values, float)
    if len(values) < 2:
        return Interval(float(values.mean()), float("nan"), float("nan"))
    result = bootstrap((values,), np.mean, method="percentile", batch=500, rng=np.random.default_rng(0))
    return Interval(float(values.mean()), *map(float, result.confidence_interval))
