"""Commands about scenarios and their worlds."""

from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.table import Column, Table

from ..base.arguments import check_seed
from ..scenarios import SCENARIOS, describe, load_scenario
from .console import OUT, check_file, load_mujoco, say, show


@dataclass(frozen=True)
class Scenarios:
    """Print every field of a scenario with its value, unit and mark: P is the paper's, D our default."""

    name: tyro.conf.Positional[str | None] = None
    """small, medium, large or a TOML file; without it all three"""

    def __call__(self):
        names = [self.name] if self.name else list(SCENARIOS)
        columns = [list(describe(load_scenario(name))) for name in names]
        table = Table(Column("field", no_wrap=True), *names, "unit", "mark", "meaning")
        for rows in zip(*columns):
            field, _, unit, mark, doc = rows[0]
            table.add_row(field, *(show(row[1]) for row in rows), unit, mark, doc)
        OUT.print(table)


@dataclass(frozen=True)
class World:
    """Write a mission's world as MJCF, for MuJoCo's own viewer: python -m mujoco.viewer --mjcf=FILE."""

    scenario: str = "medium"
    """small, medium, large or a TOML file"""
    seed: int = 0
    """of the mission"""
    out: Path = Path("world.xml")
    """FILE.xml; its textures go into a folder beside it"""
    collide: bool = False
    """gravity, and ground, mountains and trunks that hold bodies of your own; without, they fall through"""

    def __call__(self):
        load_mujoco()
        from ..models.mjcf import write_world
        from ..models.world import make_world

        check_file(self.out)
        check_seed(self.seed)
        write_world(make_world(load_scenario(self.scenario), self.seed), self.out, self.collide)
        say(f"wrote {self.out}")


@dataclass(frozen=True)
class Figure:
    """Draw the overview of a mission's world with its legend (the paper's benchmark figure)."""

    out: Path
    """FILE.png"""
    scenario: str = "medium"
    """small, medium, large or a TOML file"""
    seed: int = 0
    """of the mission"""

    def __call__(self):
        load_mujoco()
        from ..models.world import make_world
        from ..render import overview_figure

        check_seed(self.seed)
        overview_figure(make_world(load_scenario(self.scenario), self.seed), self.out)
        say(f"wrote {self.out}")
