"""What ATA-HRL adds: reconstruction against the truth in training alone, and a trigger that is one flat choice."""

import numpy as np
import pytest
import torch
from learners import Row, random_public, robot_graphs, run, shaken
from torch.nn.functional import logsigmoid

from commhg_mj.learning.batches import robot_batch
from commhg_mj.learning.features import PAST
from commhg_mj.learning.heads import RobotChoices, judge_robots, tensors_of
from commhg_mj.learning.methods import ata_hrl
from commhg_mj.learning.methods.ata_hrl import ATAHRL
from commhg_mj.learning.ppo import Learner
from commhg_mj.learning.reconstruction import RobotReconstruction, TaskReconstruction
from commhg_mj.learning.state_features import STATE_ROBOT, STATE_TASK
from commhg_mj.learning.states import States

TYPES = STATE_TASK.columns("uav_only", "ugv_only", "general")


def noise(*shape, seed=0):
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


def tasks(n=64):
    """(belief, condition, truth, open): half of the tasks are done; the belief says the type."""
    truth = torch.zeros(n, STATE_TASK.width)
    kinds = torch.arange(n) % 3
    truth[torch.arange(n), torch.tensor(TYPES)[kinds]] = 1.0
    return torch.nn.functional.one_hot(kinds, 3).float(), noise(n, 4), truth, torch.arange(n) % 2 == 0


def test_a_task_is_learned_from_its_belief_and_the_truth_of_what_is_done_is_not_asked():
    torch.manual_seed(0)
    model, (belief, condition, truth, is_open) = TaskReconstruction(3, 4), tasks()
    loss = lambda seed=0, truth=truth: model.loss(belief, condition, truth, is_open, np.random.default_rng(seed))
    assert loss() == loss() != loss(1), "noise is the generator's"
    other = torch.where(is_open[:, None], truth, 7.0)
    assert loss(truth=other) == loss() != loss(truth=1.0 - truth)
    optimizer, before = torch.optim.Adam(model.parameters(), 1e-2), loss().item()
    for seed in range(60):
        optimizer.zero_grad()
        loss(seed).backward()
        optimizer.step()
    assert loss(99).item() < 0.7 * before
    features = model(belief, condition)
    assert torch.equal(features, model(belief, condition)), "no noise in flight"
    assert (features[is_open, :3].argmax(dim=1) == torch.arange(64)[is_open] % 3).float().mean() > 0.9
    empty = model.loss(belief[:0], condition[:0], truth[:0], is_open[:0], np.random.default_rng(0))
    assert empty == 0 and model(belief[:0], condition[:0]).shape == (0, model.WIDTH)


def test_a_robot_is_learned_from_its_last_reports_and_who_failed_is_left_out():
    torch.manual_seed(0)
    model, past, truth = RobotReconstruction(), noise(40, 4, PAST.width), noise(40, STATE_ROBOT.width, seed=1).sigmoid()
    truth[:, STATE_ROBOT.index("failed")] = (torch.arange(40) % 4 == 0).float()
    nonsense = torch.where(truth[:, [STATE_ROBOT.index("failed")]] > 0, 99.0, truth)
    assert model.loss(past, truth) == model.loss(past, nonsense) > 0
    optimizer, before = torch.optim.Adam(model.parameters(), 1e-2), model.loss(past, truth).item()
    for _ in range(60):
        optimizer.zero_grad()
        model.loss(past, truth).backward()
        optimizer.step()
    assert model.loss(past, truth).item() < 0.8 * before
    assert model(past[:0]).shape == (0, model.WIDTH) and model.loss(past[:0], truth[:0]) == 0


def test_the_truth_reaches_the_auxiliary_loss_and_nothing_else(tmp_path):
    training = run(tmp_path, "ata-hrl", first_updates=0)
    shaken(training.method)
    data = training.collector.collect(100, training.method.critic, training.method.scale, 0.99, 0.95)
    learner = Learner(training.method, training.plan.hyper)
    batch = learner.minibatch(data, np.arange(len(data.states.mission)))
    other = States(*(part if part.dtype == torch.bool else 1.0 - part for part in batch.states))
    loss = lambda states: training.method.auxiliary(batch._replace(states=states), np.random.default_rng(0))
    assert loss(batch.states) == loss(batch.states) != loss(other)
    with torch.no_grad():
        one, two = (learner.judge(batch._replace(states=states)) for states in (batch.states, other))
    assert all(torch.equal(a.log_prob, b.log_prob) for a, b in zip(one, two))
    loss(batch.states).backward()
    moved = {name.split(".")[1] for name, part in training.method.named_parameters() if part.grad is not None}
    assert {"reconstruct_task", "reconstruct_peer", "reconstruct_robot"} == moved


@pytest.mark.parametrize("keep", [True, False])
def test_a_trigger_and_a_choice_are_one_flat_choice(keep, monkeypatch):
    """p(KEEP) = 1 - p(z); the others share p(z); where KEEP is closed there is no trigger."""
    torch.manual_seed(0)
    actor = shaken(ATAHRL()).robot
    rows = [Row((True, True, False, True), keep=keep, idle=True, gate=False, query=(False,), assist=False, n_peers=2)]
    graphs = robot_graphs(rows, n_past=ata_hrl.N_PAST)
    batch, public = robot_batch(graphs, 5), random_public()
    told = []
    monkeypatch.setattr(ata_hrl, "bounded", lambda logits, bounded=ata_hrl.bounded: told.append(bounded(logits)) or told[-1])
    with torch.no_grad():
        logits = actor(batch, public)
    score, idle, trigger = told
    likely = lambda task: judge_robots(
        logits, batch, tensors_of(RobotChoices(np.array([task]), np.zeros(1, bool), np.array([-1]), np.zeros(1, bool)))
    )
    options = [0, 1, 3, -2]  # edges, IDLE
    among = torch.cat([score[[0, 1, 3]], idle]).log_softmax(dim=0)
    for place, option in enumerate(options):
        wanted = among[place] + (logsigmoid(trigger[0]) if keep else 0.0)
        assert likely(option).log_prob.item() == pytest.approx(wanted.item(), abs=1e-5)
    if keep:
        assert likely(-1).log_prob.item() == pytest.approx(logsigmoid(-trigger[0]).item(), abs=1e-5)
    alone = [Row((False,), keep=True, idle=False, gate=False, query=(False,), assist=False)]
    forced = robot_batch(robot_graphs(alone, n_past=ata_hrl.N_PAST), 5)
    with torch.no_grad():
        said = judge_robots(actor(forced, public), forced, tensors_of(
            RobotChoices(np.array([-1]), np.zeros(1, bool), np.array([-1]), np.zeros(1, bool))
        ))  # fmt: skip
    assert not said.is_free.any() and said.log_prob == 0
