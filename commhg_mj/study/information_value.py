"""What information is worth to a policy: the same missions with less of it, with more, and with all of it."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..base.arguments import missions_of, names
from ..base.charts import new_figure, save_figure, styled
from ..flights.fly import fly
from ..flights.held_out import HELD_OUT
from ..flights.statistics import Interval, mean_interval
from ..policies import find_policy, label_of
from ..scenarios import Scenario

NOMINAL = "nominal"  # what all others are held against


class Variant(NamedTuple):
    """What a policy is given, or denied."""

    ending: str = ""  # of the policy's name (policies/talk.py)
    links: str = ""  # by default those that are asked for
    limitation: str = NOMINAL


VARIANTS = {
    NOMINAL: Variant(),
    "silent: nothing is delivered": Variant(links="silent"),
    "deaf: no broadcasts": Variant("+no-broadcast"),
    "no queries": Variant("+no-query"),
    "asks always": Variant("+always-asks"),
    "low limitation": Variant(limitation="low"),
    "high limitation": Variant(limitation="high"),
    "perfect links": Variant(links="perfect"),
    "everything known": Variant(links="known"),
}
SHARES = (0.25, 0.5, 0.75, 1.5, 2.0)  # of the byte budget, beside all of it
N_FLIGHTS = len(VARIANTS) + len(SHARES) + 1  # and the team without operators


class Value(NamedTuple):
    """One policy on one scenario; differences are paired, mission by mission."""

    policy: str
    scenario: str
    nominal: Interval
    differences: dict[str, Interval]  # label of VARIANTS: minus nominal
    budget: dict[float, Interval]  # share of the byte budget: TWCR
    per_hour: Interval  # TWCR gained over the team without operators, per hour of human control


def measure_value(
    scenario: Scenario, policy: str, n_missions: int, links: str, workers=1,
    advance: Callable[[float], None] = lambda missions: None,
) -> Value:  # fmt: skip
    """Fly one policy's held-out missions under every variant.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """
    check_policies([policy])
    seeds = range(HELD_OUT, HELD_OUT + missions_of("n_missions", n_missions))

    def scores_of(scenario, variant=VARIANTS[NOMINAL]) -> list:
        return fly(scenario, policy + variant.ending, seeds, variant.links or links, variant.limitation, None, workers, advance)

    flights = {label: scores_of(scenario, variant) for label, variant in VARIANTS.items()}
    twcr = {label: twcr_of(scores) for label, scores in flights.items()}
    budget = {share: twcr_of(scores_of(with_budget(scenario, share))) for share in SHARES} | {1.0: twcr[NOMINAL]}
    alone = twcr_of(scores_of(dataclasses.replace(scenario, n_operators=0)))
    hours = np.array([score.control_time * score.duration * scenario.n_operators / 3600.0 for score in flights[NOMINAL]])
    return Value(
        label_of(policy), scenario.name, mean_interval(twcr[NOMINAL]),
        {label: mean_interval(values - twcr[NOMINAL]) for label, values in twcr.items() if label != NOMINAL},
        {share: mean_interval(budget[share]) for share in sorted(budget)},
        mean_interval((twcr[NOMINAL] - alone) / max(1e-9, hours.mean())),
    )  # fmt: skip


def twcr_of(scores) -> np.ndarray:
    """[missions] TWCR."""
    return np.array([score.twcr for score in scores])


def with_budget(scenario: Scenario, share: float) -> Scenario:
    """The scenario with that share of the byte budget: of every bucket's refill. Buckets stay as large as messages need them."""
    rules = scenario.communication
    refills = {name: getattr(rules, name) * share for name in ("refill", "broadcast_refill")}
    return dataclasses.replace(scenario, communication=dataclasses.replace(rules, **refills))


@styled
def draw_budgets(values: list[Value], out) -> None:
    """TWCR against the share of the byte budget, a panel a scenario and a curve a policy.

    Raises:
      ValueError: `out` cannot be written.
    """
    scenarios = list(dict.fromkeys(value.scenario for value in values))
    figure, panels = new_figure(4.0 * len(scenarios), 3.6, columns=len(scenarios))
    for axes, name in zip(np.atleast_1d(panels), scenarios):
        for value in values:
            if value.scenario == name:
                means, lows, highs = zip(*value.budget.values())
                axes.fill_between(list(value.budget), lows, highs, alpha=0.15)
                axes.plot(list(value.budget), means, marker="o", markersize=3, label=value.policy)
        axes.set_title(name, loc="left")
        axes.set_xlabel("share of the byte budget")
        axes.grid(alpha=0.3)
    np.atleast_1d(panels)[0].set_ylabel("TWCR")
    np.atleast_1d(panels)[-1].legend(fontsize=8)
    save_figure(figure, out)


def check_policies(policies) -> list[str]:
    """The policies, if each of them can be given less and more.

    Raises:
      ValueError: none, an unknown one, or a privileged one, which needs no information; the message names it.
    """
    policies = names("policy", policies)
    for policy in policies:
        if find_policy(policy).is_privileged:
            raise ValueError(f"policy {policy}: privileged, whatever it is told is worth nothing to it")
    return policies
