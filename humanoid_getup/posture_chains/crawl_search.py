"""Crawls: moves from posture to posture that bring a lying robot to a place with more room."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from humanoid_getup.experiments.disturbances import Disturbance, Scenarios
from humanoid_getup.experiments.judging.torque import count_runs, find_saturation
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.posture_chains.features import PlaceMeter
from humanoid_getup.posture_chains.goal import Goal
from humanoid_getup.posture_chains.move_player import MovePlayer
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import Archive
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit
from robots.body.parts import leg_length
from robots.kinematics import place
from robots.quaternion import Array

BATCH = 64  # moves that are tried at a time
WORLDS = 3  # in which each must end alike, and in which the crawl is played; the first undisturbed
MOST_SATURATION = 0.7  # s for which a servo may have all its torque without a break
ROOM = 0.8  # share of the distance at which a robot is near enough, at which the search ends


@dataclass(frozen=True, kw_only=True)
class Crawl:
    """Targets of a crawl, and the resulting postures."""

    target: Array
    """[rad], (T, n)"""
    qpos: Array
    """MuJoCo positions after each target, in the undisturbed world, (T, nq)."""
    distance: float
    """From a place with room at its end, in the worst world in which it was played [m]."""


class CrawlSearch:
    """Searches chains of resting postures that bring a robot to a place with room.

    An addition to [Lin12]: a robot under a table has to leave its place before it can rise, and
    how it can roll or crawl there is a matter of contacts, which no path of postures knows.
    """

    def __init__(
        self,
        world: World,
        limit: TorqueLimit,
        disturbance: Disturbance,
        *,
        threads: int = 0,
        monitor: ProgressMonitor | None = None,
    ) -> None:
        """Prepare for a torque limit, and for disturbances that a whole crawl has to withstand."""
        self._monitor = monitor or ProgressMonitor()
        self._world, self._limit, self._disturbance = world, limit, disturbance
        self._threads, self._experiment = threads, Experiment(world, threads=threads)
        self._moves = RandomMoves(world.robot, None)
        self.simulated = 0.0
        """Time simulated for this plan [s]."""

    def find(
        self,
        start: Posture,
        distance: Callable[[Array], Array],
        near: float,
        budget: float,
        rng: np.random.Generator,
    ) -> Crawl | None:
        """Find a crawl from a posture at rest to a place, or as near to it as is found.

        There is none if none leads nearer in all disturbed worlds. ``distance`` maps positions of
        the torso (..., 3) to distances (...) [m], of which ``near`` is near enough; the budget is
        simulated time [s].
        """
        place_goal = Goal(self._world, PlaceMeter(self._world, distance))
        player = MovePlayer(self._world, place_goal, rng, limit=self._limit, threads=self._threads)
        archive, goal = Archive(), 1.0 - ROOM * near / leg_length(self._world.robot)
        lying = place(self._world.robot, self._world.model, start)
        archive.add(player.describe(lying, start.joint_pos))
        scenarios = self._disturbance.sample(self._world, lying, WORLDS, rng, self._limit)
        best: Crawl | None = None
        before, least = self.simulated, float(distance(start.position))
        while (best is None or best.distance > near) and self.simulated - before < budget:
            played = player.simulated
            self._advance(player, archive, rng)
            self.simulated += player.simulated - played
            self._monitor.show(
                Progress(
                    phase="searching a crawl to room to rise [s simulated]",
                    done=self.simulated - before,
                    total=budget,
                    note=f"{len(archive)} states",
                )
            )
            if archive.best.progress >= goal or self.simulated - before >= budget:
                crawl = self._play(archive, player, scenarios, distance)
                if crawl is not None and crawl.distance < least:
                    best, least = crawl, crawl.distance
        return best

    def _advance(self, player: MovePlayer, archive: Archive, rng: np.random.Generator) -> None:
        """Try a batch of moves, and file the states that are reached alike in all worlds."""
        states = archive.draw(BATCH, rng)
        moves = self._moves.draw_all(states, player.scale, rng)
        if not (new := player.explore(states, moves, archive)):
            return
        ends, checked = player.repeat_last(new, WORLDS)
        for k in np.flatnonzero(ends.are_like(new)):
            archive.add(checked[k])

    def _play(
        self,
        archive: Archive,
        player: MovePlayer,
        scenarios: Scenarios,
        distance: Callable[[Array], Array],
    ) -> Crawl | None:
        """Play the best chain whole; cut it where all worlds are nearest to the place."""
        if not archive.best.depth:
            return None
        robot, layout = self._world.robot, self._world.robot.layout(self._world.model)
        path, chain = archive.best.path[1:], archive.best.chain
        ends = np.array(chain.list_ends(robot.control_period, player.rest))
        target = robot.limit_targets(chain.sample(robot.control_period, player.rest), chain.held)
        record = self._experiment.play(scenarios, np.repeat(target[None], len(scenarios), axis=0))
        self.simulated += record.duration
        full = find_saturation(
            robot, record.torque, record.actuator_vel, record.voltage[:, np.newaxis]
        )
        longest = count_runs(full).max(axis=(0, 2)) * robot.control_period
        sound = np.maximum.accumulate(longest)[ends - 1] <= MOST_SATURATION
        near = [
            player.are_near(state, record.qpos[:, at - 1])
            for state, at in zip(path, ends, strict=True)
        ]
        lost = np.flatnonzero(~sound | ~np.array(near))
        archive.drop(path[int(lost[0]) if lost.size else -1])
        if not sound[0] or record.diverged.any():
            return None
        apart = distance(record.qpos[:, ends[sound] - 1][..., layout.root_position]).max(axis=0)
        row = int(np.argmin(apart))
        end = int(ends[sound][row])
        return Crawl(
            target=target[:end], qpos=record.qpos[0, :end].copy(), distance=float(apart[row])
        )
