"""What pyproject.toml promises of Pythons and versions; scripts/environments.py tries it."""

import re
import tomllib
from importlib.metadata import requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from commhg_mj.tasks import NO_DM_CONTROL

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONSTRAINTS = (ROOT / "constraints.txt").read_text(encoding="utf-8")
PINS = {canonicalize_name(name): pin for name, pin in re.findall(r"^([\w.-]+)==(\S+)$", CONSTRAINTS, re.M)}
PYTHONS = ["3.11", "3.12", "3.13", "3.14"]


def declared(extra=None):
    """Requirements of the package, or of an extra with the extras that it names."""
    for requirement in map(Requirement, PROJECT["optional-dependencies"][extra] if extra else PROJECT["dependencies"]):
        if canonicalize_name(requirement.name) != "commhg-mj":
            yield requirement
        for other in requirement.extras if canonicalize_name(requirement.name) == "commhg-mj" else ():
            yield from declared(other)


def closure(requirement, found):
    """All that a requirement brings here."""
    name = canonicalize_name(requirement.name)
    if name not in found and (requirement.marker is None or requirement.marker.evaluate({"extra": ""})):
        found.add(name)
        for other in requires(requirement.name) or ():
            closure(Requirement(other), found)
    return found


@pytest.mark.parametrize("extra", [None, "test"])
def test_every_requirement_is_pinned_within_its_range(extra):
    requirements = list(declared(extra))
    assert len(requirements) > 8
    outside = [str(each) for each in requirements if PINS.get(canonicalize_name(each.name), "") not in each.specifier]
    assert outside == []


@pytest.mark.parametrize("python", PYTHONS)
def test_every_python_brings_the_same_but_for_dm_control(python):
    """The markers' promise: dm_control requires labmaze, which cannot be had from Python 3.13 on."""
    assert f"{python}.0" in SpecifierSet(PROJECT["requires-python"])
    here = {each.name for each in declared() if each.marker is None or each.marker.evaluate({"python_version": python})}
    missing = {each.name for each in declared()} - here
    assert missing == (set() if python in ("3.11", "3.12") else {"dm-control"})


def test_all_that_dm_control_needs_comes_without_it():
    """Where it is installed alone, but for labmaze: mazes of its own."""
    found = set()
    for each in declared():
        if each.name != "dm-control":
            closure(each, found)
    wanted = {canonicalize_name(Requirement(each).name) for each in requires("dm_control") if "extra ==" not in each}
    assert len(wanted) > 10 and wanted - found == {"labmaze"}


def test_the_command_for_dm_control_is_the_one_that_was_tried():
    command = NO_DM_CONTROL.partition(": ")[2]
    assert command == f"pip install --no-deps dm_control=={PINS['dm-control']}"
    assert command in (ROOT / "README.md").read_text(encoding="utf-8")
    assert "--no-deps dm_control" in (ROOT / "Makefile").read_text(encoding="utf-8")
