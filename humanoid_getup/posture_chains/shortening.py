"""Shortening: cuts the keys of a found rise that are not needed, and its times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial, reduce

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import FOUND, StartClass
from humanoid_getup.motions.preference import Preference
from humanoid_getup.posture_chains.goal import Goal, GoalExperiment
from humanoid_getup.posture_chains.move_player import measure_time_scale
from humanoid_getup.posture_chains.resting_state import PostureChain
from humanoid_getup.simulation.physics_engine import find_coarse_step
from humanoid_getup.simulation.world import SEARCH_TIMESTEP, World
from robots import Robot
from robots.quaternion import Array
from robots.smooth_step import invert_smooth_step

TIME_COST, TORQUE_COST = 0.5, 1.0  # where a motion is optimized
STILL = np.radians(0.01)  # change of a target below which a joint does not move


def make_keyframes(
    chain: PostureChain, robot: Robot, *, name: str, start_class: StartClass, rest: float
) -> Keyframes:
    """Make keyframes of a chain, with a rest [s] after each move; the last key is the stance.

    Between two keys at rest the targets move as those of the chain.
    """
    keys, durations = [chain.held], list[float]()
    for move in chain.moves:
        keys += [*move.knots, move.target]
        # A move is a smooth step over all its knots: the first and the last take longer.
        at = invert_smooth_step(np.linspace(0.0, 1.0, len(move.knots) + 1))
        durations += [*move.duration * np.diff(at), rest]
    keys[-1] = robot.standing.joint_pos
    moving = np.flatnonzero(np.ptp(keys, axis=0) > STILL)
    free = np.union1d(moving, robot.mirror_index[moving])
    return Keyframes(
        name=name,
        start_class=start_class,
        strategy=FOUND,
        duration=np.array(durations),
        keys=np.array(keys),
        free=free,
        mirrored=np.zeros(len(free), dtype=bool),
        torque_limit=float(robot.max_torque.max()),
        time_cost=TIME_COST,
        torque_cost=TORQUE_COST,
    )


WORLDS = 8  # in which a shortened rise is tried
ALL, FEW = tuple(range(WORLDS)), (0, 4)
"""Those in which several changes are tried, and one alone."""
TOLERANCES = (0.1, 0.05, 0.02)  # rad by which a curve with fewer keys may differ, in this order
SLACK = 0.2  # s that fewer keys may cost
REST_SHARES = (0.0, 0.3, 0.6)  # of all rests, tried in this order
PACES = (0.5, 0.65, 0.8)  # of all times
SHORTER = 0.6  # of the time of one key
ROWS = (16, 6, 2, 1)  # keys that are cut at once
FALLEN = 40.0  # s for OP3 that a fall costs
LEAST_TIME = 0.08  # s between two keys
ROUNDS = 4
MOST_SIMULATED = 4000.0  # s for one rise; long ones would take many times that, and rarely stand
FEWER = (1.0, 0.5, 0.25)  # shares of the changes that work alone, tried together
RMS_COST, IMPACT_COST = 8.0, 4.0  # s for the servos' full torque, and for 1 m/s
SWAY = 0.3  # s of hold after the last key, from which early stops count

Change = Callable[[Keyframes], Keyframes]


class Shortener:
    """Shortens keyframes as far as the robot still stands in disturbed worlds."""

    def __init__(
        self,
        world: World,
        scenarios: Scenarios,
        *,
        goal: Goal | None = None,
        threads: int = 0,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        """Prepare to shorten rises that have to stand in scenarios (`WORLDS`,).

        The first is undisturbed. They have to come to a goal on the way, if one is given.
        ``check`` is called before each batch of rollouts, and may raise an error to end the work.
        """
        self._check = check
        coarse = world.vary(timestep=world.robot.choose_timestep(SEARCH_TIMESTEP))
        goal, self._robot = goal or Goal(world), world.robot
        self._experiment = GoalExperiment(goal, coarse, threads=threads)
        coarsest = world.vary(timestep=find_coarse_step(world))
        self._first = GoalExperiment(goal, coarsest, threads=threads)
        self._scenarios = scenarios
        self._preference = Preference(
            time=1.0, rms_torque=RMS_COST / world.robot.max_torque.mean(), neck_delta_v=IMPACT_COST
        )
        self._cost = np.full(WORLDS, np.inf)
        self.scale = measure_time_scale(world.robot)
        """Times of this robot over those of OP3."""
        self.simulated = 0.0
        """Time simulated so far [s]."""

    def shorten(self, keyframes: Keyframes) -> list[Keyframes]:
        """Return ever cheaper keyframes, the given ones first.

        They cost the time to the stand, load and jolts, and much more in each world in which the
        robot falls. What takes longer than `MOST_SIMULATED` ends with what was found by then.
        """
        found, ends = [keyframes], self.simulated + MOST_SIMULATED
        self._cost = self._judge(found)[0]
        # Motions joined by a chain have many keys that the curve passes anyway.
        thinned = [thin(keyframes, tolerance) for tolerance in TOLERANCES]
        fewer = [each for each in thinned if len(each.keys) < len(keyframes.keys)]
        found += self._pick_first(fewer, SLACK)
        found += self._pick_first(_shorten_rests(found[-1]))
        last = found[-1]
        paced = [replace(last, duration=pace * last.duration) for pace in PACES]
        found += self._pick_first(paced)
        for _ in range(ROUNDS):
            before = len(found)
            for list_changes in CHANGES:
                if self.simulated > ends:
                    return found
                found += self._combine(found[-1], list_changes(found[-1]))
            if len(found) == before:
                break
        return found

    def _combine(self, keyframes: Keyframes, changes: Sequence[Change]) -> list[Keyframes]:
        """Make as many of the changes at once as still stand, of those that do alone."""
        if not changes:
            return []
        alone = [change(keyframes) for change in changes]
        cost = self._judge([*alone, keyframes], FEW, self._first).mean(axis=1)
        better = np.sum(cost[:-1] < cost[-1])
        order = np.argsort(cost[:-1], kind="stable")[:better]
        if not len(order):
            return []
        some = [order[: max(round(share * len(order)), 1)] for share in FEWER]
        together = [
            reduce(lambda made, k: changes[k](made), each.tolist(), keyframes) for each in some
        ]
        return self._pick_first([*together, alone[order[0]]])

    def _pick_first(self, candidates: Sequence[Keyframes], slack: float = 0.0) -> list[Keyframes]:
        """Return the first keyframes that cost less, or little more [s], if there are any."""
        for each in candidates:
            cost = self._judge([each])[0]
            if cost.mean() < self._cost.mean() + slack:
                self._cost = cost
                return [each]
        return []

    def _judge(
        self,
        candidates: Sequence[Keyframes],
        worlds: Sequence[int] = ALL,
        experiment: Experiment | None = None,
    ) -> Array:
        """Compute the costs of keyframes in some worlds, (C, K) [s]."""
        self._check()
        experiment = experiment or self._experiment
        sent = [each.targets(self._robot, SWAY) for each in candidates]
        outcome = experiment.compare(self._scenarios.take(np.array(worlds)), sent)
        self.simulated += outcome.record.duration
        cost = self._preference.cost(outcome)
        return np.where(outcome.stood, cost, FALLEN * self.scale)


def _shorten_rests(keyframes: Keyframes) -> list[Keyframes]:
    rests = find_rests(keyframes)
    return [
        replace(keyframes, duration=np.where(rests, share, 1.0) * keyframes.duration)
        if share
        else without_keys(keyframes, np.flatnonzero(rests) + 1)
        for share in REST_SHARES
    ]


def _cut(keys: Array, keyframes: Keyframes) -> Keyframes:
    """Cut keys, and the ways to them."""
    for key in keys:
        there = np.flatnonzero((keyframes.keys[1:-1] == key).all(axis=1))
        keyframes = without_keys(keyframes, there[:1] + 1)
    return keyframes


def _hurry(key: Array, keyframes: Keyframes) -> Keyframes:
    """Shorten the way to a key."""
    there = (keyframes.keys[1:] == key).all(axis=1)
    shorter = np.maximum(SHORTER * keyframes.duration, LEAST_TIME)
    duration = np.where(there, np.minimum(shorter, keyframes.duration), keyframes.duration)
    return replace(keyframes, duration=duration)


def _list_cuts(size: int, keyframes: Keyframes) -> list[Change]:
    """List the changes that cut so many keys in a row."""
    inner = keyframes.keys[1:-1]
    firsts = range(0, len(inner) - size + 1, max(size // 2, 1))
    return [partial(_cut, inner[first : first + size]) for first in firsts]


def _list_hurries(keyframes: Keyframes) -> list[Change]:
    rows = np.flatnonzero(SHORTER * keyframes.duration > LEAST_TIME)
    return [partial(_hurry, keyframes.keys[k + 1]) for k in rows]


CHANGES = (*(partial(_list_cuts, size) for size in ROWS), _list_hurries)
"""Lists of changes, made in this order."""


def find_rests(keyframes: Keyframes) -> NDArray[np.bool_]:
    """Tell between which keys the targets rest, (K-1,)."""
    return np.abs(np.diff(keyframes.keys, axis=0)).max(axis=1) < STILL


def thin(keyframes: Keyframes, tolerance: float) -> Keyframes:
    """Keep the keys through which a curve passes all others within a tolerance [rad], in time."""
    at, keys = np.concatenate([[0.0], np.cumsum(keyframes.duration)]), keyframes.keys
    kept = choose_keys(at, keys, tolerance)
    return replace(keyframes, keys=keys[kept], duration=np.diff(at[kept]))


def choose_keys(time: Array, positions: Array, close: float) -> list[int]:
    """Choose few of the points (T, n) whose curve is close [rad] to all of them; return their rows.

    The curve of keyframes goes through the ends first, and then, one by one, through the point
    from which it is farthest.
    """
    kept = [0, len(time) - 1]
    while True:
        curve = PchipInterpolator(time[kept], positions[kept], axis=0)
        distance = np.abs(curve(time) - positions).max(axis=1)
        farthest = int(distance.argmax())
        if distance[farthest] <= close or len(kept) == len(time):
            return kept
        kept = sorted([*kept, farthest])


def without_keys(keyframes: Keyframes, keys: NDArray[np.int_]) -> Keyframes:
    """Cut keys by number, each with the time of the way to it; the last is never cut."""
    last = len(keyframes.keys) - 1
    kept = np.setdiff1d(np.arange(last + 1), keys[keys < last])
    return replace(keyframes, keys=keyframes.keys[kept], duration=keyframes.duration[kept[1:] - 1])
