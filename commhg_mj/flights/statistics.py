"""Means with confidence intervals (scipy's bootstrap)."""

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.stats import bootstrap, trim_mean


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
    return _interval(values, np.mean, fewest=2)


def middle_interval(values) -> Interval:
    """The interquartile mean of values [n], the mean of their middle half, with the same interval."""
    return _interval(values, partial(trim_mean, proportiontocut=0.25), fewest=4)


def _interval(values, statistic, fewest):
    values = np.asarray(values, float)
    found = float(statistic(values))
    if len(values) < fewest:
        return Interval(found, float("nan"), float("nan"))
    result = bootstrap((values,), statistic, method="percentile", batch=500, rng=np.random.default_rng(0))
    return Interval(found, *map(float, result.confidence_interval))
