"""Write the features of graphs and states from their table into docs/features.md.

python scripts/features.py           writes the page's tables anew
python scripts/features.py --check   exits with 1 if they are not what commhg_mj/learning/features.py and state_features.py say
"""

import sys

from architecture import ROOT, redraw

from commhg_mj.learning.features import KINDS
from commhg_mj.learning.state_features import ALL_GROUPS

PAGE = ROOT / "docs" / "features.md"
HEAD = "| column | name | kind | meaning | unit or scale | from |"
BEGIN = "<!-- made by scripts/features.py -->"


def tables() -> str:
    """The page's part between the marks: the kinds, then a table a group."""
    lines = ["| kind | what it is about |", "|---|---|", *(f"| {kind} | {about} |" for kind, about in KINDS.items())]
    for group in ALL_GROUPS:
        lines += ["", f"## {group.title}", "", HEAD, "|---|---|---|---|---|---|"]
        for i, (name, kind, meaning, scale, source) in enumerate(group.features):
            lines.append(f"| {i} | `{name}` | {kind} | {meaning} | {scale} | `{source}` |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(redraw(PAGE, BEGIN, tables()))
