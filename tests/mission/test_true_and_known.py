"""Where an actor observes or decides, rules read its own row, public facts and `known_` records: held by the names."""

import ast
import inspect

import pytest

from commhg_mj.mission import control, decide, messages, observe

PUBLIC = {  # of anybody and any task; what else a `true_` row holds is its owner's alone
    "true_robot": {"embodiment"},
    "true_operator": set(),
    "true_task": {"x", "y", "announced", "difficulty", "value", "deadline", "decay", "released"},
}
OPERATORS_END = [
    "bid", "command", "is_lease_open", "renew", "leave", "end_session", "learn_control", "learn_session", "learn_answer", "tire",
]  # fmt: skip
DECIDING = [(control, name) for name in OPERATORS_END] + [(decide, "speak"), (decide, "supervise"), (messages, "choose_tip")]
DECIDING += [(observe, name) for name, value in vars(observe).items() if name.startswith("observe_") or name == "hide_task"]


def accessor_of(node):
    """(name, index) of a call of a `true_` accessor, or None."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in PUBLIC:
        return node.func.id, ast.unparse(node.args[1])


def foreign_reads(source):
    """{accessor.field} that a function reads of true rows other than that of its own actor, a parameter called r or h."""
    function = ast.parse(source).body[0]
    own = {argument.arg for argument in function.args.args} & {"r", "h"}
    rows, found = {}, set()
    for node in ast.walk(function):
        if isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
            pairs = zip(target.elts, value.elts) if isinstance(value, ast.Tuple) else [(target, value)]
            rows |= {ast.unparse(name): accessor_of(row) for name, row in pairs if accessor_of(row)}
    for node in ast.walk(function):
        if isinstance(node, ast.Attribute):
            row = accessor_of(node.value) or rows.get(ast.unparse(node.value))
            if row and row[1] not in own:
                found.add(f"{row[0]}.{node.attr}")
    return found


@pytest.mark.parametrize("module, name", DECIDING, ids=lambda value: getattr(value, "__name__", value))
def test_an_actor_reads_no_remote_truth(module, name):
    source = inspect.getsource(inspect.unwrap(getattr(getattr(module, name), "py_func", getattr(module, name))))
    source = source[source.index("def ") :]
    reads = foreign_reads(source)
    if name == "learn_control":  # every operator in turn, of its own session
        reads = {read for read in reads if not read.startswith("true_operator.")}
    allowed = {f"{accessor}.{field}" for accessor, fields in PUBLIC.items() for field in fields}
    assert reads <= allowed, f"{name} reads {sorted(reads - allowed)}"


def test_the_check_finds_a_remote_truth():
    reads = "def f(m, r, j):\n    robot, task = true_robot(m, r), true_task(m, j)\n    return robot.x, task.status"
    assert foreign_reads(reads) == {"true_task.status"}
    assert foreign_reads("def f(m, h):\n    return true_robot(m, true_operator(m, h).robot).activity") == {"true_robot.activity"}
