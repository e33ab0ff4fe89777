"""Sampled tracking: finds targets with which a simulated robot follows recorded postures.

After Liu et al., "Sampling-based Contact-rich Motion Control", 2010: window by window, target
offsets are sampled about the recorded angles and simulated from the best states so far, and the
states nearest to the recorded ones are kept. It needs no model of contacts, and it may be done in
several disturbed worlds at once, for targets that stand in all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.motions.course import Course
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World, count_substeps
from robots import Robot, quaternion
from robots.kinematics import place
from robots.quaternion import Array

GRAVITY = 9.81  # m/s²
TALL = 1.46  # m, neck of a person; windows are shorter with the root of the height
KEPT = 40  # states after each window
SIBLINGS = 3  # of them, from one state before
FREELY, USUALLY, SLIGHTLY, HARDLY = 0.22, 0.13, 0.06, 0.03  # rad, spread of offsets
SIZES = (0.3, 1.0, 1.6)  # factors on the spread of a sample
SYMMETRIC, SPARSE, LEFT = 0.35, 0.4, 0.3  # shares: of samples, of samples, of their joints
INHERITED, FADING = 0.5, 0.7  # share of samples that go on from the offsets before, and how much
LOST = 24.0  # cost from which the postures are lost
SPEED_SHARE = 0.9  # of the servos' speed
# Weights of the cost. Distances are in neck heights.
OVER_GROUND, HEIGHT, TILT, ANGLES = 60.0, 120.0, 3.0, 0.5
MOMENTUM, BALANCE, OFFSETS = 10.0, 0.5, 0.02
OVERLAP, FREE_OVERLAP = 300.0, 0.001  # in itself, beyond so many meters
MOST_OVERLAP = 4.0  # cost: a clip may begin with a limb inside another
WORST = 0.5  # weight of the worst of several worlds, beside the mean
PAST = 0.5  # weight of the cost so far
FOOTPRINT = 0.06  # neck heights; unit of the capture point's distance from the feet
MOST_BALANCE = 9.0
SLOPE_TIME = 0.03  # s over which the wanted speed of the mass center is measured

Rows = NDArray[np.int_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Branches:
    """States that are kept after a window, and how they were reached."""

    state: dict[str, Array]
    """MuJoCo's state of each in all worlds, (S, K, ...)."""
    target: Array
    """Targets of the window, one a control period [rad], (S, cycles, n)."""
    offset: Array
    """Offsets of the last from the recorded ones [rad], (S, n)."""
    cost: Array
    """(S,)"""
    before: Branches | None = None
    """Those that they go on from; None at the start."""
    parents: Rows
    """Which of them, (S,)."""

    @cached_property
    def windows(self) -> int:
        """Return the number of windows so far."""
        return self.before.windows + 1 if self.before else 0

    @property
    def sent(self) -> Array:
        """Return all targets so far [rad], (S, T, n)."""
        return np.concatenate(self._trace(lambda each: each.target), axis=1)

    @property
    def best_offsets(self) -> Array:
        """Return the offsets of the best one after each window [rad], (W, n)."""
        best = int(np.argmin(self.cost))
        return np.array([rows[best] for rows in self._trace(lambda each: each.offset)])

    def _trace(self, read: Callable[[Branches], Array]) -> list[Array]:
        """Read something of each window on the way to every state."""
        rows, found, each = np.arange(len(self.cost)), list[Array](), self
        while each.before is not None:
            found.append(read(each)[rows])
            rows, each = each.parents[rows], each.before
        return found[::-1]


@dataclass(frozen=True, kw_only=True, eq=False)
class WindowGoal:
    """The recorded state at the end of a window."""

    target: Array
    """Targets [rad], (n,)."""
    joint_pos: Array
    """[rad], (n,)"""
    up: Array
    """The vertical in the root's frame, (3,)."""
    bodies: Array
    """Places of the bodies [m], (B, 3)."""
    velocity: Array
    """Of the mass center [m/s], (3,)."""
    is_last: bool
    """Whether the robot should balance."""


class SampledTracker:
    """Tracks courses of one robot in some worlds at once."""

    def __init__(
        self,
        world: World,
        scenarios: Scenarios,
        *,
        samples: int,
        window: float,
        rng: np.random.Generator,
        threads: int = 0,
        goes_on: Callable[[float], bool] = lambda _: True,
    ) -> None:
        """Prepare to track from the start of the scenarios, with some samples a window.

        A window is as long as given [s] for a body as tall as a person. After each, ``goes_on`` is
        told the simulated time [s], and ends the tracking by False.
        """
        self.world, self.robot, self._rng = world, world.robot, rng
        self._goes_on = goes_on
        self._samples, self._worlds = samples, len(scenarios.starts)
        self._everyone = np.arange(samples * self._worlds)
        self._sim = VecSim(world, len(self._everyone), threads=threads)
        self._sim.bind("site_xpos", "xpos", "subtree_com", "sensordata")
        self._state = self._sim.bind_state()
        self._diverged = np.zeros(len(self._everyone), dtype=bool)
        self._overlap = int(world.model.sensor("overlap").adr[0])
        tiled = scenarios.tile(samples)
        self._sim.set_parameters(self._everyone, tiled.parameters)
        self._sim.place(self._everyone, tiled.starts)
        self._layout = self.robot.layout(world.model)
        self._substeps = count_substeps(world.model, self.robot.control_period)
        self._spread = find_spreads(self.robot)
        self._kinematics = _Kinematics(world)
        self._torso = self._layout.torso
        own = window * math.sqrt(self.robot.standing_neck_height / TALL)
        self.cycles = max(round(own / self.robot.control_period), 2)
        """Control periods of a window."""
        self.simulated = 0.0
        """[s]"""
        n = self.robot.n
        first = scenarios.starts[0, self._layout.qpos]
        self.start = Branches(
            state=self._take(np.zeros(1, dtype=int)),
            target=first[None, None],
            offset=np.zeros((1, n)),
            cost=np.zeros(1),
            parents=np.zeros(1, dtype=int),
        )
        """The state before the first window."""

    def track(
        self,
        course: Course,
        branches: Branches,
        *,
        balance_from: int,
        around: Array | None = None,
    ) -> list[Branches]:
        """Track a course from where the branches are; return them, and those after each window.

        It ends early where the postures are lost, or on request. From the frame
        ``balance_from`` on the robot should balance over its feet. Offsets are sampled about those
        of an earlier run, (W, n), if any are given.
        """
        followed, first = [branches], branches.windows * self.cycles
        ends = range(first + self.cycles, len(course) - 1 + self.cycles, self.cycles)
        for end in ends:
            goal = self._kinematics.aim(course, min(end, len(course) - 1), end >= balance_from)
            window = followed[-1].windows
            about = around[window] if around is not None and window < len(around) else None
            followed.append(self._advance(followed[-1], goal, about))
            if not self._goes_on(self.simulated) or followed[-1].cost.min() > LOST:
                break
        return followed

    def has_followed(self, course: Course, branches: Branches) -> bool:
        """Tell whether branches have followed a course to its end."""
        return branches.windows * self.cycles >= len(course) - 1

    def _advance(self, branches: Branches, goal: WindowGoal, around: Array | None) -> Branches:
        """Simulate one window from some branches."""
        parents = np.arange(self._samples) % len(branches.cost)
        offset = self._draw(branches, parents, around)
        start = branches.target[parents, -1]
        robot, time = self.robot, self.cycles * self.robot.control_period
        most = SPEED_SHARE * robot.max_velocity * time
        aim = np.clip(goal.target + offset, robot.lower, robot.upper)
        aim = start + np.clip(aim - start, -most, most)
        share = (np.arange(self.cycles) + 1.0)[:, None] / self.cycles
        targets = start[:, None] + share * (aim - start)[:, None]  # (N, cycles, n)
        moved = self._simulate(branches, parents, targets)
        cost = self._weigh(goal, moved) + OFFSETS * np.sum(offset**2, axis=1)
        cost += PAST * branches.cost[parents]
        rows = _choose(cost, parents, max(SIBLINGS, KEPT // len(branches.cost)))
        return Branches(
            state=self._take(rows),
            target=targets[rows],
            offset=offset[rows],
            cost=cost[rows],
            before=branches,
            parents=parents[rows],
        )

    def _draw(self, branches: Branches, parents: Rows, around: Array | None) -> Array:
        """Draw offsets of targets [rad], of samples with some parents, (N, n)."""
        rng, count, n = self._rng, len(parents), self.robot.n
        drawn = rng.normal(size=(count, n)) * self._spread
        symmetric = rng.random(count) < SYMMETRIC
        drawn[symmetric] = self.robot.symmetrize(drawn[symmetric]) * math.sqrt(2.0)
        sparse = rng.random(count) < SPARSE
        drawn[sparse] *= rng.random((int(sparse.sum()), n)) < LEFT
        drawn *= rng.choice(SIZES, size=(count, 1))
        drawn[: len(branches.cost)] = 0.0  # every parent goes on without a change, too
        if around is not None:
            return around + drawn
        inherits = rng.random(count) < INHERITED
        inherits[: len(branches.cost)] = False
        before = branches.offset[parents]
        return drawn + np.where(inherits[:, None], FADING * before, 0.0)

    def _simulate(self, branches: Branches, parents: Rows, targets: Array) -> Array:
        """Send targets (N, cycles, n); return the last velocity of the mass center, (N * K, 3)."""
        sim = self._sim
        for name, live in self._state.items():
            live[:] = branches.state[name][parents].reshape(live.shape)
        self._diverged[:] = False
        sent = np.repeat(targets, self._worlds, axis=0)
        before = np.zeros((len(self._everyone), 3))
        for k in range(self.cycles):
            before = sim.read("subtree_com")[:, self._torso].copy()
            sim.hold(sent[:, k], self._substeps)
            self._diverged |= sim.diverged
        self.simulated += len(self._everyone) * self.cycles * self.robot.control_period
        return (sim.read("subtree_com")[:, self._torso] - before) / self.robot.control_period

    def _take(self, rows: Rows) -> dict[str, Array]:
        """Copy the state of some samples, (S, K, ...)."""
        shape = (self._samples, self._worlds, -1)
        return {name: live.reshape(shape)[rows] for name, live in self._state.items()}

    def _weigh(self, goal: WindowGoal, velocity: Array) -> Array:
        """Compute the cost of the states that samples have reached, (N,)."""
        sim, height = self._sim, self.robot.standing_neck_height
        qpos, com = sim.read("qpos"), sim.read("subtree_com")[:, self._torso]
        bodies = sim.read("xpos")[:, self._kinematics.bodies]
        turn, apart = _align(bodies[:, :, :2], goal.bodies[:, :2])
        above = np.mean((bodies[:, :, 2] - goal.bodies[:, 2]) ** 2, axis=1)
        up = -quaternion.gravity_in_body(qpos[:, self._layout.root_orientation])
        tilt = np.arccos(np.clip(up @ goal.up, -1.0, 1.0))
        angles = np.mean((qpos[:, self._layout.qpos] - goal.joint_pos) ** 2, axis=1)
        turned = np.concatenate([_turn(velocity[:, None, :2], turn)[:, 0], velocity[:, 2:]], axis=1)
        momentum = np.sum((turned - goal.velocity) ** 2, axis=1) / (GRAVITY * height)
        cost = (OVER_GROUND * apart + HEIGHT * above) / height**2
        cost += TILT * tilt**2 + ANGLES * angles + MOMENTUM * momentum
        overlap = np.maximum(-sim.read("sensordata")[:, self._overlap] - FREE_OVERLAP, 0.0)
        cost += np.minimum(OVERLAP * overlap / height, MOST_OVERLAP)
        if goal.is_last:
            feet = sim.read("site_xpos")[:, self._kinematics.soles, :2].mean(axis=1)
            fall = np.sqrt(np.maximum(com[:, 2:], 0.05 * height) / GRAVITY)
            capture = com[:, :2] + velocity[:, :2] * fall
            off = np.sum((capture - feet) ** 2, axis=1) / (FOOTPRINT * height) ** 2
            cost += BALANCE * np.minimum(off, MOST_BALANCE)
        cost = np.where(self._diverged | ~np.isfinite(cost), 1e6, cost)
        cost = cost.reshape(self._samples, self._worlds)
        return cost.mean(axis=1) + (WORST * cost.max(axis=1) if self._worlds > 1 else 0.0)


class _Kinematics:
    """Places of a robot's bodies along a course."""

    def __init__(self, world: World) -> None:
        self._world = world
        model = world.model
        self.bodies = np.flatnonzero(model.body_mass > 0.0)
        self.soles = [model.site(site).id for site in world.robot.sole_sites]

    def aim(self, course: Course, frame: int, is_last: bool) -> WindowGoal:
        """Compute the goal at a frame."""
        period = self._world.robot.control_period
        span = max(round(SLOPE_TIME / period), 1)
        before, after = max(frame - span, 0), min(frame + span, len(course) - 1)
        torso = self._world.robot.layout(self._world.model).torso
        moved = self._move(course, after).subtree_com - self._move(course, before).subtree_com
        data = self._move(course, frame)
        return WindowGoal(
            target=course.joint_target[frame],
            joint_pos=course.joint_pos[frame],
            up=-quaternion.gravity_in_body(course.orientation[frame]),
            bodies=data.xpos[self.bodies].copy(),
            velocity=moved[torso] / (max(after - before, 1) * period),
            is_last=is_last,
        )

    def _move(self, course: Course, frame: int) -> mujoco.MjData:
        model, data = self._world.model, mujoco.MjData(self._world.model)
        data.qpos[:] = place(self._world.robot, model, course[frame : frame + 1].end)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        return data


def find_spreads(robot: Robot) -> Array:
    """Return the spread of the offsets of each joint [rad], (n,)."""
    spread = np.full(robot.n, USUALLY)
    for k, joint in enumerate(robot.joints):
        if joint.segment == "head":
            spread[k] = HARDLY
        elif joint.segment in ("wrist", "hand", "finger", "thumb"):
            spread[k] = SLIGHTLY
    rising = [robot.joint_names.index(name) for name in robot.rising_joints]
    both = [*rising, *robot.mirror_index[rising]]
    spread[both] = FREELY
    return spread


def _align(places: Array, wanted: Array) -> tuple[Array, Array]:
    """Turn and shift bodies (N, B, 2) over the ground until they are nearest to others (B, 2).

    Returns the turns [rad], (N,), and the mean squares of the distances that are left, (N,).
    """
    a, b = places - places.mean(axis=1, keepdims=True), wanted - wanted.mean(axis=0)
    along = np.einsum("nbi,bi->n", a, b)
    across = np.einsum("nb,b->n", a[:, :, 0], b[:, 1]) - np.einsum("nb,b->n", a[:, :, 1], b[:, 0])
    turn = np.arctan2(across, along)
    return turn, np.mean(np.sum((_turn(a, turn) - b) ** 2, axis=-1), axis=1)


def _turn(rows: Array, turn: Array) -> Array:
    """Turn vectors (N, B, 2) by angles (N,)."""
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    x, y = rows[..., 0], rows[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _choose(cost: Array, parents: Rows, siblings: int) -> Rows:
    """Choose the rows of the lowest costs, of which few have the same parent."""
    chosen: list[int] = []
    count = np.zeros(int(parents.max()) + 1, dtype=int)
    for row in np.argsort(cost, kind="stable"):
        if count[parents[row]] < siblings:
            count[parents[row]] += 1
            chosen.append(int(row))
        if len(chosen) == KEPT:
            break
    return np.array(chosen)
