"""Processes that train one policy together: each flies missions of its own, and all learn by the mean of their gradients."""

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import parent_process
from pathlib import Path

import torch
from torch import Tensor, distributed
from torch.distributed import ReduceOp

from ..base.processes import Worker, end, end_with_parent


class WorkerEnded(RuntimeError):
    """Another process of the group has ended before its time."""


class NotConnected(RuntimeError):
    """The processes of a group cannot reach one another."""


class ProcessGroup:
    """One process's place among `size`; all of them call the same methods in the same order.

    Raises:
      WorkerEnded: by every method that waits for the others.
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
        """Put the group's mean into every tensor: the same bits in all processes."""
        if self.size > 1:
            flat = self._reduce(torch.cat([tensor.flatten().cpu() for tensor in tensors]), ReduceOp.SUM) / self.size
            for tensor, mean in zip(tensors, flat.split([tensor.numel() for tensor in tensors])):
                tensor.copy_(mean.view_as(tensor))

    def total(self, *numbers: float) -> list[float]:
        """Sums over the group."""
        return self._reduce(torch.tensor(numbers, dtype=torch.float64), ReduceOp.SUM).tolist()

    def least(self, number: int) -> int:
        """The group's smallest."""
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


ALONE = ProcessGroup()
ENDED = "another process of this training has ended; --resume goes on from the last whole update"


@contextmanager
def process_group(size: int, work: Callable, *arguments) -> Iterator[ProcessGroup]:
    """This process as the first of `size`; the others call `work(group, *arguments)` meanwhile and end with it."""
    if size == 1:
        yield ALONE
        return
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        others = [Worker(target=_join, args=(folder, rank, size, work, arguments), daemon=True) for rank in range(1, size)]
        try:
            _start(others, folder)
            with _meet(folder, 0, size) as group:
                yield group
                _door(folder, 0).touch()
                for other in others:
                    other.join()
            codes = [other.exitcode for other in others if other.exitcode]
            if codes:
                raise WorkerEnded(f"{ENDED} (exit code {codes[0]})")
        finally:
            end(others)


def _start(others, folder):
    """Start processes and wait until all stand at the door: the meeting itself can be neither interrupted nor given up."""
    for other in others:
        other.start()
    while not all(_door(folder, rank).exists() for rank in range(1, len(others) + 1)):
        if any(other.exitcode is not None for other in others):
            raise WorkerEnded(ENDED)
        time.sleep(0.05)


def _door(folder, rank):
    """A file by which a process says that it has come; the first one, that it is done."""
    return folder / f"here-{rank}"


@contextmanager
def _meet(folder, rank, size):
    if sys.platform == "linux":  # a host's own name may lead nowhere, and all are on this machine
        os.environ.setdefault("GLOO_SOCKET_IFNAME", "lo")
    try:
        distributed.init_process_group("gloo", init_method=(folder / "meeting").as_uri(), rank=rank, world_size=size)
    except RuntimeError as error:
        device, cause = os.environ.get("GLOO_SOCKET_IFNAME", "of this host"), str(error).partition("\n")[0].rpartition("] ")[2]
        raise NotConnected(f"workers cannot meet over the network device {device} ({cause}): --workers 1 needs none") from error
    try:
        yield ProcessGroup(rank, size)
    finally:
        distributed.destroy_process_group()


def _join(folder, rank, size, work, arguments):
    end_with_parent()
    _door(folder, rank).touch()
    # What ends all of them alike is the first one's to tell.
    with suppress(WorkerEnded, NotConnected, FloatingPointError, ValueError), _meet(folder, rank, size) as group:
        work(group, *arguments)
        # Who leaves before the first one has read its last message takes that message along.
        while parent_process().is_alive() and not _door(folder, 0).exists():
            time.sleep(0.05)


@contextmanager
def _others_alive():
    try:
        yield
    except RuntimeError as error:
        first_line, *_ = str(error).partition("\n")
        raise WorkerEnded(f"{ENDED} ({first_line})") from error
