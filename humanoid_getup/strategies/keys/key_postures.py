"""Key postures in a rise: searched for, kept where physics permits, and dropped with a reason."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, islice

import numpy as np

from humanoid_getup.filtering.candidate import CandidateRollout, Patience
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.filtering.variation import limit_targets
from humanoid_getup.motions.key_posture import KeyPosture
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.keys.key_record import CLOSE_TILT, KeyPass, KeyRecord, find_passes
from humanoid_getup.strategies.keys.key_routes import RESTS, KeyRoutes
from robots import Posture
from robots.quaternion import Array
from robots.smooth_step import smooth_step

CORRECTIONS = 3  # times that targets are shifted by the error at each key
FLAT, FADE = 0.1, 0.3  # s around a key in which targets are shifted in full, and until not at all
MOST_SELECTIONS = 7  # of keys, that are tried one after the other
FINALISTS = 4  # rollouts that may be checked against disturbances
KEPT = 1.0  # distance of a pass up to which a key is kept


@dataclass(frozen=True, kw_only=True)
class KeyedRise:
    """What a search for a rise through key postures found."""

    rollout: CandidateRollout | None = None
    """``None`` if nothing stands that passes through any of them."""
    robust: float = 0.0
    """Share of the disturbed rollouts that stood."""
    rounds: int = 0
    records: tuple[KeyRecord, ...]
    """What became of each key posture, in the order given."""
    plan_s: float
    """Wall time of planning [s]."""
    filter_s: float
    """Wall time of everything else [s]."""


@dataclass
class _Passing:
    """A rollout that stands, and how it passes the keys."""

    rollout: CandidateRollout
    passes: list[KeyPass]

    @property
    def distance(self) -> float:
        return max(one.distance for one in self.passes)

    @property
    def order(self) -> tuple[int, float]:
        """Sort by the number of keys that are lost, then by cost."""
        return sum(one.distance > KEPT for one in self.passes), self.rollout.cost


@dataclass
class _Trial:
    """How far rises through some of the keys came."""

    rounds: int = 0
    plan_s: float = 0.0
    tried: int = 0
    standing: list[_Passing] = field(default_factory=list)
    reason: str = ""


class KeyedSearch:
    """Searches for rises that pass through key postures."""

    def __init__(
        self,
        world: World,
        database: MotionDatabase,
        dynamics: DynamicsFilter,
        keys: Sequence[KeyPosture],
        *,
        patience: Patience,
        assistance: float,
        search_budget: float,
    ) -> None:
        """Prepare to search; the budget is that of a planned rise [s]."""
        self._world, self._database, self._filter = world, database, dynamics
        self._keys, self._patience, self._assistance = tuple(keys), patience, assistance
        self._budget = search_budget

    def plan(self, start: Posture, rng: np.random.Generator) -> KeyedRise:
        """Search from a posture at rest; the same arguments give the same result.

        All keys are tried together; where nothing stands that keeps any of them, some are left
        out.
        """
        began, reasons = time.perf_counter(), dict[int, str]()
        rounds, plan_s = 0, 0.0
        for keys in self._list_selections():
            trial = self._try(start, keys, rng)
            rounds, plan_s = rounds + trial.rounds, plan_s + trial.plan_s
            found = self._finish(start, trial, keys, rng)
            if found is not None and found[0].order[0] < len(keys):
                return KeyedRise(
                    rollout=found[0].rollout,
                    robust=found[1],
                    rounds=rounds,
                    records=self._record(found[0].passes, keys, reasons),
                    plan_s=plan_s,
                    filter_s=time.perf_counter() - began - plan_s,
                )
            reasons |= {id(key): self._explain(trial, n) for n, key in enumerate(keys)}
        return KeyedRise(
            rounds=rounds,
            records=self._record([], [], reasons),
            plan_s=plan_s,
            filter_s=time.perf_counter() - began - plan_s,
        )

    def _list_selections(self) -> list[tuple[KeyPosture, ...]]:
        """List all keys, then the selections with one key less, and so on, each in their order."""
        sizes = range(len(self._keys), 0, -1)
        selections = (chosen for size in sizes for chosen in combinations(self._keys, size))
        return list(islice(selections, MOST_SELECTIONS))

    def _try(self, start: Posture, keys: Sequence[KeyPosture], rng: np.random.Generator) -> _Trial:
        """Roll out the ways through keys, resting at them, or else not; correct those that stand.

        Ways that do not rest are tried only if none that rests keeps all keys.
        """
        trial, routes = _Trial(), KeyRoutes(self._world, self._database, rng)
        for rest in RESTS:
            began = time.perf_counter()
            planned = routes.plan(start, keys, rest)
            trial.plan_s += time.perf_counter() - began
            trial.reason = routes.reason
            if not planned:
                break
            candidates = [replace(c, assistance=self._assistance) for c in planned]
            candidates += [replace(c, patience=self._patience) for c in candidates]
            rolled = self._filter.roll_out(start, candidates)
            trial.rounds, trial.tried = trial.rounds + 1, trial.tried + len(rolled)
            passing = [_Passing(one, self._measure(one, keys)) for one in rolled if one.stood]
            if passing:
                trial.standing += self._correct(start, passing, keys)
            if any(one.order[0] == 0 for one in trial.standing):
                break
        return trial

    def _measure(self, rollout: CandidateRollout, keys: Sequence[KeyPosture]) -> list[KeyPass]:
        return find_passes(self._world, rollout.qpos, [key.posture for key in keys])

    def _correct(
        self, start: Posture, passing: list[_Passing], keys: Sequence[KeyPosture]
    ) -> list[_Passing]:
        """Shift targets around each key by the error that is left there, again and again.

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
                limit_targets(
                    one.rollout.target[: len(shift)] + shift, start.joint_pos, self._world.robot
                )
                for one, shift in zip(passing, shifts, strict=True)
            ]
            rolled = self._filter.replay(start, [one.rollout for one in passing], targets)
            last = [_Passing(one, self._measure(one, keys)) for one in rolled]
            best = [
                new if new.rollout.stood and new.distance < old.distance else old
                for old, new in zip(best, last, strict=True)
            ]
        return best

    def _bump(self, length: int, frame: int) -> Array:
        """Return the share of a shift around a frame, (length, 1): smoothly from 1 to 0."""
        away = np.abs(np.arange(length) - frame) * self._world.robot.control_period
        return smooth_step(1.0 - (away - FLAT) / FADE)[:, None]

    def _finish(
        self,
        start: Posture,
        trial: _Trial,
        keys: Sequence[KeyPosture],
        rng: np.random.Generator,
    ) -> tuple[_Passing, float] | None:
        """Check the best against disturbances, and vary what does not stand in all of them.

        What separation, search or improvement changes counts only if it keeps as many keys.
        """
        best: tuple[_Passing, float] | None = None
        for one in sorted(trial.standing, key=lambda one: one.order)[:FINALISTS]:
            parted = self._filter.separate(start, one.rollout)
            if parted is not one.rollout:
                moved = _Passing(parted, self._measure(parted, keys))
                one = moved if moved.order[0] <= one.order[0] else one
            share = self._filter.check(start, one.rollout.target, rng)
            merit = (-one.order[0], share)
            if share > 0.0 and (best is None or merit > (-best[0].order[0], best[1])):
                best = (one, share)
            if share == 1.0:
                break
        return best and self._vary(start, *best, keys, rng)

    def _vary(
        self,
        start: Posture,
        passing: _Passing,
        share: float,
        keys: Sequence[KeyPosture],
        rng: np.random.Generator,
    ) -> tuple[_Passing, float]:
        """Search for more robust or cheaper variations that keep as many keys."""
        preference, better = self._filter.preference, share
        if share < 1.0:
            varied, better = self._filter.search(start, passing.rollout, self._budget, rng)
        elif preference.is_demanding:
            budget = preference.improvement * self._budget
            varied = self._filter.improve(start, passing.rollout, budget, rng)
        else:
            return passing, share
        moved = _Passing(varied, self._measure(varied, keys))
        is_better = better > share or share == 1.0
        if varied.stood and is_better and moved.order[0] <= passing.order[0]:
            return moved, better
        return passing, share

    def _record(
        self, passes: Sequence[KeyPass], keys: Sequence[KeyPosture], reasons: dict[int, str]
    ) -> tuple[KeyRecord, ...]:
        passed = {id(key): one for key, one in zip(keys, passes, strict=True)}
        return tuple(
            self._record_pass(key, passed[id(key)])
            if id(key) in passed
            else KeyRecord(name=key.name, posture=key.posture, kept=False, reason=reasons[id(key)])
            for key in self._keys
        )

    def _record_pass(self, key: KeyPosture, one: KeyPass) -> KeyRecord:
        kept, period = one.distance <= KEPT, self._world.robot.control_period
        return KeyRecord(
            name=key.name,
            posture=key.posture,
            kept=kept,
            time=(one.frame + 1) * period,
            joint_error=one.largest,
            tilt_error=one.tilt,
            reason="" if kept else self._describe(one),
        )

    def _describe(self, one: KeyPass) -> str:
        """Say how far from a key posture a motion passes."""
        worst = int(np.argmax(np.abs(one.joint_error)))
        name = self._world.robot.joint_names[worst]
        text = f"the nearest that it comes: joint '{name}' {one.largest:.2f} rad off"
        return f"{text}, torso {one.tilt:.2f} rad" if one.tilt > CLOSE_TILT else text

    def _explain(self, trial: _Trial, number: int) -> str:
        """Say why the last of several keys, with its number from 0, was dropped."""
        if not trial.tried:
            return trial.reason
        if not trial.standing:
            return f"no rollout through it ends in a held stand: {trial.tried} tried"
        best = min(trial.standing, key=lambda one: one.passes[number].distance)
        if best.passes[number].distance > KEPT:
            return f"of those that stand, {self._describe(best.passes[number])}"
        return "no rollout through it stands in any disturbed check"
