"""What `evaluate` prints: a row a policy, and how each communicates."""

from rich.console import Group
from rich.table import Table

from ...replay.communication import FIGURES, mean_figures
from ...study.evaluation import Condition, compare_scores
from . import page_table


def evaluation_tables(title, flights: dict) -> Group:
    """What `commhg-mj evaluate` prints."""
    rows = compare_scores(flights)
    table = Table(title=title, title_justify="left")
    for name in ("policy", "TWCR", "IQM", f"minus {rows[0]['policy']}", "without luck"):
        table.add_column(name, justify="left" if name == "policy" else "right")
    for row in rows:
        table.add_row(*map(str, row.values()))
    labels = [row["policy"] for row in rows]
    return Group(table, communication_table(labels, [[talk for _, talk in each] for each in flights.values()]))


def summary_table(results: list[tuple[Condition, dict]], n_missions: int) -> Table:
    """All conditions side by side: TWCR of the first policy, paired differences of the others to it."""
    columns = [compare_scores(flights) for _, flights in results]
    first = columns[0][0]["policy"]
    title = f"TWCR of {first}, the others minus {first}, {n_missions} held-out missions"
    table = page_table("policy", *(str(condition) for condition, _ in results), title=title)
    for row, rows in enumerate(zip(*columns)):
        table.add_row(rows[0]["policy"], *(str(each["difference" if row else "twcr"]) for each in rows))
    return table


def communication_table(labels: list[str], figures: list[list[dict]]) -> Table:
    """One column a policy out of FIGURES of its missions."""
    table = Table(title="communication", title_justify="left")
    table.add_column("mean over missions")
    for label in labels:
        table.add_column(label, justify="right")
    means = list(map(mean_figures, figures))
    for name, words in FIGURES.items():
        table.add_row(words, *(each[name] for each in means))
    return table
