"""The house: no circle of imports, a drawing that is not stale, types on all that is public, files of one subject."""

import ast
import importlib
import importlib.util
from collections import Counter
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).parent.parent
SPEC = importlib.util.spec_from_file_location("architecture", ROOT / "scripts" / "architecture.py")
architecture = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(architecture)

MODULES = architecture.modules()
COMPILED = {"kernel", "formula", "reduction", "intrinsic"}  # numba infers the types of these
DOCUMENTED = ("commhg_mj.study.fly", "commhg_mj.learning.registry", "commhg_mj.learning.critic", "commhg_mj.tasks")  # in 0.1.0


def test_no_circle_of_modules_or_rooms():
    graph = architecture.module_graph()
    rooms = architecture.in_order(architecture.room_graph(graph))
    assert rooms[0] == "base" and {"mission", "learning", "cli"} <= set(rooms)
    modules = architecture.in_order({name: targets for name, targets in graph.items() if name != architecture.FACE})
    assert modules.index("commhg_mj.mission.tick") < modules.index("commhg_mj.learning.rollout")


def test_a_circle_is_found():
    with pytest.raises(ValueError, match="a -> b -> a|b -> a -> b"):
        architecture.in_order({"a": {"b"}, "b": {"a"}})


def test_the_page_is_what_the_imports_say():
    assert architecture.drawing() in architecture.PAGE.read_text(encoding="utf-8"), "run python scripts/architecture.py"


def test_no_mujoco_in_rules_and_learning_and_no_torch_below_learning():
    for name, path in MODULES.items():
        names = {
            alias.name.split(".")[0] if isinstance(node, ast.Import) else (node.module or "").split(".")[0]
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Import) or (isinstance(node, ast.ImportFrom) and not node.level)
            for alias in node.names
        }
        room = architecture.room_of(name)
        assert "mujoco" not in names or room in ("models", "render", "tasks", "cli"), name
        assert "torch" not in names or room in ("learning", "bench"), name


def test_names_of_modules_say_one_thing():
    """No two modules share a name, but for folders that hold one another's; `fly` is documented by both of its names."""
    counts = Counter(path.stem for path in MODULES.values() if path.stem not in ("__init__", "__main__"))
    assert {name for name, count in counts.items() if count > 1} <= {"fly"}


def test_files_hold_one_subject():
    lines = [len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES.values() if path.name != "__init__.py"]
    assert median(lines) <= 120 and max(lines) <= 350


def public(body):
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public(node.body)
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            if not COMPILED & {ast.unparse(each).split("(")[0] for each in node.decorator_list}:
                yield node


@pytest.mark.parametrize("name", MODULES)
def test_public_functions_say_what_they_return(name):
    tree = ast.parse(MODULES[name].read_text(encoding="utf-8"))
    assert not [node.name for node in public(tree.body) if node.returns is None]


@pytest.mark.parametrize("name", DOCUMENTED)
def test_documented_imports_go_on_working(name):
    assert importlib.import_module(name)
