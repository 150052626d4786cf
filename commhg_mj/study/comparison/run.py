"""A comparison from its flights to its tables, figures and report."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...base.arguments import MOST_MISSIONS, check_seed, names, one_of, path_of, whole, workers_of
from ...base.charts import save_figure
from ...flights.held_out import HELD_OUT
from ...models.world import make_world
from ...planning.coverage import cover, coverage_figure
from ...planning.endpoints import Endpoint
from ...policies import find_policy
from ...scenarios import LIMITATIONS, Scenario, load_scenario
from . import figures
from . import record_tables as tables
from .clip import make_clip
from .flown_parts import claim_folder, fly_conditions, link_missions, look_at_links, settings_of
from .plan import FREE, MODELS, SHUFFLED, plan
from .report import write_report
from .sight import blockage_rows, link_rows

RECEIVER = 1.5  # m above the ground: of the coverage maps


def count_flights(scenario: Scenario, policies, missions: int) -> int:
    """Missions that a comparison flies in all."""
    conditions = plan(load_scenario(scenario), _check(policies), whole("missions", missions, 2, MOST_MISSIONS))
    return sum(condition.missions for condition in conditions) + link_missions(conditions[0])


def compare(
    scenario: Scenario, policies, missions: int, out, first_seed=HELD_OUT, limitation="nominal", workers=1, with_clip=True,
    advance: Callable[[int], None] = lambda missions: None,
) -> Path:  # fmt: skip
    """Fly the same missions under every link model and write tables, figures and report.html into a folder.

    Args:
      policies: registered names; link and message statistics are those of the first.
      out: folder; an interrupted comparison goes on from what it holds.
      advance: told how many missions have just ended.

    Returns:
      The report's path.

    Raises:
      ValueError: an argument is impossible, or the folder holds another comparison; the message names it.
    """
    scenario, folder, policies = load_scenario(scenario), path_of("out", out), _check(policies)
    missions, first_seed = whole("missions", missions, 2, MOST_MISSIONS), check_seed(first_seed)
    one_of("limitation", limitation, LIMITATIONS)
    workers_of(workers)
    claim_folder(folder, settings_of(scenario, policies, first_seed, limitation))
    conditions = plan(scenario, policies, missions)
    results = fly_conditions(folder, conditions, first_seed, limitation, workers, advance)
    raycast = next(condition for condition in conditions if condition.label == "raycast")
    links, blocked = look_at_links(folder, raycast, first_seed, limitation, workers, advance)
    found = _tables(scenario, policies, conditions, results, links, blocked)
    for name, rows in found.items():
        tables.write_csv(folder / f"{name}.csv", rows)
    seed = first_seed + int(np.argmax(np.abs(_gap(results)[: link_missions(raycast)])))
    drawn = _draw(folder, scenario, seed, limitation, results, links, blocked, found)
    clip = make_clip(folder, scenario, policies[0], seed, limitation) if with_clip else None
    facts = {
        "scenario": scenario.name, "policies": ", ".join(policies), "missions": missions,
        "seeds": f"{first_seed} to {first_seed + missions - 1}", "limitation": limitation,
        "radio profile": scenario.radio.profile, "missions whose links were looked at": link_missions(raycast),
        "mission of maps and clip": seed,
    }  # fmt: skip
    return write_report(folder, facts, found, drawn, clip)


def _check(policies):
    policies = names("policies", policies)
    for policy in policies:
        if find_policy(policy).is_privileged:
            raise ValueError(f"policy {policy!r} communicates for free: there are no links to compare")
    return policies


def _gap(results):
    return tables.column(results["raycast"], "twcr") - tables.column(results["abstract"], "twcr")


def _tables(scenario, policies, conditions, results, links, blocked) -> dict:
    main = [*MODELS, SHUFFLED]
    found = {
        "links": link_rows(links, scenario.radio.margin),
        "blockages": blockage_rows(blocked),
        "messages": tables.message_rows(results, main),
        "latency": tables.latency_rows(results, main),
        "metrics": tables.metric_rows(results, main),
        "policies": tables.transfer_rows(results, policies),
        "sweeps": tables.sweep_rows(results, conditions, scenario),
        "controls": tables.control_rows(results),
        "missions": tables.mission_rows({label: results[label] for label in results if label in main or label.startswith(FREE)}),
    }
    ranking = tables.ranking(results, policies)
    return found | ({"ranking": [ranking]} if ranking else {})


def _draw(folder, scenario, seed, limitation, results, links, blocked, found) -> dict[str, Path]:
    """Write every figure; returns their paths by name."""
    world = make_world(scenario, seed)
    middle = Endpoint("the middle", point=(scenario.map_side / 2, scenario.map_side / 2, scenario.radio.ugv_antenna))
    drawn = {
        "coverage_station": coverage_figure(cover(world, Endpoint("station"), RECEIVER, limitation)),
        "coverage_middle": coverage_figure(cover(world, middle, RECEIVER, limitation)),
        "delivery": figures.delivery_figure(links),
        "reliability": figures.reliability_figure(links),
        "blockages": figures.blockage_figure(blocked),
        "latency": figures.latency_figure(results),
        "ages": figures.age_figure(results),
        "missions": figures.mission_figure(results),
        "sweeps": figures.sweep_figure(found["sweeps"]),
    }
    paths = {name: folder / f"{name}.png" for name in drawn}
    for name, figure in drawn.items():
        save_figure(figure, paths[name])
    return paths
