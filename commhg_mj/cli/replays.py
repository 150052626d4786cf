"""Commands that look into a mission: what a robot knew, and where a query changed a plan."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from ..mission.trace import load_trace
from ..policies import find_policy
from .console import OUT, at_least, check_png, load_mujoco, make_folder, progress, say

RENDERS = Path("renders")  # where pictures go by default


@dataclass(frozen=True)
class Explain:
    """What a robot knew when it decided, beside the truth, and what its policy preferred: tables and a picture."""

    trace: tyro.conf.Positional[Path]
    """a trace file, from `run --out`; its mission is flown again"""
    robot: str
    """uav0, ugv1, ..."""
    at: float
    """the second; its last decision by then is shown"""
    policy: str | None = None
    """that flew the trace: a name or a file of weights; by default the name in the trace"""
    out: Path | None = None
    """FILE.png; by default renders/TRACE-ROBOT-SECOND.png"""

    def __call__(self):
        load_mujoco()
        from ..models.world import make_world
        from ..render.belief_figure import draw_knowledge
        from ..replay.beliefs import choice_words, headline, operator_sides
        from ..replay.replayer import Replayer, last_decision
        from .tables.decisions import operator_table, peer_table, task_table

        check_png(self.out)
        trace = load_trace(self.trace)
        flight = Replayer(trace, self.policy, str(self.trace))
        decision, names = last_decision(flight, self.robot, self.at), trace.scenario.robot_names
        look = flight.preferences()
        preferences = look and look(decision.seen)
        mark = " (PRIVILEGED REFERENCE: decided by the true state)" if find_policy(flight.policy).is_privileged else ""
        head, chosen = headline(decision, names), f"chose: {choice_words(decision)}{mark}"
        out = picture_path(self.out, f"{self.trace.stem}-{self.robot}-{self.at:g}.png")
        title = f"{self.trace.stem}, {head}"
        world = make_world(trace.scenario, trace.seed)
        draw_knowledge(out, world, decision, preferences, title, operator_sides(decision, names), chosen)
        say(head)
        OUT.print(task_table(decision, names, preferences))
        OUT.print(operator_table(decision, names, preferences))
        OUT.print(peer_table(decision, names))
        say(chosen)
        say(f"wrote {out}")


@dataclass(frozen=True)
class Cases:
    """Find the paper's case in traces: an operator expected, asked, found busy, another task chosen; draw the best one."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """trace files, from `run --out`; their missions are flown again"""
    policy: str | None = None
    """that flew the traces: a name or a file of weights; by default the name in each trace"""
    out: Path | None = None
    """FILE.png of the best case; by default renders/case-TRACE.png; the clip goes beside it"""
    clip: bool = True
    """render the clip"""
    workers: int = 2
    """processes"""

    def __call__(self):
        load_mujoco()
        from ..flights.fly import spread
        from ..render.case_figure import draw_case, film_case
        from ..replay.cases import case_captions, cases_of
        from .tables.decisions import case_table

        check_png(self.out)
        at_least("workers", self.workers, 1)
        if not self.traces:
            raise ValueError("traces: name at least one trace file, from run --out")
        names = {path: load_trace(path).scenario.robot_names for path in self.traces}
        with progress("flying", len(self.traces)) as advance:
            jobs = [(path, self.policy) for path in self.traces]
            found = spread(cases_of, jobs, self.workers, lambda _: advance(1))
        cases = [(path, case) for path, cases in zip(self.traces, found) for case in cases]
        if not cases:
            say(f"no case in {len(self.traces)} mission{'s' * (len(self.traces) > 1)}")
            return
        cases.sort(key=lambda item: item[1].weight, reverse=True)
        path, case = cases[0]
        trace, out = load_trace(path), picture_path(self.out, f"case-{path.stem}.png")
        captions = case_captions(case, trace)
        draw_case(out, trace, case, captions)
        OUT.print(case_table(cases, names))
        say(f"wrote {out}")
        if self.clip:
            with progress("rendering", 1) as advance:
                film_case(out.with_suffix(".mp4"), trace, case, captions, self.workers, lambda _, total: advance(1 / total))
            say(f"wrote {out.with_suffix('.mp4')}")


def picture_path(out: Path | None, name: str) -> Path:
    """Where a picture goes: `out`, or a name in the folder renders, which is made."""
    if out is None:
        make_folder(RENDERS)
    return out or RENDERS / name
