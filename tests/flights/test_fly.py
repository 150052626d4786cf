"""Flying many missions: the results depend on neither processes nor chunks; intervals; summaries."""

import dataclasses
import json

import numpy as np
import pytest
from strategies import change

from commhg_mj import make_vec
from commhg_mj.cli.tables.scores import ROWS, summary_json
from commhg_mj.flights import fly as study
from commhg_mj.flights.statistics import mean_interval
from commhg_mj.mission.batch import stay
from commhg_mj.mission.trace import load_trace, save_trace
from commhg_mj.scenarios import SCENARIOS

SHORT = change(SCENARIOS["small"], time_limit=60)


def test_processes_and_chunks_change_no_score_and_no_trace(monkeypatch, tmp_path):
    seeds, ended, (one, two) = range(2 * study.CHUNK + 3), [], (tmp_path / "of1", tmp_path / "of2")
    one.mkdir(), two.mkdir()
    alone = study.fly(SHORT, "greedy", seeds, advance=ended.append, out=one)
    assert sum(ended) == pytest.approx(len(seeds)) and len(seeds) == len(alone)
    assert study.fly(SHORT, "greedy", seeds, workers=2, out=two) == alone
    traces = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in (one, two)]
    assert traces[0] == traces[1] and len(traces[0]) == len(seeds)
    monkeypatch.setattr(study, "CHUNK", 5)
    assert study.fly(SHORT, "greedy", seeds) == alone
    assert study.fly(SHORT, "greedy", [7, 3]) == [alone[7], alone[3]]


def test_one_long_mission_says_how_far_it_is():
    told = []
    study.fly(SHORT, "greedy", [3], advance=told.append)
    assert len(told) > 3 and max(told) < 0.5 and sum(told) == pytest.approx(1)
    told.clear()
    study.fly_recorded(lambda trace: trace.seed, SHORT, "random", [3, 4], advance=told.append)
    assert len(told) > 3 and sum(told) == pytest.approx(2)


def test_every_mission_leaves_its_trace(tmp_path):
    scores = study.fly(SHORT, "random", [4, 9], limitation="high", out=tmp_path)
    for seed, score in zip([4, 9], scores):
        trace = load_trace(study.trace_path(tmp_path, SHORT, "random", "raycast", "high", seed))
        assert trace.twcr() == pytest.approx(score.twcr)
        assert (trace.seed, trace.policy, trace.limitation, trace.links) == (seed, "random", "high", "raycast")
    assert len(list(tmp_path.iterdir())) == 2
    study.fly(SHORT, "random", [4, 9], out=tmp_path)
    assert len(list(tmp_path.iterdir())) == 4, "other conditions, other files"


def test_a_trace_replaces_none_of_another_mission(tmp_path, monkeypatch):
    other = change(SHORT, n_tasks=SHORT.n_tasks - 1)
    study.fly(SHORT, "random", [4], out=tmp_path)
    study.fly(SHORT, "random", [4, 5], out=tmp_path)  # the same mission
    path = study.trace_path(tmp_path, SHORT, "random", "raycast", "nominal", 5)
    study.fly(SHORT, "omniscient", [5], out=tmp_path)
    study.fly(SHORT, "omniscient", [5], links="abstract", out=tmp_path)  # flies under other conditions than are asked for
    before, kept = {each.name: each.read_bytes() for each in tmp_path.iterdir()}, load_trace(path)
    monkeypatch.setattr(study, "fly_to_end", lambda *arguments, **options: pytest.fail("it flies"))
    with pytest.raises(ValueError, match=f"{path} is of another scenario: ") as error:
        study.fly(other, "random", [3, 5], out=tmp_path)
    assert "\n" not in str(error.value)
    for name, value in (("policy", "greedy"), ("seed", 6), ("limitation", "low"), ("links", "perfect")):
        save_trace(dataclasses.replace(kept, **{name: value}), path)
        with pytest.raises(ValueError, match=f"{path} is of another {name}: "):
            study.fly(SHORT, "random", [5], out=tmp_path)
    path.write_bytes(b"notes")
    with pytest.raises(ValueError, match=f"{path} is damaged or not a trace"):
        study.fly(SHORT, "random", [5], out=tmp_path)
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == before | {path.name: b"notes"}


def test_intervals_hold_the_mean_and_shrink_with_the_sample():
    rng = np.random.default_rng(1)
    small, large = (mean_interval(rng.normal(5, 2, n)) for n in (40, 1000))
    for interval, n in ((small, 40), (large, 1000)):
        assert interval.low < interval.mean < interval.high
        assert interval.high - interval.low == pytest.approx(2 * 1.96 * 2 / np.sqrt(n), rel=0.25)
    assert np.isnan(mean_interval([3.0]).low) and mean_interval([3.0]).mean == 3
    assert str(mean_interval([3.0])) == "3.000" and "[" in str(small)


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    rng = np.random.default_rng(2)
    hits = sum(low <= 0.5 <= high for _, low, high in (mean_interval(rng.random(50)) for _ in range(60)))
    assert hits >= 50


def test_the_summary_is_one_json_object_with_every_mission():
    scores = study.fly(SHORT, "greedy", [1, 2, 3])
    summary = json.loads(summary_json({"policy": "greedy"}, [1, 2, 3], scores))
    assert summary["policy"] == "greedy" and set(summary["means"]) == set(ROWS)
    assert [mission["seed"] for mission in summary["missions"]] == [1, 2, 3]
    assert summary["means"]["twcr"]["mean"] == pytest.approx(np.mean([score.twcr for score in scores]))
    assert set(ROWS) <= {field.name for field in dataclasses.fields(scores[0])}
    one = json.loads(summary_json({}, [1], scores[:1]))
    assert one["means"]["twcr"]["low"] is None, "no interval out of one mission, and no NaN in JSON"


def test_make_vec_steps_missions_of_consecutive_seeds():
    missions = make_vec(SHORT, num_missions=3, seed=5)
    assert missions.seeds == [5, 6, 7]
    while not missions.over.all():
        observations = missions.step(stay(missions.observations))
    assert len(observations.robots) == 0 and len(missions.scores()) == 3


@pytest.mark.parametrize("number", [0, -1, 1.5, True, "3"])
def test_make_vec_refuses_impossible_numbers_by_name(number):
    with pytest.raises(ValueError, match="num_missions must be a whole number"):
        make_vec("small", num_missions=number)
