"""Discovery: finds motions of a robot in the rises of a learned policy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.motions.build import SOUND, NoEntryError, with_entries
from humanoid_getup.motions.course import record_motion
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import FOUND_SIDES
from humanoid_getup.playback.preflight import preflight_stored
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from robots.kinematics import read_posture
from sim2real.motion_discovery.policy_rise import PolicyRise, collect_rises
from sim2real.motion_discovery.replay import ALL, FIRST, MORE, Replay, Replayer
from sim2real.motion_discovery.rise_kinds import group_rises, name_kind
from sim2real.motion_discovery.shaping import SMOOTHINGS

FINALISTS = 4  # of each wanted motion: rises that are played in all disturbed worlds


@dataclass(frozen=True, kw_only=True, eq=False)
class Discovery:
    """Motions found from one side, and the counts of rises."""

    start_class: LyingSide
    tried: int
    learned: int
    """Rises of the policy that stood."""
    replayed: int
    """Those that stand open loop, undisturbed."""
    best_share: float
    """Largest share of disturbed worlds in which one of them stands."""
    motions: tuple[Motion, ...]
    """The best of each kind, the most robust first."""


class MotionDiscovery:
    """Finds motions in the rises of a policy.

    Every rise that stands is replayed open loop, as smooth as it still stands, in disturbed worlds;
    the best of each kind becomes a motion.
    """

    def __init__(self, world: World, policy: OnnxPolicy, *, policy_name: str, seed: int) -> None:
        """Prepare to search in a scene; a seed makes it reproducible."""
        self._world, self._policy, self._seed = world, policy, seed
        self._policy_name = policy_name
        self._replayer = Replayer(world, seed)

    def search(
        self,
        start_class: LyingSide,
        count: int,
        most: int,
        report: Callable[[float], None] = lambda _: None,
    ) -> Discovery:
        """Find motions in rises from a number of postures on one side, up to a count.

        The work done is reported in postures, in steps.
        """
        rng = np.random.default_rng([self._seed, FOUND_SIDES.index(start_class)])
        rises = collect_rises(self._world, self._policy, start_class, count, rng)
        report(count - len(rises))
        replayed: list[Replay] = []
        for rise in rises:
            replayed += self._replay(rise)
            report(1)
        judged = self._judge(replayed, most)
        return Discovery(
            start_class=start_class,
            tried=count,
            learned=len(rises),
            replayed=len(replayed),
            best_share=max((each.share for each in judged), default=0.0),
            motions=tuple(self._record(judged, start_class, most)),
        )

    def _replay(self, rise: PolicyRise) -> list[Replay]:
        """Replay a rise as smooth as it still stands, in more worlds; None if it never stands."""
        for smoothing in SMOOTHINGS:
            tried = self._replayer.play(rise, smoothing, FIRST)
            if tried.stood.all():
                return [self._replayer.repeat(tried, MORE)]
        return []

    def _judge(self, replayed: Sequence[Replay], most: int) -> list[Replay]:
        """Replay the best of each kind in all disturbed worlds; return the best first."""
        groups = [sorted(group, key=_rank) for group in group_rises(self._world, replayed)]
        turns = max((len(group) for group in groups), default=0)
        in_turn = [group[k] for k in range(turns) for group in groups if k < len(group)]
        finalists = sorted(in_turn[: FINALISTS * most], key=_rank)
        return sorted((self._replayer.repeat(each, ALL) for each in finalists), key=_rank)

    def _record(self, judged: Sequence[Replay], side: LyingSide, most: int) -> list[Motion]:
        """Record the best robust rise of each kind that passes the preflight."""
        motions: list[Motion] = []
        sound = [each for each in judged if each.share >= SOUND]
        for group in sorted(group_rises(self._world, sound), key=lambda g: _rank(g[0])):
            name = f"{side}_{self._policy_name}_{len(motions) + 1}"
            found = (self._make_motion(each, name) for each in group)
            if motion := next((each for each in found if each is not None), None):
                motions.append(motion)
            if len(motions) == most:
                break
        return motions

    def _make_motion(self, replay: Replay, name: str) -> Motion | None:
        """Make a motion; None if it has no entry frames, or if the preflight refuses it."""
        world = self._world
        motion = record_motion(
            world,
            read_posture(world.robot, world.model, replay.rise.start),
            replay.target,
            replay.qpos,
            name=name,
            start_class=replay.rise.start_class,
            strategy=name_kind(world, replay),
            provenance={
                "program": "getup motions discover",
                "policy": self._policy_name,
                "seed": self._seed,
                "disturbed_success": replay.share,
                "torque_limit": self._replayer.torque_limit,
                "stand_time_s": replay.stand_time,
            },
        )
        try:
            motion = with_entries(world, motion)
        except NoEntryError:
            return None
        verdict = preflight_stored(world, motion)
        return motion if verdict.passed else None


def _rank(replay: Replay) -> tuple[float, float]:
    """Rank by robustness, in steps of a twelfth, and then by torque."""
    return -round(MORE * replay.share), replay.rms_torque
