"""Get up in worlds that no plan knows of: loads, slopes, a step, weak or late servos.

Each fall is planned once, in the nominal world; the plan is played open loop and with feedback, and
policies beside it. The robot lies with its head along +x: slopes rise towards it, the plate of a
step lies in a random direction, the load is on the back of the chest. Zeros are off by the same
angle at each joint, either way.

    python benchmarks/rise_disturbed.py --n 10 --seed 12 --json disturbed.json
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import mujoco
import numpy as np
import tyro
from disturbed_worlds import (
    DISTURBANCES,
    DisturbedRise,
    DisturbedWays,
    WeakTwin,
    WorldChange,
)
from script import (
    RISE_FIGURES,
    LimitedOptions,
    RefusableRise,
    RefusableSummary,
    do_pieces,
    write_results,
)

from drivers import Command, State, Twin
from humanoid_getup.benchmarks.rise import BENCH_CLASSES
from humanoid_getup.experiments.falls import Fall, sample_falls
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.scenes.ground import Slope
from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import make_strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot, quaternion
from robots.quaternion import Array

# Where a load is strapped on, in the torso's frame, as shares of the neck's height there: on OP3
# 82 mm behind and above the origin, on the back of the chest.
BACK = np.array([-0.6, 0.0, 0.6])
LOAD_SIZE = 0.02  # m, half an edge of the cube whose inertia the load has
PLATE = 2.0  # m, half an edge of the plate whose edge is a step


@dataclass(frozen=True, kw_only=True)
class DisturbedOptions(LimitedOptions):
    """Options of this script."""

    n: int = 20
    """Falls of each class: supine, prone, lateral."""
    policies: tuple[str, ...] = ("robust",)
    """Policies beside the plans, by name or file."""
    cases: tuple[str, ...] = ()
    """Disturbances by their names in the table; default: all."""


@dataclass(frozen=True, kw_only=True)
class OtherChange(WorldChange):
    """A change of the robot, its supply, or of flat ground."""

    load: float = 0.0
    """Mass on the torso's back [kg]; it has no shape of its own."""
    hand: str | None = None
    """Site that the load is at instead."""
    step: float = 0.0
    """Height of a plate under one half of the robot [m]; its edge goes through the hips."""
    com_shift: float = 0.0
    """Shift of the torso's center of mass at a right angle to the spine [m]."""
    voltage: float | None = None
    """Supply [V]."""
    resistance: float | None = None
    """Of battery and wires [Ω]; None for that of the robot."""
    joint: str | None = None
    """The weak servo; None for a random one."""
    dry_friction: float = 1.0
    """Factor on the dry friction of every joint."""
    gain: float = 1.0
    """Factor on the position gain of every servo."""
    delay: float = 0.0
    """Of all targets [s]."""
    zeros: float = 0.0
    """Error of each joint's zero [rad], of a random sign."""

    def disturb(self, world: World, fall: Fall, seed: list[int]) -> DisturbedRise:
        """Disturb a world and a fall."""
        found, robot = super().disturb(world, fall, seed), world.robot
        strength = found.strength
        if self.joint is not None:
            strength = np.where(np.array(robot.joint_names) == self.joint, self.strength, 1.0)
        signs = np.random.default_rng(seed).choice([-1.0, 1.0], robot.n)
        return OtherRise(
            world=found.world,
            start=found.start,
            strength=strength,
            voltage=self.voltage,
            gain=self.gain,
            late_cycles=round(self.delay / robot.control_period),
            zeros=self.zeros * signs,
        )

    def build_world(self, world: World, direction: float) -> World:
        """Build a world with a load, a step, another center of mass, friction or supply."""
        toward = np.array([math.cos(direction), math.sin(direction), 0.0])
        up = np.array([0.0, 0.0, 0.5 * self.step])
        plate = (
            Obstacle(
                name="step",
                kind="box",
                half_size=np.array([PLATE, PLATE, 0.5 * self.step]),
                position=PLATE * toward + up,
                orientation=quaternion.from_yaw(direction),
                surface=world.scene.surface,
            )
            if self.step
            else None
        )
        scene = SceneWithLoad(
            name=f"{world.scene.name}, disturbed",
            ground=Slope(angle=0.0),
            surface=world.scene.surface,
            obstacles=(plate,) if plate else (),
            load=self.load,
            hand=self.hand,
        )
        robot = world.robot
        if self.resistance is not None:
            robot = replace(robot, supply_resistance=self.resistance)
        disturbed = World(robot, scene)
        model = disturbed.model
        model.body_mass *= self.mass
        model.body_inertia *= self.mass
        model.dof_frictionloss *= self.dry_friction
        model.body_ipos[model.body(world.robot.torso).id] += self.com_shift * toward
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return disturbed

    def lay(self, world: World, start: Posture, rng: np.random.Generator) -> Posture:
        """Lay a robot on the plate."""
        laid = super().lay(world, start, rng)
        return replace(laid, position=laid.position + np.array([0.0, 0.0, self.step]))


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneWithLoad(Scene):
    """A scene, with a load on the robot's back or at a site."""

    load: float = 0.0
    hand: str | None = None

    def build(self, robot: Robot) -> mujoco.MjSpec:
        """Add this scene to the robot's model."""
        spec = super().build(robot)
        if self.load:
            site = spec.site(self.hand) if self.hand else None
            load = (site.parent if site else spec.body(robot.torso)).add_body(name="load")
            load.pos = site.pos if site else float(spec.site(robot.neck_site).pos[2]) * BACK
            load.ipos = np.zeros(3)  # MuJoCo's own would be pos
            load.mass = self.load
            load.inertia = np.full(3, self.load * (2.0 * LOAD_SIZE) ** 2 / 6.0)
            load.explicitinertial = True
        return spec


@dataclass(frozen=True, kw_only=True)
class OtherRise(DisturbedRise):
    """One robot in one disturbed world, with other servos."""

    gain: float
    late_cycles: int
    zeros: Array
    """Measured minus true angle of each joint [rad], (n,)."""

    def make_twin(self) -> Twin:
        """Make the twin that is to rise."""
        return OtherTwin(self)


class OtherTwin(WeakTwin):
    """A twin with other gains, whose targets come late, and whose zeros are off."""

    def __init__(self, rise: OtherRise) -> None:
        """Build the twin of a disturbed rise."""
        super().__init__(rise.world, rise.start, rise.strength, rise.voltage)
        self._gain, self._zeros = rise.gain, rise.zeros
        self._waiting = [Command.limp(self.robot.n)] * rise.late_cycles

    def read(self) -> State:
        """Measure the robot, with the wrong zeros."""
        state = super().read()
        return replace(state, joint_pos=state.joint_pos + self._zeros)

    def write(self, command: Command) -> Command:
        """Send a command; the one of some cycles ago is applied for one period."""
        self._waiting.append(command)
        due = self._waiting.pop(0)
        super().write(
            replace(
                due,
                joint_pos=due.joint_pos - self._zeros,
                gain_scale=self._gain * due.gain_scale,
            )
        )
        limit = np.minimum(command.torque_limit, self.robot.max_torque)
        return replace(command, torque_limit=limit)


CHANGES = DISTURBANCES | {
    "slope -5 deg": WorldChange(slope=math.radians(-5.0)),
    "mass -10 %": WorldChange(mass=0.9),
    "300 g on the back": OtherChange(load=0.3),
    "step of 2 cm": OtherChange(step=0.02),
    "left shoulder limp": OtherChange(strength=0.0, joint="l_sho_pitch"),
    "center of mass 5 mm off": OtherChange(com_shift=0.005),
    "supply 11.0 V": OtherChange(voltage=11.0),
    "supply 12.6 V": OtherChange(voltage=12.6),
    "targets 32 ms late": OtherChange(delay=0.032),
    "zeros 3 deg off": OtherChange(zeros=math.radians(3.0)),
    "dry friction x3": OtherChange(dry_friction=3.0),
    "gain x0.6": OtherChange(gain=0.6),
    "200 g in a hand": OtherChange(load=0.2, hand="l_hand"),
    "supply 11.1 V, 0.1 ohm": OtherChange(voltage=11.1, resistance=0.1),
    "supply 11.1 V, 0.15 ohm": OtherChange(voltage=11.1, resistance=0.15),
}
"""The disturbances, by their names in the table."""


def main(options: DisturbedOptions) -> None:
    """Measure, and write the figures of every way in every world."""
    world, ways = options.load_world(), make_ways(options)
    cases = options.cases or tuple(CHANGES)
    changes = {case: CHANGES[case] for case in cases}
    rng = np.random.default_rng(options.seed)
    falls = sample_falls(world, dict.fromkeys(BENCH_CLASSES, options.n), rng)
    groups = do_pieces(partial(rise_from, options, changes), [*enumerate(falls)], options)
    rises = [rise for group in groups for rise in group]
    table = RefusableSummary.table(rises, cases, ways.names)
    result = options.describe("disturbed", len(falls)) | {"cases": table, "rises": rises}
    write_results(result, (*RISE_FIGURES, "refused", "head_impact_m_s"), options.json)


def rise_from(
    options: DisturbedOptions, changes: dict[str, WorldChange], piece: tuple[int, Fall]
) -> list[RefusableRise]:
    """Rise from a fall, by its number, in every world and way."""
    number, fall = piece
    return make_ways(options).measure(fall, number, options.seed, changes)


@lru_cache(maxsize=1)
def make_ways(options: DisturbedOptions) -> DisturbedWays:
    """Make planner and policies."""
    world = options.load_world()
    limit = options.make_limit(world.robot)
    settings = PlannerSettings(torque_limit=limit, threads=options.threads)
    database = load_database(world.robot)
    return DisturbedWays(
        planner=PlannedRise(world, database, settings),
        policies={name: make_strategy(world, name, settings) for name in options.policies},
    )


if __name__ == "__main__":
    main(tyro.cli(DisturbedOptions, description=__doc__))
