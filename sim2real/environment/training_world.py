"""The world of training: a robot in a scene, with all sensors of training, and its variants."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.world import World, add_contact_sensor, add_stance_sensors
from robots import Robot
from robots.body.parts import list_head_joints
from robots.kinematics import imu_in_torso

BACKLASH_ARMATURE = 1e-4  # kg·m² on the link's side, so that the hinge has an inertia
BACKLASH_DAMPING = 1e-3  # N·m·s/rad

ModelVariant = Callable[[mujoco.MjSpec, Robot], None]
"""Changes a model before it is compiled."""


def fine_steps(spec: mujoco.MjSpec, _robot: Robot) -> None:
    """Step physics by 1 ms."""
    spec.option.timestep = 0.001


def elliptic_cones(spec: mujoco.MjSpec, _robot: Robot) -> None:
    """Use elliptic friction cones, which have the same friction in every direction."""
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0


def other_solver(spec: mujoco.MjSpec, _robot: Robot) -> None:
    """Use the conjugate gradient solver with few iterations, and the implicit integrator."""
    spec.option.solver = mujoco.mjtSolver.mjSOL_CG
    spec.option.iterations = 20
    spec.option.ls_iterations = 10
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICIT


def soft_contacts(spec: mujoco.MjSpec, _robot: Robot) -> None:
    """Make contacts five times as soft as in the robots' models."""
    for geom in spec.geoms:
        geom.solref = [0.02, 1.0]


def backlash(angle: float) -> ModelVariant:
    """Add backlash, ``angle`` from end to end [rad], between every gear and its link.

    Each joint gets a second hinge that is free between two stops; the servo's encoder
    and motor are on the gear's side of it.
    """

    def change(spec: mujoco.MjSpec, robot: Robot) -> None:
        half = np.degrees(angle / 2) if spec.compiler.degree else angle / 2
        for name in robot.joint_names:
            joint = spec.joint(name)
            loose = joint.parent.add_joint(name=f"{name}_backlash", axis=list(joint.axis))
            loose.pos[:] = joint.pos
            loose.limited = True
            loose.range[:] = [-half, half]
            # MuJoCo's default stops yield by more than the backlash itself.
            loose.solref_limit[:] = [0.004, 1.0]
            loose.solimp_limit[:2] = [0.999, 0.999]
            loose.armature = BACKLASH_ARMATURE
            loose.damping[0] = BACKLASH_DAMPING

    return change


MODEL_VARIANTS: dict[str, ModelVariant] = {
    "1 ms steps": fine_steps,
    "elliptic cones": elliptic_cones,
    "other solver": other_solver,
    "soft contacts": soft_contacts,
}


WHOLE = 1e-9  # of a step, within which a quotient counts as whole
LONGEST_DELAY = 0.064  # s that the delay buffers hold


def build_training_world(
    robot: Robot,
    scene: Scene,
    timestep: float,
    longest_delay: float = 0.0,
    variants: Sequence[ModelVariant] = (),
) -> World:
    """Compile a robot in a scene with joint sensors, IMU, stance and head sensors.

    A control period must be a multiple of the physics step [s]; delay buffers hold targets and
    measurements for the longest delay [s].
    """
    spec = scene.build(robot)
    spec.option.timestep = timestep
    for vary in variants:
        vary(spec, robot)
    longest = longest_delay + robot.individual.delay
    samples = int(np.ceil(longest / spec.option.timestep - 1e-9))
    sensor, obj = mujoco.mjtSensor, mujoco.mjtObj
    for name in robot.joint_names:
        for kind, label in ((sensor.mjSENS_JOINTPOS, "pos"), (sensor.mjSENS_JOINTVEL, "vel")):
            spec.add_sensor(
                name=f"{label}_{name}", type=kind, objtype=obj.mjOBJ_JOINT, objname=name
            )
    imu = {"objtype": obj.mjOBJ_SITE, "objname": robot.require_imu_site()}
    spec.add_sensor(name="imu_gyro", type=sensor.mjSENS_GYRO, **imu)
    spec.add_sensor(name="imu_orientation", type=sensor.mjSENS_FRAMEQUAT, **imu)
    for element in (*spec.sensors, *spec.actuators):
        element.nsample = samples
    add_stance_sensors(spec, robot)
    for name in list_head_joints(robot)[-1:]:
        head = spec.joint(name).parent.name
        add_contact_sensor(spec, "head_contact", head, subtree=True)
        spec.add_sensor(
            name="head_velocity",
            type=sensor.mjSENS_FRAMELINVEL,
            objtype=obj.mjOBJ_BODY,
            objname=head,
        )
    return World(robot, scene, model=spec.compile())


def fit_step(longest: float, step_time: float) -> float:
    """Return the longest physics step up to ``longest`` that divides a policy step [s]."""
    count = step_time / longest
    return longest if abs(count - round(count)) < WHOLE else step_time / math.ceil(count)


class SensorAddresses:
    """Addresses of a training world's sensors in MuJoCo's sensor data."""

    def __init__(self, world: World) -> None:
        model, robot = world.model, world.robot

        def at(name: str) -> int:
            return int(model.sensor(name).adr[0])

        self.joint_pos = np.array([at(f"pos_{name}") for name in robot.joint_names])
        self.joint_vel = np.array([at(f"vel_{name}") for name in robot.joint_names])
        self.gyro = at("imu_gyro") + np.arange(3)
        self.orientation = at("imu_orientation") + np.arange(4)
        self.imu_in_torso = np.array(imu_in_torso(robot, model))
        has_head = bool(list_head_joints(robot))
        self.head_contact = at("head_contact") + np.arange(1) if has_head else np.arange(0)
        self.head_velocity = at("head_velocity") + np.arange(3) if has_head else np.arange(0)
        self.is_delayed = model.sensor_history[:, 0] > 0
