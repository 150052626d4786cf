"""CBBA: the consensus-based bundle algorithm over lossy, late links (Choi, Brunet, How 2009; asynchronous: Johnson et al. 2011).

Robots bid for bundles of tasks, tell their bids in broadcasts, and leave a task to whom bids most. Everybody sees only the bids
that delivered messages told it. docs/planner.md says what is theirs, what is ours, and what bids displace in a broadcast.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..base.arguments import instance
from ..base.elementary_functions import distance, exp
from ..base.kernels import kernel
from ..base.terms import IDLE, KEEP, NOBODY, Activity, Embodiment, Status
from ..mission.batch import MissionBatch, stay
from ..mission.decide import Decisions
from ..mission.estimate import expected_seconds
from ..mission.observe import Observations
from ..mission.service import autonomous_seconds, timeliness
from ..scenarios import Scenario
from .greedy import CLAIM_TRUST
from .planner import DETOUR, PERIOD, UNTOLD, expected_success, is_settled, list_open
from .schedule import follow_schedule
from .supervision import persist

UAV, SERVICING, SERVICED = int(Embodiment.UAV), int(Activity.SERVICING), int(Status.SERVICED)
BUNDLE = 3  # tasks that a robot bids for at once
BIDS_A_RECORD = 2  # task, winner, bid and time take 7 B, a task record about twice that
PATIENCE = 90.0  # s: what is done so much later is worth 1/e
LOYALTY = 1.1  # a robot's own task counts this many times: bundles do not flicker
KEPT = 32  # broadcasts of a robot whose bids may still be on their way, or unread


class Bids(NamedTuple):
    """Who is believed to win each task: a robot's table, and what its broadcasts carry."""

    winner: np.ndarray  # NOBODY: no bid
    bid: np.ndarray
    made: np.ndarray  # s: when the winner stood by it last


class Auction(NamedTuple):
    """What each robot remembers, and the bids that travel with each broadcast."""

    tables: Bids  # [E, R, T]
    path: np.ndarray  # [E, R, BUNDLE] own bundle in the order of its visits; NOBODY beyond its end
    told: np.ndarray  # [E, R, BUNDLE] the path that was broadcast last
    heard: np.ndarray  # [E, R, R] evidence time of the last broadcast of each peer that was read
    sent: np.ndarray  # [E, R, KEPT] when each of the last broadcasts left
    letters: Bids  # [E, R, KEPT, bids]
    tasks: np.ndarray  # [E, R, KEPT, bids] which task each bid is for; NOBODY: none


def new_bids(*shape) -> Bids:
    return Bids(np.full(shape, NOBODY, np.int64), np.zeros(shape), np.zeros(shape))


def new_auction(n_missions: int, scenario: Scenario) -> Auction:
    """Nobody has bid yet. A broadcast carries two bids for each task record that `with_bids` leaves out."""
    e, r, t = n_missions, scenario.n_robots, scenario.n_tasks
    n_bids = BIDS_A_RECORD * max(1, scenario.communication.broadcast_records)
    return Auction(
        tables=new_bids(e, r, t),
        path=np.full((e, r, BUNDLE), NOBODY, np.int64),
        told=np.full((e, r, BUNDLE), UNTOLD, np.int64),
        heard=np.full((e, r, r), -1.0),
        sent=np.full((e, r, KEPT), -1.0),
        letters=new_bids(e, r, KEPT, n_bids),
        tasks=np.full((e, r, KEPT, n_bids), NOBODY, np.int64),
    )


def with_bids(scenario: Scenario) -> Scenario:
    """The same scenario with half as many task records in a broadcast: bids take the room of the others."""
    records = scenario.communication.broadcast_records // 2
    return dataclasses.replace(scenario, communication=dataclasses.replace(scenario.communication, broadcast_records=records))


class Cbba:
    """Callable policy; its batch flies in `with_bids(scenario)`."""

    def __init__(self, batch: MissionBatch):
        instance("batch", batch, MissionBatch)
        self.rules, self.auction = batch.rules, new_auction(len(batch.seeds), batch.scenario)
        self.open = np.zeros(batch.scenario.n_tasks, np.int64)

    def __call__(self, observations: Observations) -> Decisions:
        decisions = stay(observations)
        bid_and_tell(self.rules, self.auction, self.open, observations, decisions)
        return decisions


@kernel
def bid_and_tell(rules, auction, found, observations, decisions):
    """Fill in the decisions of all who are due, in the order of consensus, bundle and broadcast."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        e, r = robot.mission, robot.robot
        if robot.time == 0.0:
            forget(auction, e, r)
        # Peers' bids meet the robot's own as it told them: later ones are lower, since tasks decay, and both would give way.
        hear_peers(auction, robot, observations.robot_peers[i])
        let_go_of_old(auction.tables, e, r, robot.time)
        tasks = observations.robot_tasks[i]
        build_bundle(rules[0], auction, robot, tasks, found[: list_open(tasks, found)])
        first = auction.path[e, r, 0]
        if is_settled(robot) or first == robot.task and first != NOBODY:
            decisions.task[i] = KEEP
        else:
            decisions.task[i] = first if first != NOBODY else IDLE
    persist(rules, observations, decisions.operator)
    follow_schedule(observations, decisions, False)
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        is_news = np.any(auction.told[robot.mission, robot.robot] != auction.path[robot.mission, robot.robot])
        decisions.broadcast[i] = robot.can_broadcast and (is_news or robot.since_broadcast >= PERIOD)
        if decisions.broadcast[i]:
            send_bids(auction, robot)


@kernel
def forget(auction, e, r):
    """A new mission begins."""
    auction.tables.winner[e, r] = NOBODY
    auction.path[e, r] = NOBODY
    auction.told[e, r] = UNTOLD
    auction.heard[e, r] = -1.0
    auction.sent[e, r] = -1.0


# Consensus.


@kernel
def hear_peers(auction, robot, peers):
    """Read the bids in each peer's newest broadcast: a record's evidence time says which one was delivered."""
    e, r = robot.mission, robot.robot
    for k in range(peers.shape[0]):
        time = robot.time - peers[k].age
        if k == r or peers[k].age < 0.0 or time <= auction.heard[e, r, k]:
            continue
        auction.heard[e, r, k] = time
        for letter in range(KEPT):
            if auction.sent[e, k, letter] == time:
                withdraw(auction, e, r, k, letter)
                for b in range(auction.tasks.shape[3]):
                    if auction.tasks[e, k, letter, b] != NOBODY:
                        merge(auction, e, r, k, letter, b)


@kernel
def withdraw(auction, e, r, k, letter):
    """Peer k names all that it bids for itself: what it does not name it has given up."""
    tables, time = auction.tables, auction.sent[e, k, letter]
    for j in range(tables.winner.shape[2]):
        if tables.winner[e, r, j] == k and tables.made[e, r, j] < time:
            tables.winner[e, r, j] = NOBODY


@kernel
def merge(auction, e, r, k, letter, b):
    """One bid that peer k told: newer word of the same winner replaces older, else the higher bid wins (its table 1)."""
    tables, j = auction.tables, auction.tasks[e, k, letter, b]
    letters = auction.letters
    winner, bid, made = letters.winner[e, k, letter, b], letters.bid[e, k, letter, b], letters.made[e, k, letter, b]
    held = tables.winner[e, r, j]
    if winner == r:  # about its own bids the robot knows better
        return
    if held == winner:
        is_better = made > tables.made[e, r, j]
    else:
        is_better = held == NOBODY or outbids(bid, winner, tables.bid[e, r, j], held)
    if is_better:
        tables.winner[e, r, j], tables.bid[e, r, j], tables.made[e, r, j] = winner, bid, made


@kernel
def outbids(bid, robot, other_bid, other_robot):
    """Whether a bid beats another; among equals the lower index wins."""
    return bid > other_bid or (bid == other_bid and robot < other_robot)


@kernel
def let_go_of_old(tables, e, r, now):
    """Own bids are made anew; others' that nobody has confirmed for long are void: their robot may have failed, or be far."""
    for j in range(tables.winner.shape[2]):
        if tables.winner[e, r, j] == r or now - tables.made[e, r, j] > CLAIM_TRUST:
            tables.winner[e, r, j] = NOBODY


# Bundles.


@kernel
def build_bundle(rules, auction, robot, tasks, found):
    """Bid for the tasks that add most to the path, one after the other, wherever nobody is known to bid more."""
    e, r = robot.mission, robot.robot
    path, tables = auction.path[e, r], auction.tables
    path[:] = NOBODY
    last = np.inf
    n = 0
    if is_settled(robot):
        n, path[0] = 1, robot.task
        last = score(rules, robot, tasks, path, 1)
        take(tables, e, r, robot.task, last, robot.time)
    while n < BUNDLE:
        best, choice, place = 0.0, NOBODY, 0
        value = score(rules, robot, tasks, path, n)
        for j in found:
            is_held = j == robot.task and robot.can_keep
            is_taken = tasks[j].status == SERVICED and tasks[j].age < CLAIM_TRUST
            if not (is_held or tasks[j].legal and not is_taken) or is_in(path, n, j):
                continue
            for at in range(is_settled(robot), n + 1):
                insert(path, n, at, j)
                # Bids fall along a bundle, whatever the score: so that consensus ends (Johnson et al., "bid warping").
                bid = min(last, (score(rules, robot, tasks, path, n + 1) - value) * (LOYALTY if is_held else 1.0))
                remove(path, n, at)
                other = tables.winner[e, r, j]
                if bid > best and (other == NOBODY or outbids(bid, r, tables.bid[e, r, j], other)):
                    best, choice, place = bid, j, at
        if choice == NOBODY:
            return
        insert(path, n, place, choice)
        take(tables, e, r, choice, best, robot.time)
        last = best
        n += 1


@kernel
def take(tables, e, r, j, bid, now):
    """Robot r stands by its own bid."""
    tables.winner[e, r, j], tables.bid[e, r, j], tables.made[e, r, j] = r, bid, now


@kernel
def is_in(path, n, j):
    """Whether task j is among the first n of a path."""
    for k in range(n):
        if path[k] == j:
            return True
    return False


@kernel
def insert(path, n, at, j):
    """Put task j into a path of n tasks."""
    for k in range(n, at, -1):
        path[k] = path[k - 1]
    path[at] = j


@kernel
def remove(path, n, at):
    """Take it out again."""
    for k in range(at, n):
        path[k] = path[k + 1]
    path[n] = NOBODY


@kernel
def score(rules, robot, tasks, path, n):
    """Time-discounted value of a path of n tasks (Choi et al., eq. 12, with this mission's timeliness and repeated attempts)."""
    seconds, total, x, y = 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        task = tasks[path[k]]
        if k == 0:
            way = 0.0 if path[0] == robot.task and robot.activity == SERVICING else float(task.distance)
        else:
            way = distance(task.x - x, task.y - y) * (1.0 if robot.embodiment == UAV else DETOUR)
        success = expected_success(rules, task.difficulty, True)
        seconds += expected_seconds(way / robot.speed, autonomous_seconds(rules, task.difficulty), success)
        end = robot.time + seconds
        if end <= rules.time_limit:
            total += task.value * timeliness(task.deadline, task.decay, end) * exp(-seconds / PATIENCE)
        x, y = float(task.x), float(task.y)
    return total


# Letters.


@kernel
def send_bids(auction, robot):
    """Write down what the broadcast of this second carries: all of one's own bids, then the newest others."""
    e, r = robot.mission, robot.robot
    letter, tables = auction.sent[e, r].argmin(), auction.tables  # in place of the one that left first
    auction.sent[e, r, letter] = robot.time
    auction.told[e, r] = auction.path[e, r]
    tasks = auction.tasks[e, r, letter]
    tasks[:] = NOBODY
    n = 0
    for j in auction.path[e, r]:
        if j != NOBODY and n < tasks.shape[0]:
            tasks[n] = j
            n += 1
    while n < tasks.shape[0]:
        newest, choice = -1.0, NOBODY
        for j in range(tables.winner.shape[2]):
            if tables.winner[e, r, j] != NOBODY and tables.made[e, r, j] > newest and not is_in(tasks, n, j):
                newest, choice = tables.made[e, r, j], j
        if choice == NOBODY:
            break
        tasks[n] = choice
        n += 1
    for b in range(n):
        j = tasks[b]
        auction.letters.winner[e, r, letter, b] = tables.winner[e, r, j]
        auction.letters.bid[e, r, letter, b] = tables.bid[e, r, j]
        auction.letters.made[e, r, letter, b] = tables.made[e, r, j]
