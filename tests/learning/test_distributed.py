"""Several processes that train one policy."""

import dataclasses
import os
import time

import pytest
import torch
from learners import QUICK, run, same_bits, updated

from commhg_mj.learning.distributed import ALONE, NotConnected, ProcessGroup, WorkerEnded, _meet, process_group
from commhg_mj.learning.train import TRAINING_SEEDS, Training

SIZE = 2


def train_together(group, folder):
    """Two updates, saved, and a third; what this process then holds goes into a file of its own."""
    ranks = torch.tensor([[1.0 + group.rank], [0.0]])
    group.average([ranks])
    assert ranks.tolist() == [[1.5], [0.0]] and group.total(1, group.rank) == [2, 1] and group.least(3 + group.rank) == 3
    assert group.gather(group.rank) == ([0, 1] if group.is_first else [])
    training = run(folder / "run", workers=SIZE, group=group, hyper=dataclasses.replace(QUICK, decisions=80))
    updated(training, 2).save()
    updated(training, 1)
    held = {
        "method": training.method.state_dict(), "optimizer": training.learner.optimizer.state_dict(),
        "seeds": training.collector.batch.seeds, "counts": [training.updates, training.missions, training.decisions],
        "own": [len(training.collector.scores), len(training.collector.batch.seeds)],
    }  # fmt: skip
    torch.save(held, folder / f"{group.rank}.pt")
    resumed = Training.resume(folder / "run", group)
    assert resumed.updates == 2 and same_bits(updated(resumed, 1), training)


def die(group, folder):
    train_together(group, folder)
    group.total(1)
    os._exit(1)


def be_done(group):
    group.gather("last words" * 10**6)


@pytest.mark.slow
def test_last_words_are_heard_however_late_the_first_one_listens():
    with process_group(SIZE, be_done) as group:
        time.sleep(2)
        assert group.gather("first") == ["first", "last words" * 10**6]


def test_one_process_is_a_crew_too():
    tensor = torch.tensor([1.0, 2.0])
    ALONE.average([tensor])
    assert tensor.tolist() == [1.0, 2.0] and ALONE.total(3, 4) == [3, 4] and ALONE.least(5) == 5 and ALONE.gather("x") == ["x"]
    with process_group(1, die) as group:
        assert group is ALONE and group.is_first


@pytest.mark.parametrize("n, size", [(32, 1), (32, 5), (3, 3)])
def test_parts_add_up(n, size):
    parts = [ProcessGroup(rank, size).share(n) for rank in range(size)]
    assert sum(parts) == n and max(parts) - min(parts) <= 1


def test_processes_hold_the_same_bits_and_resume_to_them_and_the_end_of_one_is_told(tmp_path):
    with pytest.raises(WorkerEnded, match="another process"), process_group(SIZE, die, tmp_path) as group:
        train_together(group, tmp_path)
        group.total(1)
        for _ in range(100):
            group.total(1)
    one, other = (torch.load(tmp_path / f"{rank}.pt", weights_only=True) for rank in range(SIZE))
    assert all(torch.equal(one["method"][name], other["method"][name]) for name in one["method"])
    assert one["counts"] == other["counts"] and one["counts"][1] == one["own"][0] + other["own"][0] > 0
    assert set(one["seeds"]).isdisjoint(other["seeds"]) and one["own"][1] + other["own"][1] == 6
    assert min(other["seeds"]) >= TRAINING_SEEDS + TRAINING_SEEDS // SIZE


def test_a_step_follows_the_crews_average(tmp_path):
    class Opposed(ProcessGroup):
        """The others found the very opposite."""

        def average(self, tensors):
            for tensor in tensors:
                tensor.zero_()

        def _reduce(self, tensor, how):
            return tensor

    training = run(tmp_path, group=Opposed(0, 2))
    before = [parameter.clone() for parameter in training.method.parameters()]
    assert training.update()["grad_norm"] == 0
    assert all(map(torch.equal, training.method.parameters(), before))
    assert not training.learner.optimizer.state, "to Adam a gradient of zero is a step"


def test_a_network_that_does_not_work_is_named(tmp_path, monkeypatch):
    def fail(*arguments, **options):
        raise RuntimeError("[enforce fail at gloo/device.cc:84] Unable to find address for: lo\nmore")

    monkeypatch.setattr("torch.distributed.init_process_group", fail)
    monkeypatch.setenv("GLOO_SOCKET_IFNAME", "lo")
    with pytest.raises(NotConnected) as caught, _meet(tmp_path, 0, SIZE):
        pass
    said = "workers cannot meet over the network device lo (Unable to find address for: lo): --workers 1 needs none"
    assert str(caught.value) == said
