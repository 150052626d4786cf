"""What `value` prints."""

from rich.box import MARKDOWN
from rich.table import Table

from ...study.information_value import NOMINAL, VARIANTS, Value


def value_tables(values: list[Value], links: str, n_missions: int) -> list[Table]:
    """What every policy is worth with less information and with more, under shares of the budget, and per hour of control."""
    title = f"{links} links, {n_missions} held-out missions"
    heads = [f"{value.policy}, {value.scenario}" for value in values]
    worth = new_table(f"TWCR, and what it changes by when a policy is given less or more: {title}", "given", heads)
    worth.add_row(NOMINAL, *(str(value.nominal) for value in values))
    for label in VARIANTS:
        if label != NOMINAL:
            worth.add_row(label, *(str(value.differences[label]) for value in values))
    budget = new_table(f"TWCR by share of the byte budget: {title}", "share", heads)
    for share in values[0].budget:
        budget.add_row(f"{share:.0%}", *(str(value.budget[share]) for value in values))
    effort = new_table(f"return on human effort: {title}", "", heads)
    effort.add_row("TWCR gained over the team without operators, per hour of control", *(str(value.per_hour) for value in values))
    return [worth, budget, effort]


def new_table(title: str, first: str, heads: list[str]) -> Table:
    """An empty table, a column for each head."""
    table = Table(title=title, title_justify="left", box=MARKDOWN)
    for head in (first, *heads):
        table.add_column(head)
    return table
