"""Means with confidence intervals (scipy's bootstrap), and paired differences with less luck in them."""

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.stats import bootstrap, trim_mean

ENOUGH = 20  # missions from which it can be told what luck explains


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


def fair_difference(scores, others) -> np.ndarray:
    """[n] how much more TWCR the scores of n missions have than others of the same ones, less what their luck explains of it.

    The luck of services has a mean of 0 whatever is decided (mission/service.py: count_luck): what is left has the same
    expectation, and an interval narrower by a sixth to a half, the more alike the two decide. A control variate, fitted to these
    differences by least squares (White and Bowling, IJCAI 2009). Of fewer than `ENOUGH` missions the plain difference.
    """
    difference = np.array([score.twcr - other.twcr for score, other in zip(scores, others, strict=True)])
    if len(difference) < ENOUGH:
        return difference
    luck = np.array([[score.luck[name] - other.luck[name] for name in score.luck] for score, other in zip(scores, others)])
    explained, *_ = np.linalg.lstsq(luck - luck.mean(axis=0), difference - difference.mean())
    return difference - luck @ explained


def _interval(values, statistic, fewest):
    values = np.asarray(values, float)
    found = float(statistic(values))
    if len(values) < fewest:
        return Interval(found, float("nan"), float("nan"))
    result = bootstrap((values,), statistic, method="percentile", batch=500, rng=np.random.default_rng(0))
    return Interval(found, *map(float, result.confidence_interval))
