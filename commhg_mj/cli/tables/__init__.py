"""What the command line prints as tables."""

from rich.box import MARKDOWN
from rich.table import Table


def page_table(*heads: str, title: str) -> Table:
    """An empty table as pages hold them."""
    return Table(*heads, title=title, title_justify="left", box=MARKDOWN)
