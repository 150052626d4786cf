"""Draw the rooms of commhg_mj from their imports into docs/architecture.md; refuse circles.

python scripts/architecture.py           writes the page's drawing and table anew
python scripts/architecture.py --check   exits with 1 if they are not what the imports say
"""

import ast
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE, PAGE = ROOT / "commhg_mj", ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- made by scripts/architecture.py -->", "<!-- end -->"
FACE = "commhg_mj"  # the package itself, over all its rooms


def modules() -> dict[str, Path]:
    """Every module of the package by its dotted name."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        found[name.removesuffix(".__init__")] = path
    return found


def imports(name: str, path: Path, known) -> set[str]:
    """The package's modules that a module names in its imports, wherever in it they stand."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = package.rsplit(".", node.level - 1)[0] if node.level > 1 else package
            target = f"{base}.{node.module}" if node.module else base
            inner = {f"{target}.{alias.name}" for alias in node.names}
            found |= (inner & set(known)) or {target}
    return found - {name}


def module_graph() -> dict[str, set[str]]:
    """Which modules each module imports."""
    known = modules()
    return {name: imports(name, path, known) for name, path in known.items()}


def room_of(module: str) -> str:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else FACE


def room_graph(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """Which rooms each room's files import from."""
    rooms = {}
    for name, targets in graph.items():
        rooms.setdefault(room_of(name), set()).update(map(room_of, targets))
    return {room: targets - {room} for room, targets in rooms.items()}


def in_order(graph) -> list[str]:
    """From the floor up; ValueError on a circle."""
    try:
        return list(TopologicalSorter({node: sorted(graph[node]) for node in sorted(graph)}).static_order())
    except CycleError as error:
        raise ValueError(f"imports go in a circle: {' -> '.join(error.args[1])}") from None


def reduced(graph) -> dict[str, set[str]]:
    """Without arrows that a longer way says already."""
    below = {}
    for node in in_order(graph):
        below[node] = graph[node].union(*(below[other] for other in graph[node]))
    return {node: {a for a in graph[node] if not any(a in below[b] for b in graph[node] - {a})} for node in graph}


def drawing() -> str:
    """The page's part between the marks: a Mermaid flowchart and a table of the rooms."""
    graph = module_graph()
    in_order({name: targets for name, targets in graph.items() if name != FACE})
    rooms = room_graph(graph)
    order, arrows = in_order(rooms), reduced(rooms)
    lines = ["```mermaid", "flowchart BT"]
    lines += [f"  {target} --> {room}" for room in order for target in sorted(arrows[room], key=order.index)]
    lines += ["```", "", "| room | what it is for | files |", "|---|---|---|"]
    known = modules()
    for room in order:
        if room != FACE:
            says = ast.get_docstring(ast.parse(known[f"{FACE}.{room}"].read_text(encoding="utf-8"))).splitlines()[0]
            count = sum(room_of(name) == room and path.name != "__init__.py" for name, path in known.items())
            lines.append(f"| [`{room}/`](../commhg_mj/{room}) | {says} | {count} |")
    return "\n".join(lines)


def redraw(path: Path, begin: str, part: str) -> int:
    """Write a page's part between its marks anew; with --check only whether it is another (1)."""
    page = path.read_text(encoding="utf-8")
    head, rest = page.split(begin)
    fresh = f"{head}{begin}\n{part}\n{END}{rest.split(END)[1]}"
    if "--check" in sys.argv[1:]:
        return int(fresh != page)
    path.write_text(fresh, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(redraw(PAGE, BEGIN, drawing()))
