"""What docs/tasks.md shows works as it stands, and its tables are the code's."""

import re
from pathlib import Path

import pytest

from commhg_mj import SCENARIOS
from commhg_mj.tasks.choices import Choices
from commhg_mj.tasks.gym import MissionEnv

PAGE = (Path(__file__).parent.parent / "docs/tasks.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)
SAID = [r"", r"TWCR of random choices: 0\.\d{3}\n", r"TWCR of random choices: 0\.\d{3}\n"]
SAID += [r"(?s)\[\[.*\]\]\n(True|False) [\d.]+ [\d.]+\n", r"TWCR of the nearest task: 0\.\d{3}\n"]


@pytest.mark.parametrize("code, said", list(zip(BLOCKS, SAID, strict=True)), ids=range(len(SAID)))
def test_the_blocks_run(code, said, capsys):
    exec(code, {})
    assert re.fullmatch(said, capsys.readouterr().out)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_table_of_shapes(scenario):
    column = 3 + list(SCENARIOS).index(scenario)
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if line.startswith("| `")]
    told = {name: row[column] for row in rows if len(row) == 6 for name in re.findall(r"`(\w+)`", row[0])}
    spaces = MissionEnv(scenario).observation_space
    assert told == {name: str(list(space.shape)) for name, space in spaces.items()}


def test_the_table_of_choices():
    numbers = [row.split("|")[3].strip() for row in PAGE.splitlines() if re.match(r"\| (robot|operator) \|", row)]
    scenario = SCENARIOS["medium"]
    counts = {"R": scenario.n_robots, "H": scenario.n_operators, "T": scenario.n_tasks}
    told = [eval(number, {}, counts) for number in numbers]
    sizes = Choices(scenario).sizes
    assert told == [*sizes[:3], sizes[-1]]
