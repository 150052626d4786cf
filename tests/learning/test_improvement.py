"""Learning by simulated alternatives: points, the fit, and runs that stop and go on."""

import dataclasses

import numpy as np
import pytest
import torch
from learners import NAMES, SHORT, shaken
from strategies import change

from commhg_mj.base.terms import IDLE, KEEP
from commhg_mj.learning import improvement
from commhg_mj.learning.features import PLAN, PLAN_EDGE
from commhg_mj.learning.fitting import EPOCHS, Fit, centred, regression, scores_of, without_luck
from commhg_mj.learning.heads import LEFT_OUT, RobotLogits
from commhg_mj.learning.improvement import Improvement
from commhg_mj.learning.learned_policy import LearnedPolicy
from commhg_mj.learning.plan_numbers import CANDIDATES
from commhg_mj.learning.points import (
    N_PICKED,
    N_TRIED,
    NOT_TRIED,
    TEAM,
    Gatherer,
    Trials,
    join_points,
    load_points,
    save_points,
)
from commhg_mj.learning.registry import METHODS, make_method
from commhg_mj.learning.train import Plan
from commhg_mj.learning.weights import load_weights
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.policies.planner import Planner
from commhg_mj.scenarios import SCENARIOS, part_of

TINY = change(SHORT, time_limit=60)
MAY_READ = [name for name in NAMES if METHODS[name].may_read_plans]


def plan(method="mappo", **fields):
    options = dict(missions=6, side_by_side=3, learner=("rollouts",), plans=True)
    return Plan(method, TINY, **{**options, **fields})


def gathered(first=0, method="mappo"):
    wants = make_method(method, True).wants
    return Gatherer(plan(), wants, first, np.random.default_rng(first)).gather()


@pytest.fixture(scope="module")
def points():
    return join_points([gathered(0), gathered(3)])


def test_points_say_what_was_tried_and_what_it_was_worth(points):
    tried, picked = points.tried.are_there, points.tried_picks.are_there
    choice, worth = points.tried.choice, points.tried.worth
    assert points.n_judged == tried.sum() + picked.sum() > 10
    assert choice.shape[1] == N_TRIED and points.tried_picks.choice.shape[1] == N_PICKED
    for part in (points.tried, points.tried_picks):
        assert np.array_equal(np.isnan(part.worth), part.choice == NOT_TRIED)
        assert np.all(part.luck[part.choice == NOT_TRIED] == 0) and part.luck.any()
    assert (~np.isnan(worth[tried])).sum(axis=1).min() >= 2, "one alternative is none"
    assert np.nanmin(worth) >= 0 and np.nanmax(worth) <= TINY.n_tasks
    rows = np.repeat(np.arange(len(tried)), np.diff(points.robots.task_ptr))
    for i in np.flatnonzero(tried):
        edges = choice[i][choice[i] >= 0]
        assert np.all(rows[edges] == i) and np.all(points.robots.task_legal[edges]), "every alternative is open to its robot"
        assert KEEP not in choice[i] or points.robots.keep_idle[i, 0]
    assert np.array_equal(points.tried_picks.choice[picked, 0], points.taught_picks[picked]), "the planner's comes first"
    assert np.array_equal(choice[tried, 0], np.where(points.taught.task == NOT_TRIED, IDLE, points.taught.task)[tried])
    assert (~tried).any(), "some decisions are there to be imitated alone"


def test_points_of_a_block_depend_on_its_number_alone_and_survive_a_file(points, tmp_path):
    save_points(points, tmp_path / "0.npz", {"cpu_seconds": 1.5})
    again, facts = load_points(tmp_path / "0.npz")
    other = join_points([gathered(0), gathered(3)])
    assert facts == {"cpu_seconds": 1.5}
    for one in (again, other):
        for mine, theirs in zip(flat(points), flat(one), strict=True):
            np.testing.assert_array_equal(mine, theirs)


def flat(points):
    return [array for part in points for array in (part if isinstance(part, tuple) else [part])]


@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b"no points"])
def test_damaged_points_are_refused_by_name(points, tmp_path, damage):
    path = tmp_path / "0.npz"
    save_points(points, path, {})
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(ValueError, match="0.npz is damaged"):
        load_points(path)


def test_points_of_another_version_are_refused_by_name(points, tmp_path, monkeypatch):
    monkeypatch.setattr("commhg_mj.learning.points.FORMAT", "commhg_mj points 0")
    save_points(points, tmp_path / "0.npz", {})
    monkeypatch.undo()
    with pytest.raises(ValueError, match="0.npz is damaged, or holds no points of this version"):
        load_points(tmp_path / "0.npz")


def test_points_of_a_large_team_are_made_with_a_small_one_as_dense():
    in_large = dataclasses.replace(plan(), scenario=SCENARIOS["large"])
    gatherer = Gatherer(in_large, make_method("mappo", True).wants, 0, np.random.default_rng(0))
    assert gatherer.batch.scenario == part_of(SCENARIOS["large"], TEAM)
    assert gatherer.public.shape[1] == gatherer.n_tasks == 28


def test_scores_of_alternatives_are_those_of_their_edges_and_losses_forget_what_all_share():
    logits = RobotLogits(torch.tensor([1.0, 2.0, 3.0]), torch.tensor([[4.0, 5.0]]), None, None, None)
    scores = scores_of(logits, torch.tensor([[2, 0, KEEP, IDLE]]))
    assert scores.tolist() == [[3.0, 1.0, 4.0, 5.0]]
    worth = np.array([[3.0, 1.0, 4.0, 5.0], [1.0, np.nan, 3.0, np.nan]])
    target = torch.from_numpy(centred(worth, ~np.isnan(worth)).astype(np.float32))
    assert target[1, [0, 2]].tolist() == [-1.0, 1.0] and target[1].isnan().tolist() == [False, True, False, True]
    assert regression(scores + 7.0, target[:1]) == pytest.approx(0.0, abs=1e-6)
    assert regression(torch.tensor([[0.0, 9.0, 4.0, 9.0]]), target[1:]) == pytest.approx(1.0)
    assert regression(torch.tensor([[LEFT_OUT, 3.0, 6.0, 7.0]]), target[:1]) == pytest.approx(0.0)


def test_what_luck_explains_is_taken_out_and_nothing_else():
    rng = np.random.default_rng(0)
    choice = np.tile([3, 1, NOT_TRIED], (400, 1))
    luck = np.where(choice[..., None] == NOT_TRIED, 0.0, rng.normal(size=(400, 3, 2)))
    true = np.where(choice == NOT_TRIED, np.nan, [2.0, 1.0, 0.0]) + rng.integers(0, 9, (400, 1))
    found = without_luck(Trials(choice, true + luck @ [3.0, -0.5], luck))
    assert np.isnan(found[:, 2]).all()
    assert np.std(found[:, :2] - [0.5, -0.5]) < 0.15, "of a noise of 2.1 chance leaves a little"
    lucky = Trials(choice, true, np.zeros_like(luck))
    np.testing.assert_allclose(without_luck(lucky)[:, :2], np.tile([0.5, -0.5], (400, 1)), atol=1e-12)
    assert without_luck(Trials(choice[:, 2:], true[:, 2:], luck[:, 2:])).shape == (400, 1), "nothing tried, nothing known"


@pytest.mark.parametrize("name", MAY_READ)
def test_a_fit_moves_all_that_decides_and_nothing_else(points, name):
    torch.manual_seed(0)
    method = make_method(name, True)
    own = gathered(0, name) if method.wants.n_past or method.wants.every_record else points
    before = {key: value.clone() for key, value in method.state_dict().items()}
    losses = list(Fit(method, own, np.random.default_rng(0)).run())
    assert len(losses) == EPOCHS and all(np.isfinite(list(row.values())).all() for row in losses)
    moved = {key.partition(".")[0] for key, value in method.state_dict().items() if not torch.equal(value, before[key])}
    assert moved == {"robot", "operator", "plan"} and method.plan.trust.min() > 0 and method.plan.bounds == 1


def test_a_fit_learns_what_its_targets_say(points):
    """Worths that follow one feature: the fit ranks the alternatives by it."""
    torch.manual_seed(0)
    method, edges = make_method("commhg", True), points.robots.task_edge[:, 0]
    tried = points.tried
    worth = np.where(tried.choice >= 0, 2.0 * edges[np.maximum(tried.choice, 0)], np.nan).astype(np.float32)
    learnable = points._replace(tried=tried._replace(worth=np.where(np.isnan(tried.worth), np.nan, worth)))
    first, *_, last = Fit(method, learnable, np.random.default_rng(0)).run()
    assert last["task_loss"] < first["task_loss"]


def test_a_run_stops_and_goes_on_to_the_same_bits(tmp_path):
    whole = list(Improvement(plan(), tmp_path / "whole").run())
    assert [row["missions"] for row in whole] == [3, 6] + [6] * EPOCHS and whole[-1]["validation"] > 0
    cut = Improvement(plan(), tmp_path / "cut").run()
    next(cut)  # one block is written
    cut.close()
    first = (tmp_path / "cut/points/00000.npz").read_bytes()
    again = Improvement(plan(), tmp_path / "cut")
    stopped = [next(rows) for rows in [again.run()] for _ in range(4)]  # in the middle of the fit
    assert len(stopped) == 4 and (tmp_path / "cut/points/00000.npz").read_bytes() == first
    assert not again.is_done and not (tmp_path / "cut/weights.safetensors").exists()
    list(Improvement(plan(), tmp_path / "cut").run())
    tensors = [load_weights(tmp_path / name / "weights.safetensors")[0].state_dict() for name in ("whole", "cut")]
    assert all(torch.equal(tensors[0][key], tensors[1][key]) for key in tensors[0])
    assert Improvement(plan(), tmp_path / "cut").is_done and not list(Improvement(plan(), tmp_path / "cut").run())


def test_a_budget_ends_the_gathering_and_leaves_fitted_weights(tmp_path):
    rows = list(Improvement(plan(missions=3000), tmp_path).run(cpu_seconds=1e-3))
    assert [row["missions"] for row in rows] == [3] + [3] * EPOCHS
    method, facts = load_weights(tmp_path / "weights.safetensors")
    assert method.plan.trust.min() > 0 and method.plan.bounds == 1, "what is flown is what was fitted"
    assert facts["missions"] == 3 and facts["plan"]["learner"] == ["rollouts"] and facts["plan"]["plans"] is True
    assert method.plan is not None and method.wants.plans


def test_points_do_not_depend_on_how_many_gather(tmp_path, monkeypatch):
    """Two processes take turns with the blocks; here they are two objects that share a folder."""

    class Pair:
        size = 2

        def __init__(self, rank):
            self.rank, self.is_first = rank, rank == 0

        def total(self, *numbers):
            return numbers

        def least(self, number):
            return number

    monkeypatch.setattr(improvement.Improvement, "_fit", lambda self: iter(()))
    for rank in (0, 1):
        list(Improvement(plan(workers=2), tmp_path / "pair", Pair(rank)).run())
    list(Improvement(plan(), tmp_path / "alone").run())
    for block in ("00000", "00001"):
        one, other = (load_points(tmp_path / name / "points" / f"{block}.npz")[0] for name in ("pair", "alone"))
        for mine, theirs in zip(flat(one), flat(other), strict=True):
            np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize("name", MAY_READ)
def test_who_trusts_the_planner_in_everything_decides_as_it_does(name):
    """Its numbers are those of the planner that flies: what rollouts compare with, and what a policy falls back on."""
    torch.manual_seed(0)
    method, batch = shaken(make_method(name, True)), MissionBatch(change(SHORT, time_limit=300), range(4))
    method.plan.trust[:] = 1e4
    learned, planner, n_tasks, n_sessions = LearnedPolicy(method, batch), Planner(batch), 0, 0
    while not batch.over.all():
        seen = batch.observations
        found, wanted, later = learned(seen), planner(seen), seen.robots["time"] > 0
        task = np.where(found.task == seen.robots["task"], KEEP, found.task)  # its own once more
        assert np.array_equal(task[later], wanted.task[later]) and np.array_equal(found.operator, wanted.operator)
        if not method.picks_first:  # who does has told other plans at first
            for said in ("broadcast", "query", "assist"):
                assert np.array_equal(getattr(found, said), getattr(wanted, said)), said
        n_tasks, n_sessions = n_tasks + (wanted.task >= 0).sum(), n_sessions + (wanted.operator >= 0).sum()
        batch.step(wanted)
    assert n_tasks > 20 and n_sessions > 10


def test_who_learned_by_rollouts_chooses_among_the_planners_candidates():
    torch.manual_seed(0)
    method, batch = shaken(make_method("mappo", True)), MissionBatch(TINY, range(4))
    method.plan.bounds.fill_(1.0)
    policy, others = LearnedPolicy(method, batch), 0
    while not batch.over.all():
        seen = batch.observations
        decisions, graphs = policy(seen), policy.builder.robots(seen)
        rows = np.repeat(np.arange(len(seen.robots)), np.diff(graphs.task_ptr))
        picks, candidates = (graphs.plan_edge[:, PLAN_EDGE.index(name)] > 0 for name in ("is_pick", "is_candidate"))
        assert not (picks & ~candidates).any()
        for i in range(len(seen.robots)):
            mine = (rows == i) & candidates
            assert mine.sum() <= CANDIDATES + 1 and np.all(candidates[(rows == i) & (graphs.task == seen.robots['task'][i])])
            if decisions.task[i] >= 0 and (mine & graphs.task_legal).any():
                assert decisions.task[i] in graphs.task[mine]
                others += decisions.task[i] not in graphs.task[mine & picks]
            elif decisions.task[i] == IDLE and (mine & graphs.task_legal).any():
                assert graphs.plan[i, PLAN.index("idles")] == 1
        batch.step(decisions)
    assert others > 3


def test_who_never_reads_plans_says_so():
    with pytest.raises(ValueError, match="plans: informarl never reads the planner's numbers"):
        make_method("informarl", True)
