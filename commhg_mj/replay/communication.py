"""How a policy communicates: how often it asks, whom, what it believed then, how old answers were; what else it sends."""

from collections.abc import Callable

import numpy as np

from ..base.terms import NOBODY, Session
from ..flights.fly import chunks_of, spread
from ..flights.statistics import mean_interval
from ..mission.observe import UNKNOWN
from ..policies import prepare
from ..radio import DEFAULT_LINKS

FIGURES = {  # of one mission, nan where it has none: what the table calls it
    "queries": "queries a mission",
    "answered": "answers a query",
    "free": "share to an operator believed free",
    "busy": "share to one believed busy",
    "unknown": "share to one never heard of",
    "own": "share to the robot's controller",
    "record_age": "age of the record when asking (s)",
    "answer_age": "age of an answer on delivery (s)",
    "turned": "share of news that changed the belief",
    "broadcasts": "broadcasts a robot-minute",
    "requests": "requests for assistance a mission",
    "control_time": "operators' control time",
}


class Listener:
    """A policy that passes on another's decisions and counts what is said; traces are larger and know less of records."""

    def __init__(self, batch, act: Callable):
        self._batch, self._act = batch, act
        self._counts = {}  # name: [E]
        missions, robots, operators = batch.state.resources.shape
        # What each robot had heard of each operator by its last decision: second at which that was true, session.
        self._times = np.full((missions, robots, operators), UNKNOWN)
        self._sessions = np.zeros((missions, robots, operators), np.int8)

    def __call__(self, seen):
        chosen = self._act(seen)
        self._hear(seen.robots, seen.robot_operators)
        self._count(seen.robots["mission"], broadcasts=chosen.broadcast, requests=chosen.assist)
        query = np.asarray(chosen.query)
        asks = np.flatnonzero(query != NOBODY)
        robots, records = seen.robots[asks], seen.robot_operators[asks, query[asks]]
        known, rests = records["age"] >= 0, records["session"] == Session.REST
        self._count(
            robots["mission"], queries=np.ones(len(asks)), free=known & rests, busy=known & ~rests, unknown=~known,
            own=robots["controller"] == query[asks], record_ages=np.where(known, records["age"], 0.0),
        )  # fmt: skip
        return chosen

    def _hear(self, robots, records):
        """Nothing but answers renews a robot's record of an operator."""
        at, sessions = (robots["mission"], robots["robot"]), records["session"]
        times = np.where(records["age"] >= 0, robots["time"][:, None] - records["age"], UNKNOWN)
        news = (times > self._times[at]) & (self._times[at] >= 0)  # a first answer has no belief to change
        turned = news & (sessions != self._sessions[at])
        self._count(at[0], news=news.sum(axis=1), turned=turned.sum(axis=1))
        self._times[at], self._sessions[at] = times, sessions

    def _count(self, missions, **amounts):
        """Add each row's amounts to its mission."""
        for name, column in amounts.items():
            self._counts[name] = self._counts.get(name, 0.0) + np.bincount(missions, column, len(self._batch.seeds))

    def figures(self) -> list[dict]:
        """FIGURES of every mission so far."""
        scores, state, counts = self._batch.scores(), self._batch.state, self._counts
        asked, failed_at = counts["queries"], state.robots["failed_at"]
        alive = np.where(failed_at >= 0, failed_at, state.missions["now"][:, None])  # s; who failed is silent
        replies, latency = (np.array([score.messages["reply"][n] for score in scores]) for n in ("delivered", "mean_latency"))
        with np.errstate(invalid="ignore"):  # nothing out of nothing is the nan that we want
            columns = {
                "queries": asked,
                "answered": replies / asked,
                **{name: counts[name] / asked for name in ("free", "busy", "unknown", "own")},
                "record_age": counts["record_ages"] / (asked - counts["unknown"]),
                "answer_age": np.where(replies, latency, np.nan),  # a reply is written in the second that it is sent
                "turned": counts["turned"] / counts["news"],
                "broadcasts": counts["broadcasts"] / (alive.sum(axis=1) / 60.0),
                "requests": counts["requests"],
                "control_time": [score.control_time for score in scores],
            }
        return [{name: float(column[e]) for name, column in columns.items()} for e in range(len(scores))]


def fly_and_listen(scenario, policy, seeds, links=DEFAULT_LINKS, limitation="nominal", workers=1, advance=lambda n: None) -> list:
    """(`Score`, FIGURES) of one mission a seed; otherwise as `fly`."""
    jobs = [(scenario, policy, chunk, links, limitation) for chunk in chunks_of(seeds)]
    results = spread(_listen_chunk, jobs, workers, lambda flights: advance(len(flights)))
    return [flight for chunk in results for flight in chunk]


def _listen_chunk(scenario, policy, seeds, links, limitation) -> list:
    return listen(*prepare(policy, scenario, seeds, links, limitation))


def listen(batch, act: Callable) -> list:
    """(`Score`, FIGURES) of every mission of a new batch, flown to its end."""
    listener, seen = Listener(batch, act), batch.observations
    while not batch.over.all():
        seen = batch.step(listener(seen))
    return list(zip(batch.scores(), listener.figures()))


def mean_figures(figures: list[dict]) -> dict:
    """{name: mean over the missions that have the figure, a dash without any}."""
    columns = {name: [each[name] for each in figures if not np.isnan(each[name])] for name in FIGURES}
    return {name: str(mean_interval(values)) if values else "-" for name, values in columns.items()}
