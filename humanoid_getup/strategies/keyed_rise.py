"""Keyed rise: a rise through key postures, which are kept where physics permits."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, islice

import numpy as np

from humanoid_getup.filtering.candidate import CandidateRollout
from humanoid_getup.motions.motion_database import KeyPosture
from humanoid_getup.planning.key_path import KEY_REST
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.free_rise import SLOWDOWN
from humanoid_getup.strategies.key_routes import KeyRoutes
from humanoid_getup.strategies.plan import KeyFigures, KeyRecord
from humanoid_getup.strategies.rise_search import FoundRise, RiseSearch, SearchTools
from robots import Posture, quaternion
from robots.quaternion import Array

CLOSE_JOINT = 0.1  # rad; largest joint error of a key posture that counts as kept
CLOSE_TILT = 0.35  # rad between the directions of gravity in the torso, likewise


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyPass:
    """The instant at which a robot comes closest to a key posture."""

    frame: int
    joint_error: Array
    """Key posture minus joint angles [rad], (n,)."""
    tilt: float
    """Angle between the directions of gravity in the two torso frames [rad]."""

    @property
    def largest(self) -> float:
        """Return the largest joint error [rad]."""
        return float(np.abs(self.joint_error).max())

    @property
    def distance(self) -> float:
        """Return the distance of the posture from the key; up to 1 the key is kept."""
        return max(self.largest / CLOSE_JOINT, self.tilt / CLOSE_TILT)

    @property
    def is_kept(self) -> bool:
        """Return whether the key counts as kept."""
        return self.distance <= 1.0


def find_passes(world: World, qpos: Array, keys: Sequence[Posture]) -> list[KeyPass]:
    """Find the times at which a robot is closest to each of several key postures, in order.

    Of all ordered instants those are taken whose distances have the least sum. MuJoCo positions
    have the shape (T, nq), one row for each control period.
    """
    layout = world.robot.layout(world.model)
    error = np.array([key.joint_pos - qpos[:, layout.qpos] for key in keys])  # (K, T, n)
    gravity = quaternion.gravity_in_body(qpos[:, layout.root_orientation])
    down = np.array([key.gravity_b for key in keys])
    tilt = np.arccos(np.clip(down @ gravity.T, -1.0, 1.0))  # (K, T)
    distance = np.maximum(np.abs(error).max(axis=2) / CLOSE_JOINT, tilt / CLOSE_TILT)
    frames = _pick_in_order(distance)
    return [
        KeyPass(frame=frame, joint_error=error[k, frame], tilt=float(tilt[k, frame]))
        for k, frame in enumerate(frames)
    ]


def _pick_in_order(distance: Array) -> list[int]:
    """Pick non-decreasing columns in the rows of (K, T) with the smallest sum."""
    total = np.zeros_like(distance)
    before = np.zeros(distance.shape[1])
    for k, row in enumerate(distance):
        total[k] = row + before
        before = np.minimum.accumulate(total[k])
    frames, last = list[int](), distance.shape[1] - 1
    for row in total[::-1]:
        last = int(np.argmin(row[: last + 1]))
        frames.append(last)
    return frames[::-1]


RESTS = (KEY_REST, 0.0)  # s at each key: where none stands that rests, some may that go on
CORRECTIONS = 3  # times that targets are shifted by the error at each key
FLAT, FADE = 0.1, 0.3  # s around a key in which targets are shifted in full, and until not at all
MOST_SELECTIONS = 7  # of keys, that are tried one after the other
FINALISTS = 4  # rollouts that may be checked against disturbances


@dataclass
class _Passing:
    """A rollout, and its passes of the keys."""

    rollout: CandidateRollout
    passes: list[KeyPass]

    @property
    def distance(self) -> float:
        return max(one.distance for one in self.passes)

    @property
    def lost(self) -> int:
        return sum(not one.is_kept for one in self.passes)


@dataclass
class _Tries:
    """Rollouts through some of the keys."""

    count: int = 0
    standing: list[_Passing] = field(default_factory=list)
    plan_s: float = 0.0
    reason: str = ""
    """Why the last way without a path has none."""


class KeyedRise:
    """Searches for a rise that passes through key postures."""

    def __init__(self, tools: SearchTools, keys: Sequence[KeyPosture]) -> None:
        self._tools, self._world, self._keys = tools, tools.world, tuple(keys)

    def search(self, start: Posture, rng: np.random.Generator) -> FoundRise:
        """Search from a posture at rest; the same arguments give the same result.

        All keys are tried together; if no rise that keeps any of them stands, some are left out.
        """
        reasons, rounds, plan_s = dict[int, str](), 0, 0.0
        for keys in self._list_selections():
            search = RiseSearch(
                self._tools, start, rng, lambda one, keys=keys: self._pass(one, keys).lost
            )
            tries = self._roll_out(search, start, keys, rng)
            search.check_all([one.rollout for one in tries.standing], FINALISTS)
            if search.found.rollout is not None and not search.is_done:
                search.vary()
            search.improve()
            found = search.found
            rounds, plan_s = rounds + found.rounds, plan_s + tries.plan_s
            best = found.rollout and self._pass(found.rollout, keys)
            if best and best.lost < len(keys):
                records = self._record(best.passes, keys, reasons)
                return replace(found, keys=records, planned=True, rounds=rounds, plan_s=plan_s)
            reasons |= {id(key): self._explain(tries, n) for n, key in enumerate(keys)}
        return FoundRise(keys=self._record([], [], reasons), rounds=rounds, plan_s=plan_s)

    def _list_selections(self) -> list[tuple[KeyPosture, ...]]:
        """List all keys, then the selections with one key less, and so on, each in their order."""
        sizes = range(len(self._keys), 0, -1)
        selections = (chosen for size in sizes for chosen in combinations(self._keys, size))
        return list(islice(selections, MOST_SELECTIONS))

    def _roll_out(
        self,
        search: RiseSearch,
        start: Posture,
        keys: Sequence[KeyPosture],
        rng: np.random.Generator,
    ) -> _Tries:
        """Roll out ways with rests at the keys, else without; correct those that stand."""
        tools, tries = self._tools, _Tries()
        routes = KeyRoutes(self._world, tools.database, rng, tools.monitor)
        for rest in RESTS:
            began = time.perf_counter()
            planned = routes.plan(start, keys, rest)
            tries.plan_s += time.perf_counter() - began
            tries.reason = routes.reason
            if not planned:
                break
            slow = [replace(candidate, slowdown=SLOWDOWN) for candidate in planned]
            rolled = search.roll_out(planned + slow)
            tries.count += len(rolled)
            passing = [self._pass(one, keys) for one in rolled if one.stood]
            if passing:
                tries.standing += self._correct(start, passing, keys)
            if any(one.lost == 0 for one in tries.standing):
                break
        return tries

    def _pass(self, rollout: CandidateRollout, keys: Sequence[KeyPosture]) -> _Passing:
        passes = find_passes(self._world, rollout.qpos, [key.posture for key in keys])
        return _Passing(rollout, passes)

    def _correct(
        self, start: Posture, passing: list[_Passing], keys: Sequence[KeyPosture]
    ) -> list[_Passing]:
        """Shift targets around each key repeatedly by the remaining error.

        Servos stay behind their targets by their load. Of each rollout the closest is kept that
        still stands.
        """
        best, last = list(passing), passing
        shifts = [np.zeros_like(one.rollout.target[: one.rollout.moving]) for one in passing]
        for _ in range(CORRECTIONS):
            for shift, begun, one in zip(shifts, passing, last, strict=True):
                for at, error in zip(begun.passes, one.passes, strict=True):
                    shift += self._bump(len(shift), at.frame) * error.joint_error
            targets = [
                self._world.robot.limit_targets(
                    one.rollout.target[: len(shift)] + shift, start.joint_pos
                )
                for one, shift in zip(passing, shifts, strict=True)
            ]
            rolled = self._tools.filter.replay(start, [one.rollout for one in passing], targets)
            last = [self._pass(one, keys) for one in rolled]
            best = [
                new if new.rollout.stood and new.distance < old.distance else old
                for old, new in zip(best, last, strict=True)
            ]
        return best

    def _bump(self, length: int, frame: int) -> Array:
        """Return the share of a shift around a frame, (length, 1): smoothly from 1 to 0."""
        away = np.abs(np.arange(length) - frame) * self._world.robot.control_period
        share = np.clip(1.0 - (away - FLAT) / FADE, 0.0, 1.0)
        return (share * share * (3.0 - 2.0 * share))[:, None]

    def _record(
        self, passes: Sequence[KeyPass], keys: Sequence[KeyPosture], reasons: dict[int, str]
    ) -> tuple[KeyRecord, ...]:
        passed = {id(key): one for key, one in zip(keys, passes, strict=True)}
        return tuple(
            KeyRecord(
                posture=key.posture,
                figures=self._measure(key.name, passed.get(id(key)), reasons.get(id(key), "")),
            )
            for key in self._keys
        )

    def _measure(self, name: str, one: KeyPass | None, reason: str) -> KeyFigures:
        if one is None:
            return KeyFigures(name=name, kept=False, reason=reason)
        return KeyFigures(
            name=name,
            kept=one.is_kept,
            time_s=(one.frame + 1) * self._world.robot.control_period,
            largest_joint_error_rad=one.largest,
            tilt_error_rad=one.tilt,
            reason="" if one.is_kept else self._describe(one),
        )

    def _describe(self, one: KeyPass) -> str:
        """Describe the distance at which a motion passes a key posture."""
        worst = int(np.argmax(np.abs(one.joint_error)))
        name = self._world.robot.joint_names[worst]
        text = f"the nearest that it comes: joint '{name}' {one.largest:.2f} rad off"
        return f"{text}, torso {one.tilt:.2f} rad" if one.tilt > CLOSE_TILT else text

    def _explain(self, tries: _Tries, number: int) -> str:
        """Describe why the last of several keys, with its number from 0, was dropped."""
        if not tries.count:
            return tries.reason
        if not tries.standing:
            return f"no rollout through it ends in a held stand: {tries.count} tried"
        best = min(tries.standing, key=lambda one: one.passes[number].distance)
        if not best.passes[number].is_kept:
            return f"of those that stand, {self._describe(best.passes[number])}"
        return "no rollout through it stands in any disturbed check"
