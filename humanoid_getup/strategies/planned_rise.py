"""Plans a rise: from a lying posture to a motion whose rollouts end standing."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from humanoid_getup.filtering.dynamics_filter import Candidate, CandidateRollout, DynamicsFilter
from humanoid_getup.filtering.reference import straight_path
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import Connection, MotionDatabase, load_database
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.planning.collision import CollisionChecker, Tolerances
from humanoid_getup.planning.path_planner import plan_rise
from humanoid_getup.planning.smoothing import Trajectory
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan, RiseOptions, RisePlan, RiseStatus
from robots import Posture, TorqueLimit, quaternion
from robots.kinematics import read_posture
from robots.quaternion import Array

STRAIGHT_SPEED = 3.0  # rad/s of the fastest joint on a path without a plan
SLOW = 0.6  # tempo of a path's second version
ENOUGH = 1.0  # share of the disturbed rollouts that must stand to stop searching
FINALISTS = 3  # rollouts of a round that are checked
FIRST_CONNECTIONS, MORE_CONNECTIONS, SECOND_CONNECTIONS = 3, 3, 2
TANGLED = Tolerances(body=0.003)  # of limbs hooked so tightly that they must slide to part
MOST_FAILURES = 2  # searches without a path before the start counts as tangled
SECOND_TRIES = 2  # rounds that continue from where the rollouts before ended
LIE_DOWN = 0.6  # s after a failed rollout until the next path begins


@dataclass
class _Search:
    """What a search for a rise has found so far."""

    start: Posture
    rng: np.random.Generator
    tried: list[CandidateRollout]
    best: CandidateRollout | None = None
    robust: float = float("nan")
    rounds: int = 0
    planned: bool = False


class PlannedRise:
    """Plans the rises of one robot in one scene."""

    def __init__(
        self,
        world: World,
        database: MotionDatabase | None = None,
        options: RiseOptions | None = None,
        *,
        torque_limit: TorqueLimit | None = None,
    ) -> None:
        """Prepare to plan.

        Args:
            world: Robot and scene.
            database: Motions to connect to; ``None`` for the robot's own.
            options: Which parts of the method to use.
            torque_limit: Of the servos; ``None`` for that of the options.
        """
        options = options or RiseOptions()
        if torque_limit is not None:
            options = replace(options, torque_limit=torque_limit)
        self.world, self.options = world, options
        self.database = load_database(world.robot) if database is None else database
        self._checker = CollisionChecker(world.robot, world.scene)
        self._tangled_checker = CollisionChecker(world.robot, world.scene, TANGLED)
        self.filter = DynamicsFilter(world, torque_limit=options.torque_limit)

    @property
    def torque_limit(self) -> TorqueLimit:
        """Return the torque limit that rises are planned for."""
        return self.options.torque_limit

    def plan(self, start: Posture, rng: np.random.Generator) -> RisePlan:
        """Plan a rise from a posture at rest; the same arguments give the same plan.

        The nearest connecting postures of a few motions first, the quickest that stands
        wins; where none does, further motions and slower paths; where none of those does
        either, from where the robot lies after them. A robot so tangled that no path leaves
        its posture is pulled free by its servos first.
        """
        began = time.perf_counter()
        search = _Search(start, rng, [])
        connections = self.database.select(start, FIRST_CONNECTIONS + MORE_CONNECTIONS)
        if not self.options.filtering:
            path = self._approach(start, connections[0], rng)
            return self._chain_unfiltered(connections[0], path, time.perf_counter() - began)
        first = self._candidates(search, search.start, connections[:FIRST_CONNECTIONS])
        plan_s = time.perf_counter() - began
        began = time.perf_counter()
        already = self.filter.count
        self._round(search, first)
        if not first:
            self._round(search, self._pull_free(search, connections[:FIRST_CONNECTIONS]))
        elif not self._is_done(search):
            further = self._candidates(search, search.start, connections[FIRST_CONNECTIONS:])
            self._round(search, further + [replace(c, tempo=SLOW) for c in first + further])
        for _ in range(SECOND_TRIES):
            if not self._is_done(search):
                self._try_again(search)
        filter_s = time.perf_counter() - began
        return self._conclude(search, self.filter.count - already, plan_s, filter_s)

    def _approach(
        self, start: Posture, connection: Connection, rng: np.random.Generator
    ) -> Trajectory | None:
        """Find a smooth path to a connecting posture."""
        if not self.options.planning:
            return self._straight(start, connection)
        path = plan_rise(start, connection, self._checker, rng).trajectory
        if path is None:
            path = plan_rise(start, connection, self._tangled_checker, rng).trajectory
        return path

    def _straight(self, start: Posture, connection: Connection) -> Trajectory:
        period = self.world.robot.control_period
        return straight_path(start, align(connection.posture, start), STRAIGHT_SPEED, period)

    def _is_done(self, search: _Search) -> bool:
        return search.best is not None and search.robust >= ENOUGH

    def _candidates(
        self,
        search: _Search,
        start: Posture,
        connections: list[Connection],
        before: Array | None = None,
    ) -> list[Candidate]:
        """Plan from a posture to connecting ones, as far as there are paths.

        After two failures the start itself is blocked, and the others are left out.
        """
        candidates: list[Candidate] = []
        for tried, connection in enumerate(connections):
            if tried == MOST_FAILURES and not candidates:
                break
            path = self._approach(start, connection, search.rng)
            if path is not None:
                candidates.append(self._candidate(path, connection, before))
        search.planned |= self.options.planning and before is None and bool(candidates)
        return candidates

    def _candidate(
        self, path: Trajectory, connection: Connection, before: Array | None = None
    ) -> Candidate:
        share = self.options.assistance
        return Candidate(path=path, connection=connection, assistance=share, before=before)

    def _pull_free(self, search: _Search, connections: list[Connection]) -> list[Candidate]:
        """Move straight and slowly where there is no path: limbs may give way."""
        return [
            replace(self._candidate(self._straight(search.start, c), c), tempo=SLOW)
            for c in connections
        ]

    def _try_again(self, search: _Search) -> None:
        """Continue from where failed rollouts left the robot lying."""
        candidates = []
        for failed in _sample_ends(search.tried, self.world):
            end = read_posture(self.world.robot, self.world.model, failed.qpos[-1])
            connections = self.database.select(end, SECOND_CONNECTIONS)
            candidates += self._candidates(search, end, connections, failed.target)
        self._round(search, candidates)

    def _round(self, search: _Search, candidates: list[Candidate]) -> None:
        """Roll candidates out; check the quickest that stood against disturbances."""
        if not candidates:
            return
        search.rounds += 1
        search.tried = self.filter.roll_out(search.start, candidates)
        standing = sorted((r for r in search.tried if r.stood), key=lambda r: r.stand_time)
        for finalist in standing[:FINALISTS]:
            share = self.filter.check(search.start, finalist.target, search.rng)
            if share > (search.robust if search.best else 0.0):
                search.best, search.robust = finalist, share
            if share >= ENOUGH:
                return

    def _conclude(self, search: _Search, rollouts: int, plan_s: float, filter_s: float) -> RisePlan:
        figures: dict[str, Any] = {
            "planned": search.planned,
            "robust": search.robust,
            "rollouts": rollouts,
            "rounds": search.rounds,
            "plan_s": plan_s,
            "filter_s": filter_s,
        }
        if search.best is not None:
            return MotionPlan(
                status=RiseStatus.STOOD,
                reason=RiseStatus.STOOD.value,
                motion=self._to_motion(search.start, search.best),
                connection=search.best.candidate.connection,
                stand_time=search.best.stand_time,
                **figures,
            )
        if not search.tried:
            status = RiseStatus.NOT_PLANNED
            return RisePlan(status=status, reason=status.value, **figures)
        status, highest = RiseStatus.FELL, max(r.peak_neck for r in search.tried)
        share = highest / self.world.robot.standing_neck_height
        reason = f"{status.value}: {rollouts} tried, the best raised the neck to {share:.0%}"
        return RisePlan(status=status, reason=reason, **figures)

    def _to_motion(self, start: Posture, rollout: CandidateRollout) -> Motion:
        """Make a motion of where a rollout went and which targets it sent."""
        robot, count = self.world.robot, rollout.moving
        went = [start] + [
            read_posture(robot, self.world.model, q) for q in rollout.qpos[: count - 1]
        ]
        joined = rollout.candidate.connection.motion
        return Motion(
            name=f"rise_by_{joined.name}",
            robot=robot.name,
            start_class=joined.start_class,
            strategy=joined.strategy,
            time=np.arange(count, dtype=float) * robot.control_period,
            position=np.array([p.position for p in went]),
            orientation=np.array([p.orientation for p in went]),
            joint_pos=np.array([p.joint_pos for p in went]),
            joint_target=rollout.target[:count],
            provenance={"program": "getup rise", "connection": joined.name},
        )

    def _chain_unfiltered(
        self, connection: Connection, path: Trajectory | None, plan_s: float
    ) -> RisePlan:
        """Chain the smoothed path and the motion without any physics."""
        if path is None:
            status = RiseStatus.NOT_PLANNED
            return RisePlan(
                status=status, reason=status.value, connection=connection, plan_s=plan_s
            )
        status = RiseStatus.UNFILTERED
        return MotionPlan(
            status=status,
            reason=status.value,
            motion=chain(self.world, path, connection),
            simulated=False,
            connection=connection,
            planned=self.options.planning,
            plan_s=plan_s,
        )


def chain(world: World, path: Trajectory, connection: Connection) -> Motion:
    """Play a path's angles and then the motion's own targets, as they are."""
    robot, joined, frame = world.robot, connection.motion, connection.frame
    count = len(path.time)
    turned = quaternion.normalize(np.concatenate([path.orientation, joined.orientation[frame:]]))
    angles = np.concatenate([path.joint_pos, joined.joint_pos[frame:]])
    return Motion(
        name=f"path_to_{joined.name}",
        robot=robot.name,
        start_class=joined.start_class,
        strategy=joined.strategy,
        time=np.arange(len(angles), dtype=float) * robot.control_period,
        position=np.concatenate([path.position, joined.position[frame:]]),
        orientation=turned,
        joint_pos=angles,
        joint_target=np.concatenate([path.joint_pos, joined.joint_target[frame:]]),
        provenance={"program": "getup rise", "connection": joined.name, "path_frames": count},
    )


def _sample_ends(tried: list[CandidateRollout], world: World) -> list[CandidateRollout]:
    """Take up to three failed rollouts that ended lying differently, cut where they lie still."""
    robot, model = world.robot, world.model
    period = robot.control_period
    ends: list[CandidateRollout] = []
    gravity: list[Array] = []
    for failed in (r for r in tried if not r.stood):
        length = min(failed.moving + round(LIE_DOWN / period), len(failed.target))
        cut = replace(failed, target=failed.target[:length], qpos=failed.qpos[:length])
        direction = quaternion.gravity_in_body(read_posture(robot, model, cut.qpos[-1]).orientation)
        if all(direction @ other < 0.8 for other in gravity):
            ends.append(cut)
            gravity.append(direction)
    return ends[:3]
