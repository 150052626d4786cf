"""Scenarios out of names, TOML files, tables, JSON and pictures, and back."""

import dataclasses
import json
import tomllib
import zlib
from collections.abc import Iterator
from pathlib import Path

from ..base.arguments import instance, path_of
from .checks import LONGEST_NAME, UNNAMEABLE
from .fields import Scenario
from .heightmap import read_heightmap
from .presets import SCENARIOS


def load_scenario(name) -> Scenario:
    """A named scenario, a TOML file that overrides one, the table of such a file, or a `Scenario` itself.

    Raises:
      ValueError: unknown name, unreadable file, unknown or impossible field; the message names it.
    """
    if isinstance(name, Scenario):
        return name
    if isinstance(name, dict):
        return from_dict(name)
    if not str(name).endswith(".toml"):
        return SCENARIOS.find(str(name), " or a .toml file")
    try:
        table = tomllib.loads(Path(name).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"scenario file {name}: {error}") from None
    try:
        scenario = from_dict(_with_pictures(table, Path(name).parent))
    except ValueError as error:
        raise ValueError(f"scenario file {name}: {error}") from None
    if "name" in table or scenario in SCENARIOS.values():
        return scenario
    return dataclasses.replace(scenario, name=_name_after(Path(name)))


def _name_after(path):
    """A name of its own for the scenario of a file that gives it none."""
    stem = UNNAMEABLE.sub("-", path.stem).lstrip("-._")[:LONGEST_NAME] or "unnamed"
    return f"{stem}.toml" if stem in SCENARIOS else stem


def _adopt(name, scenario):
    """Add the scenario of an entry point: itself, or the TOML file that describes it."""
    SCENARIOS[name] = load_scenario(scenario)


SCENARIOS.adopt = _adopt


def _with_pictures(table, folder):
    """The table of a file in `folder` with the content of the heightmap that it names."""
    world = table.get("world")
    if not isinstance(world, dict) or world.get("heightmap", "") == "":
        return table
    name = world["heightmap"]
    if not isinstance(name, str):
        raise ValueError(f"world.heightmap must be the name of a PNG file, is {name!r}")
    return table | {"world": world | {"heightmap": read_heightmap(folder / name)}}


def with_heightmap(scenario, path, height: float | None = None) -> Scenario:
    """A scenario whose mountains are those of a picture (docs/worlds.md).

    Args:
      scenario: as for `load_scenario`.
      path: a square PNG; black is the plain, white the highest ground, the upper edge the north.
      height: of white [m]; by default the upper end of the scenario's world.mountain_height.

    Raises:
      ValueError: not such a picture, or an impossible height; the message names the field.
    """
    scenario = load_scenario(scenario)
    heights = scenario.world.mountain_height if height is None else (height, height)
    world = dataclasses.replace(scenario.world, heightmap=read_heightmap(path_of("path", path)), mountain_height=heights)
    return dataclasses.replace(scenario, world=world)


def with_profile(scenario: Scenario, profile: str | None) -> Scenario:
    """The scenario with another calibration of the ray-cast link; None keeps its own."""
    if profile is None:
        return scenario
    return dataclasses.replace(scenario, radio=dataclasses.replace(scenario.radio, profile=profile))


def from_dict(table: dict) -> Scenario:
    """The scenario that a (TOML or JSON) table describes: `base`, then overrides field by field."""
    table = dict(instance("table", table, dict))
    base = table.pop("base", "medium")
    if not isinstance(base, str) or base not in SCENARIOS:
        raise ValueError(f"base must be one of {', '.join(SCENARIOS)}, is {base!r}")
    return _override(SCENARIOS[base], table, "")


def _override(rules, table, prefix):
    known = {field.name for field in dataclasses.fields(rules)}
    changes = {}
    for key, value in table.items():
        if key not in known:
            raise ValueError(f"unknown field {prefix}{key}")
        current = getattr(rules, key)
        if dataclasses.is_dataclass(current):
            if not isinstance(value, dict):
                raise ValueError(f"{prefix}{key} must be a table")
            value = _override(current, value, f"{prefix}{key}.")
        elif isinstance(value, list):
            value = tuple(value)
        changes[key] = value
    return dataclasses.replace(rules, **changes)


def to_json(scenario: Scenario) -> str:
    """All fields as JSON; `from_json` gives the equal scenario back."""
    return json.dumps(dataclasses.asdict(scenario))


def from_json(text: str) -> Scenario:
    """The scenario that `to_json` wrote."""
    return _override(SCENARIOS["medium"], json.loads(instance("text", text, str)), "")


def describe(scenario: Scenario) -> Iterator[tuple]:
    """Yield (field, value, unit, mark, doc) for every field; a picture's value is its checksum."""

    def walk(rules, prefix):
        for field in dataclasses.fields(rules):
            value = getattr(rules, field.name)
            if dataclasses.is_dataclass(value):
                yield from walk(value, f"{prefix}{field.name}.")
            else:
                m = field.metadata
                if field.name == "heightmap" and value:
                    value = f"picture-{zlib.crc32(value.encode()):08x}"
                yield f"{prefix}{field.name}", value, m["unit"], m["mark"], m["doc"]

    return walk(scenario, "")
