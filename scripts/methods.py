"""Write the table of methods from their registry into docs/learning.md.

python scripts/methods.py           writes the table anew
python scripts/methods.py --check   exits with 1 if it is not what the registry says
"""

import sys

from architecture import ROOT, redraw

from commhg_mj.learning.method_table import HEAD, method_rows

PAGE = ROOT / "docs" / "learning.md"
BEGIN = "<!-- made by scripts/methods.py -->"


def table() -> str:
    """A line a method."""
    lines = [HEAD, ["---"] * len(HEAD), *([f"`{name}`", *cells] for name, *cells in method_rows())]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


if __name__ == "__main__":
    sys.exit(redraw(PAGE, BEGIN, table()))
