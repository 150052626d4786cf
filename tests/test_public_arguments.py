"""What public callables refuse, in one table: a ValueError of one line that names the argument. numpy's numbers are numbers."""

import dataclasses
import inspect
import warnings
from functools import lru_cache

import numpy as np
import pytest

import commhg_mj
from commhg_mj import MissionBatch, WorldLinks, render, tasks
from commhg_mj.flights.fly import fly, fly_recorded, fly_to_end
from commhg_mj.learning.curriculum import read_plan
from commhg_mj.learning.learned_policy import LearnedPolicy
from commhg_mj.learning.ppo import Hyper, check_device
from commhg_mj.learning.registry import find_method
from commhg_mj.learning.train import Plan, Training, check_training_seed, plan_from_json, plan_to_json
from commhg_mj.learning.weights import load_weights
from commhg_mj.mission.trace import make_traces, save_trace
from commhg_mj.models import mjcf
from commhg_mj.models.world import draw_world
from commhg_mj.planning.coverage import cover
from commhg_mj.planning.decay_fit import fit
from commhg_mj.planning.endpoints import Endpoint, parse_endpoint
from commhg_mj.planning.link_pairs import links_of
from commhg_mj.planning.section import positions_at, view_link
from commhg_mj.policies import conditions_of, find_policy, prepare
from commhg_mj.render.live import LiveFilm
from commhg_mj.replay.cases import cases_of
from commhg_mj.replay.communication import fly_and_listen
from commhg_mj.replay.replayer import Replayer, last_decision
from commhg_mj.scenarios import from_dict, from_json, to_json, with_profile
from commhg_mj.study.calibration import calibrate
from commhg_mj.study.comparison import compare, count_flights
from commhg_mj.study.evaluation import evaluate
from commhg_mj.study.model_card import make_card
from commhg_mj.tasks import surveillance
from commhg_mj.tasks.physics import Physics

BRIEF = from_dict({"base": "small", "time_limit": 40, "n_tasks": 4})
NOTHING = object()
NUMBERS = ("three", None, [1, 2], np.zeros((2, 2)), {}, NOTHING, True, np.nan, np.inf, -np.inf)
WHOLE = (*NUMBERS, -1, 1.5, np.float32(1), 2**63)
COUNT = (*WHOLE, 0)
WORD = (None, 3, np.nan, ["small"], np.zeros((2, 2)), {}, NOTHING, "nowhere")
SCENARIO = WORD[:4] + WORD[6:]  # a name, or a table
PATH = (None, 3, np.nan, ["a"], np.zeros((2, 2)), {}, NOTHING)
OBJECT = (None, "three", 3, np.nan, [1], np.zeros((2, 2)), NOTHING)
FLAG = (None, "no", 1, 0.0, np.nan, [], np.zeros(2))
SEEDS = (None, "12", 7, np.nan, np.array(3), {}, NOTHING, [], [-1], [1.5], ["one"], [2**63], [True], [np.nan], range(2**62))
POINTS = (None, "three", 3, [1, 2, 3, 4], np.zeros((3, 3, 3)), {}, NOTHING, [[np.nan] * 3], [["a"] * 3], [[1], [2, 3]])
PLACES = (*POINTS[:-3], [[np.nan] * 2], [["a"] * 2])
SIZE = (3, "ab", (320,), (320, 180, 2), (321, 180), (-2, 64), (64.0, 64), (2**63, 64), (None, 64), np.zeros((2, 2)))
SECOND = (*(value for value in NUMBERS if value is not np.inf), np.inf, -1, 1e9)
NAMES = (None, 3, "greedy", [], [3], [None], {}, NOTHING, ["nowhere"])


@lru_cache(maxsize=1)
def world():
    return commhg_mj.make_world(BRIEF, 1)


@lru_cache(maxsize=1)
def trace():
    return make_traces(fly_to_end("greedy", BRIEF, [1], record=True), "greedy")[0]


@lru_cache(maxsize=1)
def batch():
    return MissionBatch(BRIEF, [1])


@lru_cache(maxsize=1)
def over():
    done = MissionBatch(BRIEF, [1])
    done.step(commhg_mj.stay(done.observations), BRIEF.time_limit)
    return done


@lru_cache(maxsize=1)
def links():
    return WorldLinks(world())


@lru_cache(maxsize=1)
def interfaces():
    """One environment of each face, under way."""
    envs = tasks.MissionEnv(BRIEF), tasks.parallel_env(BRIEF), tasks.MissionVectorEnv(2, BRIEF)
    for env in envs:
        env.reset(seed=1)
    return *envs, surveillance.make(BRIEF, 1, pictures=False)


def decide(**changes):
    return batch().step(commhg_mj.stay(batch().observations)._replace(**changes))


def step(seconds):
    return batch().step(commhg_mj.stay(batch().observations), seconds)


@lru_cache(maxsize=1)
def learned():
    return find_method("commhg")()


def physics():
    return interfaces()[3].physics


HERE, THERE = Endpoint("station"), Endpoint("uav0", robot=0)
XY, XYZ = np.full((2, 2), 50.0), np.full((2, 3), 50.0)
DRAPE = np.zeros((4, 4, 4), np.uint8)
PLAN = {"method": "mappo", "scenario": BRIEF}
EVALUATION = (1, "abstract", "nominal", 1, lambda missions: None)
OPTIONS = {"seeds": SEEDS[1:-1], "period": WHOLE, "links": WORD, "limitation": WORD, "scenario": SCENARIO}

# callable of the argument: (its name, as messages have it, and what it refuses)
TABLE = {
    commhg_mj.load_scenario: ("scenario", SCENARIO),
    lambda v: commhg_mj.make_vec(BRIEF, v): ("num_missions", COUNT),
    lambda v: commhg_mj.make_vec(BRIEF, seed=v): ("seed", WHOLE),
    lambda v: MissionBatch(v, [1]): ("scenario", SCENARIO),
    lambda v: MissionBatch(BRIEF, v): ("seeds", SEEDS),
    lambda v: MissionBatch(BRIEF, [1], v): ("link model", WORD),
    lambda v: MissionBatch(BRIEF, [1], limitation=v): ("limitation", WORD),
    lambda v: MissionBatch(BRIEF, [1], record=v): ("record", FLAG),
    step: ("seconds", WHOLE),
    lambda v: batch().step(v): ("decisions", OBJECT),
    lambda v: decide(task=v): ("task", (None, "three", 3, np.nan, [1], np.zeros(4), np.full(4, 2**40), np.zeros((2, 2), int))),
    lambda v: decide(assist=v): ("assist", (None, "three", 3, np.zeros(4), np.zeros(3, bool))),
    lambda v: batch().restart(v, 1): ("e", (*WHOLE, 1)),
    lambda v: over().restart(0, v): ("seed", WHOLE),
    commhg_mj.stay: ("observations", OBJECT),
    # worlds
    lambda v: commhg_mj.make_world(v, 1): ("scenario", SCENARIO),
    lambda v: commhg_mj.make_world(BRIEF, v): ("seed", WHOLE),
    lambda v: draw_world(BRIEF, v): ("seed", WHOLE),
    lambda v: world().path(v, 0): ("start", PLACES),
    lambda v: world().path(world().layout.station, v): ("task", (*WHOLE, 4)),
    lambda v: world().layout.ground_height(v): ("xy", PLACES[:2] + PLACES[5:]),
    mjcf.build_spec: ("world", OBJECT),
    lambda v: mjcf.write_world(world(), v): ("path", PATH),
    lambda v: commhg_mj.with_heightmap(BRIEF, v): ("path", PATH),
    lambda v: with_profile(BRIEF, v): ("profile", WORD[1:]),
    lambda v: dataclasses.replace(BRIEF, n_tasks=v): ("n_tasks", COUNT),
    lambda v: dataclasses.replace(BRIEF, map_side=v): ("map_side", (*NUMBERS, -1)),
    lambda v: dataclasses.replace(BRIEF, world=v): ("world", OBJECT),
    from_dict: ("table", OBJECT),
    from_json: ("text", (None, 3, [1], {}, NOTHING)),
    # links
    WorldLinks: ("world", OBJECT),
    lambda v: WorldLinks(world(), v): ("link model", WORD),
    lambda v: WorldLinks(world(), limitation=v): ("limitation", WORD),
    lambda v: links().between(v, XYZ, 100): ("a", (*POINTS, np.zeros((5, 3)))),
    lambda v: links().between(XYZ, v, 100): ("b", POINTS),
    lambda v: links().between(XYZ, XYZ + 20, v): ("size", (*NUMBERS, 0, -1)),
    lambda v: links().to_station(v, 100): ("a", POINTS),
    lambda v: links().to_station(XYZ, v): ("size", (*NUMBERS, 0, -1)),
    lambda v: links().antennas(v, 1.0): ("xy", PLACES),
    lambda v: links().antennas(XY, v): ("height", (None, "three", np.nan, np.inf, -1, [1, 2, 3], NOTHING)),
    lambda v: links().robot_antennas(XY, v): ("embodiment", (None, "three", np.nan, -1, 2, 1.0, [0.5], NOTHING, 2**63)),
    commhg_mj.link_model: ("name", (*WORD[:-1], "", "raycast")),
    # policies and flights
    find_policy: ("policy", WORD),
    lambda v: conditions_of(v, BRIEF, "abstract"): ("policy", WORD),
    lambda v: prepare("greedy", BRIEF, v): ("seeds", SEEDS),
    commhg_mj.policy: ("name", (None, 3, "", "greedy", np.zeros((2, 2)))),
    **{info.make: ("batch", OBJECT) for info in (commhg_mj.POLICIES[name] for name in ("greedy", "random", "omniscient"))},
    lambda v: fly(v, "greedy", [1]): ("scenario", SCENARIO),
    lambda v: fly(BRIEF, v, [1]): ("policy", WORD),
    lambda v: fly(BRIEF, "greedy", v): ("seeds", SEEDS),
    lambda v: fly(BRIEF, "greedy", [1], v): ("link model", WORD),
    lambda v: fly(BRIEF, "greedy", [1], limitation=v): ("limitation", WORD),
    lambda v: fly(BRIEF, "greedy", range(20), workers=v): ("workers", COUNT),
    lambda v: fly(BRIEF, "greedy", [1], out=v): ("out", PATH[1:]),
    lambda v: fly_recorded(str, BRIEF, "greedy", v): ("seeds", SEEDS),
    lambda v: fly_and_listen(BRIEF, "greedy", v): ("seeds", SEEDS),
    # traces
    lambda v: make_traces(v, "greedy"): ("record", OBJECT),
    lambda v: make_traces(batch(), v): ("policy", (None, 3, np.nan, [], NOTHING)),
    lambda v: save_trace(v, "trace.npz"): ("trace", OBJECT),
    lambda v: save_trace(trace(), v): ("path", PATH),
    commhg_mj.load_trace: ("path", PATH),
    lambda v: trace().twcr_until(v): ("t", NUMBERS[:-2]),
    Replayer: ("trace", OBJECT),
    lambda v: Replayer(trace(), v): ("policy", WORD[1:]),
    lambda v: list(Replayer(trace()).decisions(v)): ("until", (*NUMBERS[:-2], -1)),
    lambda v: last_decision(Replayer(trace()), v, 10): ("robot", WORD),
    lambda v: last_decision(Replayer(trace()), "uav0", v): ("at", SECOND),
    cases_of: ("path", PATH),
    # pictures
    lambda v: render.render_image(v, "a.png"): ("trace", OBJECT),
    lambda v: render.render_image(trace(), v): ("out", PATH),
    lambda v: render.render_image(trace(), "a.png", at=v): ("at", SECOND),
    lambda v: render.render_image(trace(), "a.png", camera=v): ("camera", WORD),
    lambda v: render.render_image(trace(), "a.png", size=v): ("size", SIZE),
    lambda v: render.render_image(trace(), "a.png", speed=v): ("speed", (*NUMBERS, 0, -1)),
    lambda v: render.render_image(trace(), "a.png", drape=v): ("drape", OBJECT[1:]),
    lambda v: render.render_video(trace(), v): ("out", PATH),
    lambda v: render.render_video(trace(), "a.mp4", fps=v): ("fps", (*NUMBERS, 0, -1)),
    lambda v: render.render_video(trace(), "a.mp4", start=v): ("start", SECOND),
    lambda v: render.render_video(trace(), "a.mp4", stop=v): ("stop", [value for value in SECOND if value is not None]),
    lambda v: render.render_video(trace(), "a.mp4", workers=v): ("workers", COUNT),
    lambda v: render.overview_figure(v, "a.png"): ("source", OBJECT),
    lambda v: render.overview_figure(world(), v): ("out", PATH),
    lambda v: render.coverage_drape(v, "label"): ("probability", (None, "three", 3, [1], [[2.0]], [[np.nan]], [[0.1], [0, 1]])),
    lambda v: render.Drape(v, "label", "0", "1", DRAPE): ("image", (None, 3, "three", np.zeros((2, 3, 4)), np.zeros((2, 2, 4)))),
    lambda v: render.check_same_mission(v, trace()): ("left", OBJECT),
    lambda v: render.first_divergence(trace(), v): ("right", OBJECT),
    LiveFilm: ("scenario", OBJECT),
    lambda v: LiveFilm(BRIEF, v): ("camera", WORD),
    lambda v: LiveFilm(BRIEF, size=v): ("size", (None, *SIZE)),
    # interfaces; tests/tasks/test_refusals.py has actions and seeds of resets
    **{
        (lambda v, make=make, option=option: make(**{"scenario": BRIEF, option: v})): (option.removesuffix("s"), values)
        for make in (tasks.MissionEnv, tasks.parallel_env, tasks.MissionVectorEnv, surveillance.Surveillance)
        for option, values in (OPTIONS | {"record": FLAG}).items()
    },
    **{
        (lambda v, make=make, option=option: make(BRIEF, **{"render_mode": "rgb_array", option: v})): (option, values)
        for make in (tasks.MissionEnv, tasks.parallel_env)
        for option, values in {"render_mode": WORD[1:], "camera": WORD, "size": (None, *SIZE)}.items()
    },
    tasks.MissionVectorEnv: ("num_envs", COUNT),
    lambda v: tasks.MissionVectorEnv(1, BRIEF, copy=v): ("copy", FLAG),
    lambda v: interfaces()[0].step(v): ("action", POINTS),
    lambda v: interfaces()[1].step(v): ("actions", (None, 3, "three", [1], NOTHING)),
    lambda v: interfaces()[1].step({"uav_0": v}): ("action", POINTS),
    lambda v: interfaces()[1].step({v: 0}): ("agent", (None, 3, "uav0", NOTHING)),
    lambda v: interfaces()[1].action_space(v): ("agent", WORD),
    lambda v: interfaces()[1].observation_space(v): ("agent", WORD),
    lambda v: interfaces()[2].step(v): ("action", POINTS),
    lambda v: interfaces()[2].reset(seed=v): ("seed", ("three", NOTHING, np.nan, 1.5, -1, [1], [1, "two"], 2**63)),
    lambda v: tasks.load(v, "small"): ("domain", WORD),
    lambda v: tasks.load("surveillance", v): ("task", WORD[:3] + WORD[4:]),
    lambda v: tasks.load("surveillance", "small", v): ("task_kwargs", OBJECT[1:]),
    lambda v: surveillance.make(BRIEF, 1, v): ("pictures", FLAG),
    lambda v: surveillance.make(BRIEF, 1, False, v): ("environment_kwargs", OBJECT[1:]),
    lambda v: surveillance.make(BRIEF, 1, False, {"flat_observation": v}): ("flat_observation", FLAG),
    lambda v: Physics.from_world(world(), False, v): ("timestep", (*NUMBERS, 0, -1)),
    lambda v: physics().position(v): ("body", WORD),
    lambda v: physics().antenna(v): ("antenna", WORD),
    # planning
    lambda v: parse_endpoint(v, BRIEF, "from"): ("from", (*WORD, "nan,1", "1,2,3,4", "", "1,-1")),
    lambda v: parse_endpoint("uav0", v, "from"): ("scenario", OBJECT),
    lambda v: cover(v, HERE, 1.5): ("world", OBJECT),
    lambda v: cover(world(), v, 1.5): ("source", OBJECT),
    lambda v: cover(world(), HERE, v): ("height", (*NUMBERS, -1, 2**63)),
    lambda v: cover(world(), HERE, 1.5, v): ("limitation", WORD),
    lambda v: cover(world(), HERE, 1.5, models=v): ("model", NAMES),
    links_of: ("trace", OBJECT),
    lambda v: links_of(trace(), v): ("period", COUNT),
    lambda v: positions_at(BRIEF, v, 1): ("seed", WHOLE),
    lambda v: positions_at(BRIEF, 1, v): ("at", SECOND),
    lambda v: view_link(v, (HERE, THERE), XY): ("world", OBJECT),
    lambda v: view_link(world(), v, np.ones((4, 2))): ("places", (*OBJECT, (HERE,), (HERE, "uav0"))),
    lambda v: view_link(world(), (HERE, THERE), v): ("robot_xy", (*PLACES, XY)),
    lambda v: fit(BRIEF, v): ("n_missions", COUNT),
    lambda v: fit(v): ("scenario", SCENARIO),
    # studies
    lambda v: evaluate(BRIEF, v, *EVALUATION): ("polic", NAMES),
    lambda v: evaluate(BRIEF, ["greedy"], v, *EVALUATION[1:]): ("n_missions", COUNT),
    lambda v: evaluate(BRIEF, ["greedy"], 1, "abstract", "nominal", v, print): ("workers", COUNT),
    lambda v: evaluate(v, ["greedy"], *EVALUATION): ("scenario", SCENARIO),
    calibrate: ("scenario", WORD),
    lambda v: calibrate("small", v): ("n_missions", COUNT),
    lambda v: count_flights(BRIEF, v, 2): ("polic", (*NAMES, ["omniscient"])),
    lambda v: count_flights(BRIEF, ["greedy"], v): ("missions", (*COUNT, 1)),
    lambda v: make_card(v, *EVALUATION): ("path", PATH),
    # learning
    **{
        (lambda v, name=name: Plan(**{**PLAN, name: v})): (name, values)
        for name, values in {
            "scenario": OBJECT, "hyper": OBJECT, "seed": WHOLE, "missions": COUNT[:-2] + (0,), "side_by_side": COUNT,
            "workers": COUNT, "first_updates": WHOLE[:-1], "links": PATH, "limitation": PATH, "init": PATH, "method": PATH,
        }.items()
    },
    **{
        (lambda v, name=name: Hyper(**{name: v})): (name, (*NUMBERS, -1) if name != "trace" else WORD)
        for name in Hyper.__dataclass_fields__
    },
    lambda v: Training(v, "run"): ("plan", OBJECT),
    lambda v: Training(Plan(**PLAN), v): ("folder", PATH),
    Training.resume: ("folder", PATH),
    read_plan: ("folder", PATH),
    check_training_seed: ("seed", WHOLE),
    check_device: ("device", WORD),
    find_method: ("method", WORD),
    load_weights: ("path", PATH),
    lambda v: LearnedPolicy(v, batch()): ("method", OBJECT),
    lambda v: LearnedPolicy(learned(), v): ("batch", OBJECT),
    lambda v: LearnedPolicy(learned(), batch(), variant=v): ("variant", WORD[1:]),
    lambda v: Hyper.of(v, False): ("n_robots", COUNT[:-2] + (0,)),
}  # fmt: skip


def compared(**change):
    return compare(**{"scenario": BRIEF, "policies": ["greedy"], "missions": 2, "out": "compared", **change})


TABLE |= {
    (lambda v, name=name: compared(**{name: v})): (name.removeprefix("first_"), values)
    for name, values in {
        "missions": (*COUNT, 1), "out": PATH, "first_seed": WHOLE, "limitation": WORD, "workers": COUNT,
    }.items()
}  # fmt: skip


def place(call):
    """Where in this table a callable stands, for the name of its test."""
    return getattr(call, "__name__", str(call)).replace("<lambda>", f"line {inspect.getsourcelines(call)[1]}")


@pytest.mark.parametrize("call, argument, values", [(call, *row) for call, row in TABLE.items()])
def test_bad_values_are_refused_by_name(call, argument, values, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for value in values:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(ValueError) as refusal:
                call(value)
                pytest.fail(f"accepted {value!r}")
        said = str(refusal.value)
        assert argument in said and "\n" not in said and len(said) < 400, f"{value!r}: {said}"
    assert list(tmp_path.iterdir()) == []


def test_numpys_numbers_are_pythons():
    missions = commhg_mj.make_vec(BRIEF, np.int64(2), np.uint8(3), record=np.True_)
    assert missions.seeds == [3, 4] and missions.record is True
    missions.step(commhg_mj.stay(missions.observations), np.int32(BRIEF.time_limit))
    missions.restart(np.int64(1), np.int16(7))
    assert missions.seeds == [3, 7]
    task = int(np.flatnonzero(world().poi_types != 0)[0])
    np.testing.assert_array_equal(world().path(XY[0], np.int8(task)), world().path([50, 50], task))
    lengths = [len(links_of(trace(), period)) for period in (5, np.uint8(5))]
    assert lengths[0] == lengths[1] > 0
    assert last_decision(Replayer(trace()), "uav0", np.float32(10)).time <= 10


def test_rules_and_plans_hold_pythons_numbers():
    """numpy's are no JSON, and traces and runs carry theirs as that."""
    canopies = dataclasses.replace(BRIEF.world, canopy_height=np.array([5, 9]))
    scenario = dataclasses.replace(BRIEF, n_tasks=np.int64(4), map_side=np.float64(500), world=canopies)
    assert type(scenario.n_tasks) is int and scenario.world.canopy_height == (5, 9)
    assert from_json(to_json(scenario)) == scenario and hash(scenario) == hash(from_json(to_json(scenario)))
    plan = Plan(**PLAN, seed=np.uint8(3), missions=np.int64(50), hyper=Hyper(gamma=np.float32(0.5), epochs=np.int64(2)))
    assert plan_from_json(plan_to_json(plan)) == plan
