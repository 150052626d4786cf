"""What `calibrate` prints."""

from rich.table import Table

from ...study.calibration import Calibration
from . import page_table


def calibration_tables(results: list[Calibration], n_missions: int) -> list[Table]:
    """TWCR of every reference under one link model, and the rules with what was measured; docs/calibration.md has them."""
    links = results[0].links
    names = [result.scenario for result in results]
    figures = page_table("flight", *names, title=f"mean TWCR, {links} links, {n_missions} missions [95 % interval]")
    rules = page_table("rule", *names, title=f"rules, {links} links")
    for label in results[0].twcr:
        figures.add_row(label, *(str(result.twcr[label]) for result in results))
    for i, rule in enumerate(results[0].rules):
        verdicts = (result.rules[i] for result in results)
        rules.add_row(rule.text, *(f"{verdict.verdict}: {verdict.measured}" for verdict in verdicts))
    return [figures, rules]
