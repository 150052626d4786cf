"""What `value` prints."""

from rich.table import Table

from ...study.information_value import NOMINAL, VARIANTS, Value
from . import page_table


def value_tables(values: list[Value], links: str, n_missions: int) -> list[Table]:
    """What every policy is worth with less information and with more, under shares of the budget, and per hour of control."""
    title = f"{links} links, {n_missions} held-out missions"
    heads = [f"{value.policy}, {value.scenario}" for value in values]
    worth = page_table("given", *heads, title=f"TWCR, and what it changes by when a policy is given less or more: {title}")
    worth.add_row(NOMINAL, *(str(value.nominal) for value in values))
    for label in VARIANTS:
        if label != NOMINAL:
            worth.add_row(label, *(str(value.differences[label]) for value in values))
    budget = page_table("share", *heads, title=f"TWCR by share of the byte budget: {title}")
    for share in values[0].budget:
        budget.add_row(f"{share:.0%}", *(str(value.budget[share]) for value in values))
    effort = page_table("", *heads, title=f"return on human effort: {title}")
    effort.add_row("TWCR gained over the team without operators, per hour of control", *(str(value.per_hour) for value in values))
    return [worth, budget, effort]
