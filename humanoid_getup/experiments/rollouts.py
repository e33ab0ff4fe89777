"""Plays targets, feedback laws or policies in simulation, on many robots, and records them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.record import (
    RECORDED,
    Record,
    Recorder,
    combine_arrays,
    join_records,
)
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.judging.torque import LONG_SATURATION, count_runs, find_saturation
from humanoid_getup.simulation.vectorized_simulation import Ids, VecSim
from humanoid_getup.simulation.world import World, count_substeps
from robots import Robot
from robots.quaternion import Array

CHUNK = 25  # control periods between two checks
HELD = HOLD_TIME + 0.3  # s; a stand that lasts this long counts as held
REST_TIME = 0.6  # s; a robot that has stood at rest this long stays there
REST_SPEED = 0.03  # rad/s and m/s; bound for every degree of freedom at rest
LATEST_STAND = 1.5  # s after the last target within which a stand must begin
DOWN_NECK, DOWN_TILT = 0.6, math.radians(60.0)  # bounds beyond which a robot is down
DOWN_TIME = 0.2  # s after the last target; a robot that is down then has fallen


class EarlyStop:
    """Decides for each of N robots whether its rollout is over.

    A robot at rest in a stand, with constant targets, will stay there, so its hold need not be
    simulated. A robot that lies after its last target has fallen. One whose servo has been
    saturated for too long fails, because the overload protection of the servo may trip.
    """

    def __init__(self, robot: Robot, length: NDArray[np.int_], voltage: Array) -> None:
        """Begin rollouts of motions with ``length`` samples, (N,), at a supply [V], (N,)."""
        self._robot, self._length, self._voltage = robot, length, voltage
        count = len(length)
        self.cycle = 0
        """Samples so far."""
        self.going = np.ones(count, dtype=bool)
        """Whether each rollout continues, (N,)."""
        self.failed, self.stood = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        self.cycles = np.zeros(count, dtype=int)
        """Number of samples until each was stopped, (N,)."""
        self._since = np.zeros(count, dtype=int)
        self._saturated = np.zeros((count, robot.n), dtype=int)

    def cut(self, target: Array) -> Array:
        """Return the next chunk of a robot's targets (T, n); the last is repeated."""
        return target[np.minimum(self.cycle + np.arange(CHUNK), len(target) - 1)]

    def add(self, going: NDArray[np.int_], record: Record, speed: Array) -> None:
        """Read a chunk of the continuing robots, and decide which rollouts are over.

        The speed of each is the greatest of any degree of freedom [rad/s, m/s].
        """
        broken = ~record.upright
        after = self.cycle + CHUNK - np.argmax(broken[:, ::-1], axis=1)  # the last break
        since = np.where(broken.any(axis=1), after, self._since[going])
        self.cycle += CHUNK
        self.cycles[going], self._since[going] = self.cycle, since
        held = (self.cycle - since) * record.period
        past = (self.cycle - self._length[going]) * record.period  # s after the last target
        settled = (speed < REST_SPEED) & (np.minimum(held, past) >= REST_TIME)
        overloaded = self._find_overloaded(going, record)
        stood = (past > 0.0) & ((held >= HELD) | settled) & ~overloaded
        neck = record.stance.neck_height[:, -1] / self._robot.standing_neck_height
        down = (neck < DOWN_NECK) | (record.stance.tilt[:, -1] > DOWN_TILT)
        late = (since - self._length[going]) * record.period > LATEST_STAND
        hopeless = (down & (past > DOWN_TIME)) | late | record.diverged | overloaded
        self.stood[going], self.failed[going] = stood, ~stood & hopeless
        self.going[going] = ~(stood | hopeless)

    def _find_overloaded(self, going: NDArray[np.int_], record: Record) -> NDArray[np.bool_]:
        """Find the robots with a servo whose overload protection may have tripped by now."""
        saturated = find_saturation(
            self._robot, record.torque, record.actuator_vel, self._voltage[going, np.newaxis]
        )
        runs = count_runs(saturated, self._saturated[going])
        self._saturated[going] = runs[:, -1]
        return runs.max(axis=(1, 2)) * record.period > LONG_SATURATION


LONG = 50  # control periods that are simulated in one call where none is stopped early

Bools = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Feedback:
    """Input of a feedback law: N rollouts at the start of a control period."""

    step: int
    joint_pos: Array
    """Joint angles [rad], (N, n)."""
    com: Array
    """Center of mass of each body's subtree [m], (N, nbody, 3); valid until the next step."""
    axis: Array
    """Joint axes in the world, (N, n, 3)."""
    anchor: Array
    """Joint anchors in the world [m], (N, n, 3)."""
    limb_touch: Bools
    """Whether a limb touches the world, (N, limbs)."""
    limb_point: Array
    """Point at which the net contact force of each limb acts [m], (N, limbs, 3)."""


FeedbackLaw = Callable[[Feedback], Array | None]
"""Maps feedback to the targets to send (N, n), or to ``None`` at the end."""
PieceSource = Callable[[], Array | None]
"""Returns the targets of the next control periods (N, T, n), or ``None`` at the end."""


class Experiment:
    """Plays robots in a world at once; it keeps its simulation between calls."""

    def __init__(self, world: World, *, threads: int = 0, sim: VecSim | None = None) -> None:
        """Prepare for a world; 0 threads are one per processor.

        A simulation that is given should have as many robots as are played.
        """
        self.world, self._threads = world, threads
        self._steps = count_substeps(world.model, world.robot.control_period)
        self._recorder = Recorder(world)
        self._sim = sim
        if sim is not None:
            sim.bind(*RECORDED)

    def play(
        self,
        scenarios: Scenarios,
        source: Array | Sequence[Array] | FeedbackLaw,
        *,
        stop_early: bool = False,
        give_up: bool = False,
    ) -> Record:
        """Play N robots from rest; targets are sent one a control period.

        Args:
            scenarios: Where the robots start, and how they differ.
            source: Targets [rad], (T, n) of each, of which the last is held; or the feedback law
                that sends them.
            stop_early: Whether a robot is stopped once it is known whether it stands up.
            give_up: Whether all are stopped, too, once the first one is known to fail.
        """
        if callable(source):
            return self._track(self._begin(scenarios), source)
        if stop_early:
            return self._play_until_known(self._begin(scenarios), source, give_up=give_up)
        targets = _hold_all(source)
        pieces = (targets[:, first : first + LONG] for first in range(0, targets.shape[1], LONG))
        return join_records(list(self.play_pieces(scenarios, lambda: next(pieces, None))))

    def play_pieces(self, scenarios: Scenarios, source: PieceSource) -> Iterator[Record]:
        """Play N robots from rest as long as targets come; yield the record of each piece.

        Runs of policies are played so: their whole record would fill the memory.
        """
        rows = self._begin(scenarios)
        while (targets := source()) is not None:
            yield self._advance(rows, targets)[0]

    def compare(
        self, scenarios: Scenarios, motions: Sequence[Array], *, give_up: bool = False
    ) -> Outcome:
        """Play the targets of S motions, (T, n) each, in K scenarios until known; (S, K)."""
        count = len(scenarios.starts)
        sent = [motion for motion in motions for _ in range(count)]
        tiled = scenarios.tile(len(motions))
        record = self.play(tiled, sent, stop_early=True, give_up=give_up)
        return Outcome(record.reshape(len(motions), count), self.world.robot)

    def _begin(self, scenarios: Scenarios) -> Ids:
        """Place robots; return their rows."""
        count = len(scenarios.starts)
        sim, rows = self._prepare(count), np.arange(count)
        sim.set_parameters(rows, scenarios.parameters)
        sim.place(rows, scenarios.starts)
        return rows

    def _prepare(self, count: int) -> VecSim:
        """Return a simulation of at least that many robots."""
        if self._sim is None or self._sim.n < count:
            self._sim = VecSim(self.world, count, threads=self._threads)
            self._sim.bind(*RECORDED, "subtree_com", "xaxis", "xanchor")
        return self._sim

    def _advance(self, rows: Ids, targets: Array) -> tuple[Record, Array]:
        """Send targets (N, T, n) to some robots; return their record, and velocities (N, T, nv)."""
        assert self._sim is not None
        data = self._sim.advance(targets, self._steps, RECORDED, rows)
        return self._read(rows, data, targets, self._sim.diverged[rows]), data["qvel"]

    def _read(self, rows: Ids, data: Mapping[str, Array], sent: Array, diverged: Bools) -> Record:
        assert self._sim is not None
        voltage = self._sim.parameters.voltage[rows]
        return replace(self._recorder.read(data, voltage, diverged), target=sent)

    def _track(self, rows: Ids, law: FeedbackLaw) -> Record:
        """Play the targets of a feedback law until it ends."""
        sim = self._sim
        assert sim is not None
        eye, sent = _Eye(self.world, sim, len(rows)), []
        fields: dict[str, list[Array]] = {name: [] for name in RECORDED}
        diverged = np.zeros(len(rows), dtype=bool)
        while (target := law(eye.observe(len(sent)))) is not None:
            sim.hold(target, self._steps, rows)
            sent.append(target)
            diverged |= sim.diverged[rows]
            for name, samples in fields.items():
                samples.append(sim.read(name)[: len(rows)].copy())
        data = {name: np.stack(samples, axis=1) for name, samples in fields.items()}
        return self._read(rows, data, np.stack(sent, axis=1), diverged)

    def _play_until_known(
        self, rows: Ids, targets: Sequence[Array] | Array, *, give_up: bool
    ) -> Record:
        """Play targets (T, n) of each robot until its outcome is known."""
        assert self._sim is not None
        stop = EarlyStop(
            self.world.robot,
            np.array([len(target) for target in targets]),
            self._sim.parameters.voltage[rows],
        )
        parts: list[Record] = []
        while len(going := np.flatnonzero(stop.going)) and not (give_up and stop.failed[0]):
            sent = np.array([stop.cut(targets[int(i)]) for i in going])
            played, velocity = self._advance(going, sent)
            stop.add(going, played, np.abs(velocity).max(axis=(1, 2)))
            parts.append(played if len(going) == len(rows) else _fill(parts[-1], going, played))
        return replace(
            join_records(parts), cycles=stop.cycles, settled=stop.stood, failed=stop.failed
        )


def play(
    world: World,
    scenarios: Scenarios,
    source: Array | Sequence[Array] | FeedbackLaw,
    *,
    stop_early: bool = False,
) -> Record:
    """Play robots once, as :meth:`Experiment.play` does."""
    return Experiment(world).play(scenarios, source, stop_early=stop_early)


class _Eye:
    """Reads the input of a feedback law from a simulation."""

    def __init__(self, world: World, sim: VecSim, count: int) -> None:
        model, robot = world.model, world.robot
        self._sim, self._count = sim, count
        self._joints = robot.layout(model).qpos
        self._hinges = np.array([model.joint(name).id for name in robot.joint_names])
        sensors = [int(model.sensor(f"limb_{limb}").adr[0]) for limb in world.limbs]
        self._touches = np.array(sensors, dtype=int)
        self._points = self._touches[:, np.newaxis] + np.arange(1, 4)

    def observe(self, step: int) -> Feedback:
        """Observe the robots at the start of a control period."""
        contact = self._read("sensordata")
        return Feedback(
            step=step,
            joint_pos=self._read("qpos")[:, self._joints],
            com=self._read("subtree_com"),
            axis=self._read("xaxis")[:, self._hinges],
            anchor=self._read("xanchor")[:, self._hinges],
            limb_touch=contact[:, self._touches] > 0,
            limb_point=contact[:, self._points],
        )

    def _read(self, name: str) -> Array:
        """Return a field of all robots, which holds until the next step."""
        return self._sim.read(name)[: self._count]


def _hold_all(targets: Array | Sequence[Array]) -> Array:
    """Hold the last target of each robot (T, n) as long as the longest one, (N, T, n)."""
    if isinstance(targets, np.ndarray):
        return targets
    at = np.arange(max(len(target) for target in targets))
    return np.array([target[np.minimum(at, len(target) - 1)] for target in targets])


def _fill(before: Record, rows: Ids, played: Record) -> Record:
    """Add stopped robots to a chunk of others; they keep their last sample."""

    def fill(last: Array, new: Array) -> Array:
        filled = np.repeat(last[:, -1:], CHUNK, axis=1) if last.ndim > 1 else last.copy()
        filled[rows] = new
        return filled

    return combine_arrays([before, played], lambda arrays: fill(*arrays))
