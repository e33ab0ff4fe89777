"""The body: are its masses those of a robot, and its sites where they should be?"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from humanoid_getup.robot_check.finding import Finding
from robots.body.limb import ARMS
from robots.body.limbs import Limbs

DENSITY = (5.0, 300.0)
"""Mass over the neck height cubed [kg/m³]; OP3 has 46, a person of 70 kg about 25."""
LIGHTEST = 1e-4  # share of the robot's mass; a lighter link was given none
WIDEST = 0.5  # radius of gyration of a link over the neck height; placeholders are wider
FARTHEST_IMU = 0.5  # from the torso's center of mass, over the neck height


def check_body(limbs: Limbs) -> Iterator[Finding]:
    """Find masses, inertias and sites that no such robot has."""
    found = [*_check_mass(limbs), *_check_links(limbs), *_check_imu(limbs), *_check_neck(limbs)]
    yield from found
    if not found:
        mass, height = _measure_mass(limbs), limbs.robot.standing_neck_height
        text = f"{limbs.robot.n} joints, {mass:.2f} kg, neck at {height:.2f} m"
        yield Finding(level="ok", subject="body", text=text)


def _measure_mass(limbs: Limbs) -> float:
    return float(limbs.model.body_subtreemass[limbs.model.body(limbs.robot.torso).id])


def _check_mass(limbs: Limbs) -> Iterator[Finding]:
    robot, mass = limbs.robot, _measure_mass(limbs)
    servos = sum(joint.servo.model.mass for joint in robot.joints)
    least, most = (density * robot.standing_neck_height**3 for density in DENSITY)
    if mass < servos:
        yield Finding(
            level="warning",
            subject="body",
            text=f"weighs {mass:.2f} kg, less than its {robot.n} servos, {servos:.2f} kg",
            remedy="give the bodies in the model their masses",
        )
    elif not least <= mass <= most:
        yield Finding(
            level="warning",
            subject="body",
            text=f"weighs {mass:.3g} kg with its neck at {robot.standing_neck_height:.2f} m, "
            f"expected {least:.2g} to {most:.2g} kg",
            remedy="check the units of lengths and masses in the model",
        )


def _check_links(limbs: Limbs) -> Iterator[Finding]:
    """Compare mass and inertia of each moving link; what is welded to it is part of it."""
    model, height = limbs.model, limbs.robot.standing_neck_height
    total = _measure_mass(limbs)
    for link in np.setdiff1d(model.body_weldid, [0]):
        bodies = np.flatnonzero(model.body_weldid == link)
        mass = float(model.body_mass[bodies].sum())
        subject = f"body '{_name(model, int(link))}'"
        wide = max(_measure_gyration(model, int(body)) for body in bodies)
        if mass < LIGHTEST * total:
            yield Finding(
                level="warning",
                subject=subject,
                text=f"weighs {1e3 * mass:.2g} g, expected at least {1e3 * LIGHTEST * total:.2g} g",
                remedy="give it its mass, or weld it to its parent",
            )
        elif wide > WIDEST * height:
            yield Finding(
                level="warning",
                subject=subject,
                text=f"has the inertia of something of {wide:.2f} m radius, expected at most "
                f"{WIDEST * height:.2f} m",
                remedy="give it its own inertia: this one looks like a placeholder",
            )


def _measure_gyration(model: mujoco.MjModel, body: int) -> float:
    mass = float(model.body_mass[body])
    return float(np.sqrt(model.body_inertia[body].max() / mass)) if mass > 0.0 else 0.0


def _check_imu(limbs: Limbs) -> Iterator[Finding]:
    robot, model = limbs.robot, limbs.model
    site, torso = model.site(robot.imu_site), model.body(robot.torso).id
    if int(site.bodyid[0]) != torso:
        yield Finding(
            level="fault",
            subject=f"site '{robot.imu_site}'",
            text=f"is on body '{_name(model, int(site.bodyid[0]))}', expected '{robot.torso}'",
            remedy="put the IMU's site into the torso's body in the model",
        )
        return
    away = float(np.linalg.norm(site.pos - model.body_ipos[torso]))
    most = FARTHEST_IMU * robot.standing_neck_height
    if away > most:
        yield Finding(
            level="warning",
            subject=f"site '{robot.imu_site}'",
            text=f"is {away:.2f} m from the torso's center of mass, expected at most {most:.2f} m",
            remedy="put it where the IMU is",
        )


def _check_neck(limbs: Limbs) -> Iterator[Finding]:
    robot = limbs.robot
    limbs.look(robot.standing.joint_pos)
    shoulders = [limbs.anchor(limbs.all[a].joints[0])[2] for a in ARMS if a in limbs.all]
    neck = limbs.data.site_xpos[limbs.model.site(robot.neck_site).id, 2]
    below = max(shoulders, default=neck) - neck
    if below > 0.0:
        yield Finding(
            level="warning",
            subject=f"site '{robot.neck_site}'",
            text=f"is {1e3 * below:.0f} mm below the shoulders, expected above them",
            remedy="put it at the neck's base: its height tells whether the robot stands",
        )


def _name(model: mujoco.MjModel, body: int) -> str:
    return model.body(body).name or f"number {body}"
