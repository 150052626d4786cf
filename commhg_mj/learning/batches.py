"""Local graphs of many steps as tensors, for one update."""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .graphs import OperatorGraphs, RobotGraphs
from .ragged import rows_of

# An edge's columns.
OF_TASKS, OF_PEERS = ("task", "task_edge", "task_legal", "plan_edge"), ("peer", "peer_edge", "peer_task", "peer_past")


class RobotBatch(NamedTuple):
    """`RobotGraphs` of N decisions as tensors; `task` indexes rows of the public table."""

    itself: Tensor
    task_ptr: Tensor
    task: Tensor
    task_edge: Tensor
    task_legal: Tensor
    own_edge: Tensor
    peer_ptr: Tensor
    peer_edge: Tensor
    peer: Tensor  # [P]
    peer_task: Tensor  # [P] rows of the public table, -1: none
    peer_past: Tensor
    resource: Tensor
    keep_idle: Tensor
    gate: Tensor
    query: Tensor
    assist: Tensor
    plan: Tensor
    plan_edge: Tensor
    rows: Tensor  # [E] of task edges
    peer_rows: Tensor  # [P] of peer edges


def robot_batch(graphs: RobotGraphs, n_tasks: int) -> RobotBatch:
    """Tensors that share the arrays' memory."""
    tensors = RobotGraphs(*(torch.from_numpy(np.ascontiguousarray(array)) for array in graphs))
    rows, peer_rows = rows_of(tensors.task_ptr), rows_of(tensors.peer_ptr)
    in_public = lambda task, of: torch.where(task >= 0, tensors.mission[of] * n_tasks + task, -1)
    columns = tensors._asdict() | {"task": in_public(tensors.task, rows), "peer_task": in_public(tensors.peer_task, peer_rows)}
    kept = {name: columns[name] for name in RobotBatch._fields if name in columns}
    return RobotBatch(**kept, rows=rows, peer_rows=peer_rows)


def shifted(edges: np.ndarray, by) -> np.ndarray:
    """Edges, or choices that may be some, whose edges have other numbers now."""
    return np.where(edges >= 0, edges + by, edges)


def pick_batch(graphs: RobotGraphs, public: np.ndarray, rows: np.ndarray) -> tuple[RobotBatch, Tensor, np.ndarray]:
    """(some rows as a batch, the public table of the worlds in it alone, [N] what to add to an edge's number for its new one)."""
    picked, shift = pick_robots(graphs, rows)
    worlds, index = np.unique(picked.mission, return_inverse=True)
    table = torch.from_numpy(public[worlds].reshape(-1, public.shape[2]))
    return robot_batch(picked._replace(mission=index), public.shape[1]), table, shift


def join_robots(parts: list[RobotGraphs]) -> RobotGraphs:
    """The graphs of several steps, one after the other."""
    columns = {name: np.concatenate(arrays) for name, arrays in zip(RobotGraphs._fields, zip(*parts))}
    for name in ("task_ptr", "peer_ptr"):
        pointers = [getattr(part, name) for part in parts]
        starts = np.cumsum([0] + [pointer[-1] for pointer in pointers])
        columns[name] = np.concatenate([[0]] + [pointer[1:] + start for pointer, start in zip(pointers, starts)])
        if name == "task_ptr":
            own = [shifted(part.own_edge, start) for part, start in zip(parts, starts)]
            columns["own_edge"] = np.concatenate(own)
    return RobotGraphs(**columns)


def pick_robots(graphs: RobotGraphs, rows: np.ndarray) -> tuple[RobotGraphs, np.ndarray]:
    """(graphs of some rows, [N] what to add to an edge's number for its new one)."""
    edges, task_ptr = _pick_edges(graphs.task_ptr, rows)
    peers, peer_ptr = _pick_edges(graphs.peer_ptr, rows)
    shift = task_ptr[:-1] - graphs.task_ptr[rows]
    of_edges = dict.fromkeys(OF_TASKS, edges) | dict.fromkeys(OF_PEERS, peers)
    picked = {name: array[of_edges.get(name, rows)] for name, array in graphs._asdict().items() if not name.endswith("_ptr")}
    own = shifted(picked["own_edge"], shift)
    return RobotGraphs(**picked | {"task_ptr": task_ptr, "peer_ptr": peer_ptr, "own_edge": own}), shift


def _pick_edges(ptr, rows):
    """(edges of some rows, their pointers)."""
    counts = ptr[rows + 1] - ptr[rows]
    new = np.concatenate([[0], np.cumsum(counts)])
    edges = np.arange(new[-1]) + np.repeat(ptr[rows] - new[:-1], counts)
    return edges, new


def join_operators(parts: list[OperatorGraphs]) -> OperatorGraphs:
    """The graphs of several steps, one after the other."""
    return OperatorGraphs(*(np.concatenate(arrays) for arrays in zip(*parts)))


def operator_batch(graphs: OperatorGraphs, rows=slice(None)) -> OperatorGraphs:
    """Tensors of some rows."""
    return OperatorGraphs(*(torch.from_numpy(array[rows]) for array in graphs))


def legal_picks(graphs: OperatorGraphs) -> Tensor:
    """[K, 2 + R] bool: KEEP, REST and the robots that operators may choose, of tensors."""
    return torch.cat([graphs.keep_rest, graphs.legal], dim=1)
