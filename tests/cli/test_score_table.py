"""Tables of many missions: every figure has its row, every message its cell."""

import numpy as np
import pytest
from rich.console import Console

from commhg_mj.base.terms import Fate, Kind
from commhg_mj.cli.tables.scores import FATES, ROWS, message_table, summary_table
from commhg_mj.flights.fly import fly
from commhg_mj.flights.statistics import Interval, mean_interval
from commhg_mj.scenarios import from_dict


@pytest.fixture(scope="module")
def scores():
    return fly(from_dict({"base": "small", "n_tasks": 5, "time_limit": 60}), "random", range(3))


def cells(table):
    """A table as {row: [cells]}."""
    label, *others = ([*column.cells] for column in table.columns)
    return {name: [column[i] for column in others] for i, name in enumerate(label)}


def test_every_figure_has_its_row(scores):
    figures = cells(summary_table("title", scores).renderables[0])
    assert list(figures) == list(ROWS.values())
    for field, label in ROWS.items():
        assert figures[label] == [str(mean_interval([getattr(score, field) for score in scores]))]


def test_every_message_has_its_cell(scores):
    assert set(FATES) == set(Fate)
    table = cells(message_table(scores))
    for i, kind in enumerate(Kind):
        fates = [np.mean([score.messages[kind.name.lower()][fate.name.lower()] for score in scores]) for fate in FATES]
        assert [table[fate.name.lower().replace("_", " ")][i] for fate in FATES] == [f"{mean:,.1f}" for mean in fates]
        attempted = float(table["attempted"][i].replace(",", ""))
        assert attempted == pytest.approx(sum(fates), abs=0.06)


def test_names_are_no_markup(scores, capsys):
    Console(width=200).print(summary_table("a title", scores))
    out = capsys.readouterr().out
    assert "95 %" in out and "[" in str(mean_interval([1.0, 2.0])) and "TWCR" in out
    assert str(mean_interval([score.twcr for score in scores])) in out


@pytest.mark.parametrize(
    "values, said",
    [
        ([0.25], "0.250"),
        ([0.25, 0.25], "0.250 [0.250, 0.250]"),
        ([1e6, 1e6], "1,000,000 [1,000,000, 1,000,000]"),
        ([-0.5] * 3, "-0.500 [-0.500, -0.500]"),
    ],
)
def test_intervals_in_words(values, said):
    assert str(mean_interval(values)) == said


def test_intervals_repeat_and_ignore_the_global_stream():
    values = np.random.default_rng(0).random(20)
    first = mean_interval(values)
    np.random.seed(1)
    assert mean_interval(list(values)) == first and isinstance(first, Interval)
    assert first.low < first.mean < first.high
