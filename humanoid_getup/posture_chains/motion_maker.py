"""Makes motions of chains: shortened, judged in disturbed worlds, named by what they pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.experiments.disturbances.disturbance import USUAL
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.motions.build import NoEntryError, with_entries
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import Motion, StartClass
from humanoid_getup.motions.trial import Trial
from humanoid_getup.posture_chains.chain_keyframes import FOUND, make_keyframes
from humanoid_getup.posture_chains.resting_state import PostureChain
from humanoid_getup.posture_chains.rise_kind import KindNamer
from humanoid_getup.posture_chains.shortening import SWAY, Shortener
from humanoid_getup.simulation.world import World
from robots import TorqueLimit
from robots.quaternion import Array

WORLDS = 48  # disturbed, in which a motion is judged
SOUND = 0.9  # share of them in which it must stand
WORTH = 0.3  # share from which a rise is improved
LONG = 7.0  # s for OP3, from which it is not
JUDGED = 4  # of the ever shorter versions of a chain, at most


@dataclass(frozen=True, kw_only=True, eq=False)
class MadeMotion:
    """A motion made of a chain, and why it is not kept."""

    keyframes: Keyframes
    share: float
    """Of disturbed worlds in which it stands."""
    motion: Motion | None = None
    """None where it is not kept."""
    failure: str = ""
    """Why it is not kept."""

    def refuse(self, failure: str) -> MadeMotion:
        """Return it without the motion."""
        return replace(self, motion=None, failure=failure)


class MotionMaker:
    """Makes motions of chains of one robot in one world, under one torque limit."""

    def __init__(self, world: World, *, seed: int, limit: TorqueLimit, threads: int = 0) -> None:
        """Prepare; the disturbed worlds are drawn from the seed, alike for all chains."""
        self._world, self._seed, self._limit, self._threads = world, seed, limit, threads
        self._experiment, self._namer = Experiment(world, threads=threads), KindNamer(world)
        self.simulated = 0.0
        """Time simulated so far [s]."""

    def make(
        self, chain: PostureChain, rest: float, *, name: str, start_class: StartClass
    ) -> MadeMotion:
        """Make a motion of a chain, whose moves are followed by a rest [s].

        The shortest of its versions that stands often enough is kept; motions end standing also
        when they are entered at rest at some of their frames.
        """
        keyframes = make_keyframes(
            chain, self._world.robot, name=name, start_class=start_class, rest=rest
        )
        shortener = Shortener(
            self._world, chain.start, self._draw(0), limit=self._limit, threads=self._threads
        )
        found = self._choose(shortener.shorten(keyframes), chain.start)
        short = found.keyframes.duration.sum() < LONG * shortener.scale
        if WORTH <= found.share < SOUND and short:
            improved = shortener.improve(found.keyframes, self._seed)
            found = max(found, self._choose([improved], chain.start), key=lambda each: each.share)
        self.simulated += shortener.simulated
        return self._record(found, chain.start) if found.share >= SOUND else found

    def _choose(self, versions: Sequence[Keyframes], start: Array) -> MadeMotion:
        """Return the shortest version that is sound; the soundest where none is."""
        rows = np.unique(np.linspace(len(versions) - 1, 0, JUDGED).round().astype(int))[::-1]
        best: MadeMotion | None = None
        for row in rows:
            keyframes = versions[row].stretch(self._world.robot)
            share = self.judge(keyframes, start)
            failure = f"stands in {share:.0%} of disturbed worlds, expected {SOUND:.0%}"
            if best is None or share > best.share:
                best = MadeMotion(keyframes=keyframes, share=share, failure=failure)
            if share >= SOUND:
                break
        assert best is not None
        return best

    def judge(self, keyframes: Keyframes, start: Array) -> float:
        """Return the share of disturbed worlds in which keyframes stand."""
        scenarios = USUAL.sample(self._world, start, WORLDS + 1, self._draw(1), self._limit)
        targets = keyframes.targets(self._world.robot, SWAY)
        outcome = self._experiment.compare(scenarios, [targets])
        self.simulated += outcome.record.duration
        stood = outcome.stood[0]
        return float(stood[1:].mean()) if stood[0] else 0.0

    def _record(self, found: MadeMotion, start: Array) -> MadeMotion:
        """Record a sound version as a motion."""
        world = self._world
        trial = Trial.of(world, found.keyframes, start)
        if not trial.succeeded:
            return replace(found, failure=f"at full torque it {trial.describe()}")
        risen = trial.outcome.qpos[
            : max(round(float(trial.stand.start_time) / world.robot.control_period), 1)
        ]
        passed = self._namer.name(risen, found.keyframes.start_class)
        strategy = FOUND + (f", over {passed}" if passed else "")
        keyframes = replace(found.keyframes, strategy=strategy)
        motion = replace(trial.record(self._describe(found)), strategy=strategy)
        try:
            motion = with_entries(world, motion)
        except NoEntryError as error:
            return replace(found, failure=str(error))
        return replace(found, keyframes=keyframes, motion=motion, failure="")

    def _describe(self, found: MadeMotion) -> dict[str, str | float | int]:
        limit = self._limit.value
        full = float(self._world.robot.max_torque.max())
        return {
            "program": "getup motions discover",
            "seed": self._seed,
            "disturbed_success": found.share,
            "torque_limit": full if limit is None else limit,
        }

    def _draw(self, purpose: int) -> np.random.Generator:
        return np.random.default_rng([self._seed, purpose])
