"""Padded tables: what every actor saw when it was last due, in arrays of fixed shape.

Like the macro-observations of decentralised teams, a row changes when its actor falls due and stays until it does again.
"""

from typing import NamedTuple

import numpy as np
from numba import literal_unroll

from ..base.kernels import kernel
from ..mission.observe import Observations
from ..scenarios import Scenario
from .columns import COLUMNS, RECORDS, table_shape


class Tables(NamedTuple):
    """E missions, R robots, H operators, T tasks; the last axis is COLUMNS of the table; float32."""

    robots: np.ndarray  # [E, R, columns]
    robot_tasks: np.ndarray  # [E, R, T, columns]
    robot_peers: np.ndarray  # [E, R, R, columns]
    robot_operators: np.ndarray  # [E, R, H, columns]
    operators: np.ndarray  # [E, H, columns]
    operator_reports: np.ndarray  # [E, H, R, columns]


def new_tables(n_missions: int, scenario: Scenario) -> Tables:
    """Tables of zeros."""
    return Tables(*(np.zeros((n_missions, *table_shape(name, scenario)), np.float32) for name in Tables._fields))


def _writer(table):
    """A kernel that writes one record of a table's kind into its columns."""
    names = tuple(name for name in COLUMNS[table] if name in (RECORDS[table].names or ()))

    @kernel
    def write(record, columns):
        k = 0
        for name in literal_unroll(names):
            columns[k] = record[name]
            k += 1

    return write


write_robot, write_task, write_peer, write_resource, write_operator, write_report = (_writer(table) for table in Tables._fields)


@kernel
def fill_tables(seen: Observations, tables: Tables):
    """Write the observations of everybody who is due into their rows."""
    for i in range(seen.robots.shape[0]):
        e, r = seen.robots[i].mission, seen.robots[i].robot
        write_robot(seen.robots[i], tables.robots[e, r])
        for j in range(seen.robot_tasks.shape[1]):
            write_task(seen.robot_tasks[i, j], tables.robot_tasks[e, r, j])
        for other in range(seen.robot_peers.shape[1]):
            write_peer(seen.robot_peers[i, other], tables.robot_peers[e, r, other])
        for h in range(seen.robot_operators.shape[1]):
            write_resource(seen.robot_operators[i, h], tables.robot_operators[e, r, h])
    for i in range(seen.operators.shape[0]):
        operator = seen.operators[i]
        e, h = operator.mission, operator.operator
        write_operator(operator, tables.operators[e, h])
        columns = tables.operators[e, h]
        columns[columns.shape[0] - 2], columns[columns.shape[0] - 1] = operator.proficiency[0], operator.proficiency[1]
        for r in range(seen.operator_reports.shape[1]):
            write_report(seen.operator_reports[i, r], tables.operator_reports[e, h, r])
