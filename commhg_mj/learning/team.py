"""Processes that train one policy together: each flies missions of its own, and all learn by the mean of their gradients."""

import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path

import torch
from torch import Tensor, distributed
from torch.distributed import ReduceOp


class TeamEnded(RuntimeError):
    """Another process of the team has ended before its time."""


class Team:
    """One process's place among `size`; all of them call the same methods in the same order.

    Raises:
      TeamEnded: by every method that waits for the others.
    """

    def __init__(self, rank: int = 0, size: int = 1):
        self.rank, self.size = rank, size

    @property
    def is_first(self) -> bool:
        """Whether this one writes files and talks."""
        return self.rank == 0

    def share(self, n: int) -> int:
        """This process's part of n things; all parts add up to n."""
        return n // self.size + (self.rank < n % self.size)

    @torch.no_grad()
    def average(self, tensors: list[Tensor]) -> None:
        """Put the team's mean into every tensor: the same bits in all processes."""
        if self.size > 1:
            flat = self._reduce(torch.cat([tensor.flatten().cpu() for tensor in tensors]), ReduceOp.SUM) / self.size
            for tensor, mean in zip(tensors, flat.split([tensor.numel() for tensor in tensors])):
                tensor.copy_(mean.view_as(tensor))

    def total(self, *numbers: float) -> list[float]:
        """Sums over the team."""
        return self._reduce(torch.tensor(numbers, dtype=torch.float64), ReduceOp.SUM).tolist()

    def least(self, number: int) -> int:
        """The team's smallest."""
        return int(self._reduce(torch.tensor(int(number)), ReduceOp.MIN))

    def gather(self, thing) -> list:
        """Everybody's thing, by rank; only the first process gets them."""
        if self.size == 1:
            return [thing]
        things = [None] * self.size if self.is_first else None
        with _others_alive():
            distributed.gather_object(thing, things)
        return things or []

    def _reduce(self, tensor, how):
        if self.size > 1:
            with _others_alive():
                distributed.all_reduce(tensor, how)
        return tensor


ALONE = Team()
ENDED = "another process of this training has ended; the run goes on from its last whole update with --resume"


@contextmanager
def team_of(size: int, work: Callable, *arguments) -> Iterator[Team]:
    """This process as the first of `size`; the others call `work(team, *arguments)` meanwhile and end with it."""
    if size == 1:
        yield ALONE
        return
    with tempfile.TemporaryDirectory() as folder:
        meeting, context = Path(folder) / "meeting", get_context("spawn")
        others = [
            context.Process(target=_join, args=(meeting, rank, size, work, arguments), daemon=True) for rank in range(1, size)
        ]
        for other in others:
            other.start()
        try:
            with _meet(meeting, 0, size) as team:
                yield team
                for other in others:
                    other.join()
            if any(other.exitcode for other in others):
                raise TeamEnded(ENDED)
        finally:
            for other in others:
                other.terminate()


@contextmanager
def _meet(meeting, rank, size):
    if sys.platform == "linux":  # a host's own name may lead nowhere, and all are on this machine
        os.environ.setdefault("GLOO_SOCKET_IFNAME", "lo")
    distributed.init_process_group("gloo", init_method=meeting.as_uri(), rank=rank, world_size=size)
    try:
        yield Team(rank, size)
    finally:
        distributed.destroy_process_group()


def _join(meeting, rank, size, work, arguments):
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the first process's to handle
    # What ends all of them alike is the first one's to tell.
    with suppress(TeamEnded, FloatingPointError), _meet(meeting, rank, size) as team:
        work(team, *arguments)


@contextmanager
def _others_alive():
    try:
        yield
    except RuntimeError as error:
        raise TeamEnded(ENDED) from error
