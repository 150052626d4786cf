"""How kernels reach a mission: one record `m` that knows where everything else of the mission lies.

Passing twenty arrays to every rule costs more than the rules themselves (numba counts references), so a
mission's record holds the addresses of its robots, tasks, …; the accessors below turn an address and
indices into a record, without copying: `true_robot(m, r).x += 1.0`. The batch that owns the arrays keeps
them alive.

A `true_` row is how somebody or something is; a `known_` row is what somebody has been told or has sensed of it. Where an
actor observes or decides, the rules read its own true row, what is public of others, and known rows
(tests/mission/test_true_and_known.py); the resolver, decide.claim, is the one exception.
"""

import numba
import numpy as np
from llvmlite import ir
from numba import carray, types
from numba.core import cgutils
from numba.extending import intrinsic

from ..base.kernels import kernel
from ..models.rays import CALLS, CANOPY, RAY
from ..models.routes import Routes, Scratch
from ..models.terrain import MOUNTAIN
from ..radio.link_models import LINK
from ..radio.obstacles import Obstacles
from . import state as s

WORD = ir.IntType(64)
OFFSETS = {name: offset for name, (_, offset, *_) in (s.MISSION.fields or {}).items()}  # B in a mission's record


def _load(builder, record, name):
    """The value of an 8-byte integer field of the mission record."""
    byte = cgutils.pointer_add(builder, record, OFFSETS[name])
    return builder.load(builder.bitcast(byte, WORD.as_pointer()))


def _accessor(dtype, base, width=None):
    """An intrinsic (m, i) or, for rows of `width` records, (m, i, j) -> record."""
    record = numba.from_dtype(dtype)

    def point(context, builder, m, index):
        offset = builder.mul(index, ir.Constant(WORD, dtype.itemsize))
        return builder.inttoptr(builder.add(_load(builder, m, base), offset), context.get_value_type(record))

    if width is None:

        @intrinsic
        def at(typing_context, m, i):
            def codegen(context, builder, signature, arguments):
                return point(context, builder, *arguments)

            return record(m, types.int64), codegen

        return at

    @intrinsic
    def at_row(typing_context, m, i, j):
        def codegen(context, builder, signature, arguments):
            m, i, j = arguments
            return point(context, builder, m, builder.add(builder.mul(i, _load(builder, m, width)), j))

        return record(m, types.int64, types.int64), codegen

    return at_row


@intrinsic
def _pointer(typing_context, address):
    def codegen(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(types.int64), codegen


@intrinsic
def copy_record(typing_context, target, source):
    """Copy one record into another of the same type."""

    def codegen(context, builder, signature, arguments):
        cgutils.raw_memcpy(builder, arguments[0], arguments[1], ir.Constant(WORD, target.size), 1)
        return context.get_dummy_value()

    return types.void(target, source), codegen


true_robot = _accessor(s.ROBOT, "robots_at")  # (m, robot)
true_operator = _accessor(s.OPERATOR, "operators_at")  # (m, operator)
true_task = _accessor(s.TASK, "tasks_at")  # (m, task)
known_task = _accessor(s.BELIEF, "beliefs_at", "n_tasks")  # (m, receiver, task); receiver n_robots: the station
known_robot = _accessor(s.PEER, "peers_at", "n_robots")  # (m, receiver, robot)
inbox_of = _accessor(s.INBOX, "inboxes_at")  # (m, receiver)
known_operator = _accessor(s.RESOURCE, "resources_at", "n_operators")  # (m, robot, operator)
command_of = _accessor(s.COMMAND, "commands_at", "n_operators")  # (m, robot, operator)
tip_of = _accessor(s.TIP, "tips_at", "n_tasks")  # (m, robot, task)
uplink_of = _accessor(s.WAITING, "uplinks_at", "n_uplink_places")  # (m, robot, place)
downlink_of = _accessor(s.WAITING, "downlinks_at", "n_downlink_places")  # (m, operator, place)
message_at = _accessor(s.MESSAGE, "air_at")  # (m, slot)
flying_of = _accessor(s.FLYING, "flying_at")  # (m, position): which slot
counters_of = _accessor(s.COUNTERS, "counters_at")  # (m, kind)

robot_row = _accessor(s.ROBOT_ROW, "log_robots_at", "n_robots")  # (m, second, robot)
operator_row = _accessor(s.OPERATOR_ROW, "log_operators_at", "n_operators")  # (m, second, operator)
message_row = _accessor(s.MESSAGE_ROW, "log_messages_at")  # (m, line)
reward_row = _accessor(s.REWARD_ROW, "log_rewards_at")  # (m, second)
link_row = _accessor(s.LINK_ROW, "log_links_at", "n_link_columns")  # (m, sample x robot, robot or station)
belief_row = _accessor(s.BELIEF_ROW, "log_beliefs_at", "n_tasks")  # (m, sample x receiver, task)
peer_row = _accessor(s.PEER_ROW, "log_peers_at", "n_robots")  # (m, sample x receiver, robot)
resource_row = _accessor(s.RESOURCE_ROW, "log_resources_at", "n_operators")  # (m, sample x robot, operator)


@kernel
def obstacles_of(m):
    """What the links of the mission's world have to pass."""
    return Obstacles(
        carray(_pointer(m.frames_at), (m.n_parts, 6), np.float64),
        carray(_pointer(m.kinds_at), (m.n_parts,), np.int32),
        carray(_pointer(m.canopies_at), (m.n_canopies,), CANOPY),
        carray(_pointer(m.mountains_at), (m.n_mountains,), MOUNTAIN),
        carray(_pointer(m.calls_at), (1,), CALLS),
        carray(_pointer(m.waves_at), (m.n_waves, 3), np.float64),
        carray(_pointer(m.intervals_at), (2, m.n_parts), np.float64),
        carray(_pointer(m.ray_at), (1,), RAY),
        carray(_pointer(m.link_at), (1,), LINK),
    )


@kernel
def routes_of(m):
    """The ground routes of the mission's world."""
    return Routes(
        carray(_pointer(m.route_frames_at), (m.n_parts, 6), np.float64),
        carray(_pointer(m.corners_at), (m.n_corners, 6), np.float64),
        carray(_pointer(m.goals_at), (m.n_tasks, 2), np.float64),
        carray(_pointer(m.to_goal_at), (m.n_corners, m.n_tasks), np.float32),
        carray(_pointer(m.next_hop_at), (m.n_tasks, m.n_corners), np.int16),
        carray(_pointer(m.between_at), (m.n_tasks, m.n_tasks), np.float32),
    )


@kernel
def scratch_of(m):
    """Scratch for route queries; between them it is free for other use."""
    n = m.n_corners + m.n_tasks + 64
    return Scratch(
        carray(_pointer(m.found_at), (n,), np.int32),
        carray(_pointer(m.distance_at), (n,), np.float64),
        carray(_pointer(m.dx_at), (n,), np.float32),
        carray(_pointer(m.dy_at), (n,), np.float32),
        carray(_pointer(m.clearance_at), (n,), np.float32),
    )
