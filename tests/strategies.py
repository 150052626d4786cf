"""Hypothesis strategies: scenarios from the smallest to the largest, with extreme rules."""

import dataclasses

from hypothesis import strategies as st

from commhg_mj.radio import LINK_MODELS
from commhg_mj.scenarios import (
    LIMITATIONS,
    CommunicationRules,
    DecisionRules,
    OperatorRules,
    RobotRules,
    Scenario,
    TaskRules,
    WorldRules,
)  # fmt: skip

seeds = st.integers(0, 2**63 - 1)
limitations = st.sampled_from(LIMITATIONS)
link_models = st.sampled_from(list(LINK_MODELS))


def pairs(low, high):
    """An ordered pair of numbers."""
    return st.tuples(st.floats(low, high), st.floats(low, high)).map(lambda pair: tuple(sorted(pair)))


@st.composite
def _sizes(draw):
    """(UAVs, UGVs, operators, tasks): mostly small, sometimes at the limits."""
    if draw(st.integers(0, 9)) == 9:
        n_uav = draw(st.integers(0, 64))
        return n_uav, 64 - n_uav, draw(st.sampled_from([0, 24])), draw(st.sampled_from([1, 200, 1024]))
    n_uav = draw(st.integers(0, 6))
    n_ugv = draw(st.integers(0 if n_uav else 1, 6))
    return n_uav, n_ugv, draw(st.integers(0, 5)), draw(st.one_of(st.integers(1, 4), st.integers(5, 60)))


worlds = st.builds(
    WorldRules,
    forest_share=st.sampled_from([0.0, 0.05, 0.2]),
    mountain_share=st.sampled_from([0.0, 0.03, 0.1]),
    n_forests=st.integers(0, 6),
    n_mountains=st.integers(0, 4),
    poi_spacing=st.sampled_from([0.0, 0.005, 0.01]),
    uav_slope=st.sampled_from([0.4, 0.4, 0.05, 1e6]),
)
robots = st.builds(
    RobotRules,
    autonomous_speed=st.sampled_from([(18.0, 5.0), (1000.0, 1000.0), (0.5, 40.0)]),
    controlled_speed=st.sampled_from([(25.0, 8.0), (60.0, 60.0)]),
    malfunction=st.sampled_from([0.0, 0.1, 0.1, 0.9, 0.999]),
    controlled_hazard=st.sampled_from([0.0, 0.4, 1.0]),
    sensing_radius=st.sampled_from([0.0, 0.03, 0.3, 2.0]),
)
tasks = st.builds(
    TaskRules,
    type_shares=st.sampled_from([(0.25, 0.25, 0.5), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]),
    difficulty=pairs(0, 1),
    values=st.sampled_from([(1.0, 2.0, 3.0), (0.5,), (0.001, 1e6)]),
    released_at_start=st.sampled_from([0.0, 0.5, 0.7, 1.0]),
    last_release=st.sampled_from([0.0, 0.6, 1.0]),
    deadline=st.sampled_from([(0.0, 0.0), (10.0, 60.0), (120.0, 560.0)]),
    decay=st.sampled_from([(0.001, 0.001), (10.0, 80.0)]),
    change_share=st.sampled_from([0.0, 0.4, 1.0]),
    service_base=st.sampled_from([1.0, 5.0, 20.0]),
    service_per_difficulty=st.sampled_from([0.0, 10.0]),
    success_autonomous=st.sampled_from([(0.95, 0.85), (1.0, 0.0), (0.0, 0.0), (0.5, 1.0)]),
)
operators = st.builds(
    OperatorRules,
    capacity=pairs(0.01, 3),
    fatigue_rate=st.sampled_from([0.0, 1.5e-3, 1e-2]),
    handover=st.sampled_from([0.0, 2.0, 5.0]),
    lease=st.sampled_from([1.0, 6.0, 15.0]),
    renewal_period=st.sampled_from([1.0, 4.0, 10.0]),
    bid_timeout=st.sampled_from([1.0, 5.0, 20.0]),
)
decisions = st.builds(
    DecisionRules,
    robot_period=st.integers(1, 12),
    operator_period=st.integers(1, 12),
    initial_phase=st.sampled_from([0.0, 0.1, 1.0]),
    refusal=st.sampled_from([1.0, 20.0]),
)


@st.composite
def _transport(draw):
    sizes = {kind: draw(st.sampled_from([size, size, 1, 40, 300])) for kind, size in BYTES.items()}
    largest = max(size for kind, size in sizes.items() if kind != "broadcast")
    return CommunicationRules(
        range=draw(st.sampled_from([(0.3, 0.22, 0.06), (0.0, 0.0, 0.0), (2.0, 2.0, 2.0)])),
        unavailable_or_delayed=draw(st.sampled_from([(0.1, 0.2, 0.3), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)])),
        out_degree=draw(st.sampled_from([1, 4, 64])),
        delay=draw(st.integers(1, 4)),
        late_delay=draw(st.sampled_from([(3, 8), (1, 1), (1, 20)])),
        broadcast_records=draw(st.sampled_from([0, 1, 8])),
        telemetry_records=draw(st.sampled_from([0, 1, 4, 8])),
        bucket=max(largest, draw(st.sampled_from([192.0, 192.0, 0.0, 1e6]))),
        refill=draw(st.sampled_from([16.0, 16.0, 0.0, 0.3, 1e4])),
        time_to_live=draw(st.sampled_from([24.0, 24.0, 1.0, 2.5])),
        telemetry_period=draw(st.sampled_from([1.0, 5.0, 7.5])),
        **{f"{kind}_bytes": size for kind, size in sizes.items()},
    )


BYTES = {
    field.name.removesuffix("_bytes"): field.default
    for field in dataclasses.fields(CommunicationRules)
    if field.name.endswith("_bytes")
}


@st.composite
def scenarios(draw, **fixed):
    """Valid scenarios; fields of the scenario or of a table of rules may be fixed by their name."""
    n_uav, n_ugv, n_operators, n_tasks = draw(_sizes())
    is_large = n_uav + n_ugv == 64
    scenario = Scenario(
        "medium",
        map_side=draw(st.sampled_from([300.0, 500.0, 1000.0, 5000.0])),
        n_tasks=n_tasks,
        time_limit=draw(st.integers(20, 40) if is_large else st.integers(30, 160)),
        n_uav=n_uav,
        n_ugv=n_ugv,
        n_operators=n_operators,
        world=draw(worlds),
        robots=draw(robots),
        tasks=draw(tasks),
        operators=draw(operators),
        communication=draw(_transport()),
        decisions=draw(decisions),
    )
    return change(scenario, **fixed)


def change(scenario, **fields):
    """The scenario with other fields: its own, or a table's (`change(s, n_tasks=3, refill=0.0)`)."""
    own = {name: fields.pop(name) for name in list(fields) if name in scenario.__dataclass_fields__}
    for name, value in fields.items():
        tables = [
            t
            for t in scenario.__dataclass_fields__
            if name in getattr(getattr(scenario, t), "__dataclass_fields__", ())
        ]
        assert len(tables) == 1, name
        own[tables[0]] = dataclasses.replace(own.get(tables[0], getattr(scenario, tables[0])), **{name: value})
    return dataclasses.replace(scenario, **own)
