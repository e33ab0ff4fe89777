"""Robots that fit on a page, written by the test."""

from dataclasses import replace
from pathlib import Path

import mujoco

from robots import Robot, load_robot
from robots.body.parts import list_head_joints
from robots.description.servo_catalog import servo_models
from robots.individual import make_explicit
from robots.reshaping.stretching import Skeleton

ROW = (
    '  {{ name = "{name}", id = {id}, servo = "XM430-W350", sign = 1, zero_ticks = 2048, '
    'mirror = "{mirror}", mirror_sign = {sign}, segment = "{segment}" }},'
)


def write_robot(folder: Path, bodies: str, *, head: tuple[str, ...] = ()) -> Path:
    """Write a robot whose torso carries some bodies, with soles l_sole and r_sole.

    Joints l_NAME and r_NAME mirror each other with sign 1, all others themselves.
    """
    folder.mkdir(exist_ok=True)
    text = (
        '<mujoco><compiler angle="degree"/><worldbody><body name="torso"><freejoint name="root"/>'
        '<site name="imu"/><site name="neck" pos="0 0 0.2"/>'
        '<geom type="box" size="0.02 0.05 0.05" pos="0 0 0.1" mass="0.5"/>'
        f"{bodies}</body></worldbody></mujoco>"
    )
    (folder / "model.xml").write_text(text, "utf-8")
    model = mujoco.MjModel.from_xml_string(text)
    names = [model.joint(k).name for k in range(1, model.njnt)]
    swap = {"l_": "r_", "r_": "l_"}
    rows = [
        ROW.format(
            name=name,
            id=k + 1,
            mirror=swap.get(name[:2], name[:2]) + name[2:],
            sign=1 if name[:2] in swap else -1,
            segment="head" if name in head else "other",
        )
        for k, name in enumerate(names)
    ]
    toml = [
        'name = "small"',
        'model = "model.xml"',
        'torso = "torso"',
        'neck_site = "neck"',
        'imu_site = "imu"',
        'sole_sites = ["l_sole", "r_sole"]',
        "control_period = 0.008",
        "supply_voltage = 12.0",
        "joints = [",
        *rows,
        "]",
        "[standing]",
    ]
    (folder / "robot.toml").write_text("\n".join(toml) + "\n", "utf-8")
    return folder


def make_robot(folder: Path, bodies: str, *, head: tuple[str, ...] = ()) -> Robot:
    """Write and load such a robot."""
    return load_robot(write_robot(folder, bodies, head=head))


def build_skeleton(robot: Robot) -> Skeleton:
    """Build the skeleton of a robot, without servos."""
    spec = robot.read_model()
    make_explicit(spec)
    return Skeleton(
        spec,
        torso=robot.torso,
        sole_sites=robot.sole_sites,
        head_joints=list_head_joints(robot),
    )


def limb(name: str, at: str, axis: str = "0 1 0", inside: str = "") -> str:
    """Write a body that hangs down by a hinge for 10 cm."""
    return (
        f'<body name="{name}_link" pos="{at}"><joint name="{name}" axis="{axis}" range="-90 90"/>'
        f'<geom type="box" pos="0 0 -0.05" size="0.03 0.02 0.05" mass="0.1"/>{inside}</body>'
    )


def leg(side: str, at: str) -> str:
    """Write a leg with a hip and a knee, 20 cm long, its sole at the end."""
    sole = f'<site name="{side}_sole" pos="0 0 -0.1"/>'
    return limb(f"{side}_hip", at, inside=limb(f"{side}_knee", "0 0 -0.1", inside=sole))


LEGS = leg("l", "0 0.05 0") + leg("r", "0 -0.05 0")


def with_servos(robot: Robot, *changes: dict) -> Robot:
    """Change the servos of all joints alike, or of each its own."""
    each = changes if len(changes) > 1 else changes * robot.n
    pairs = zip(robot.joints, each, strict=True)
    joints = [replace(joint, servo=replace(joint.servo, **change)) for joint, change in pairs]
    return replace(robot, joints=tuple(joints))


def with_types(robot: Robot, *names: str) -> Robot:
    """Put servos of other types on a robot: of one, or of each joint's own."""
    return with_servos(robot, *({"model": servo_models()[name]} for name in names))
