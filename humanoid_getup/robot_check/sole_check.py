"""Soles: are their sites on the faces on which the robot stands?"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from humanoid_getup.robot_check.finding import Finding
from robots import Robot
from robots.body.shapes import read_shapes
from robots.quaternion import Array

NEAR = 0.002  # m; a site this near to the face is on it
LEVEL = np.radians(2.0)
FLAT = 0.3  # share of a sole's outline from which a face of it is the one to stand on
STEEP = np.cos(np.radians(50.0))


def check_soles(robot: Robot) -> Iterator[Finding]:
    """Find sole sites that are not on the lowest faces of the feet."""
    model = robot.spec().compile()
    found = [finding for site in robot.sole_sites for finding in _check_sole(model, site)]
    yield from found
    if not found:
        sites = " and ".join(f"'{site}'" for site in robot.sole_sites)
        yield Finding(level="ok", subject="soles", text=f"{sites} are on the faces of the feet")


def _check_sole(model: mujoco.MjModel, site: str) -> Iterator[Finding]:
    subject, points = f"site '{site}'", list_sole_points(model, site)
    if not len(points):
        yield Finding(
            level="fault",
            subject=subject,
            text="is on a foot without shapes, expected some to stand on",
            remedy="give the foot a box or a capsule in the model",
        )
        return
    tilt, above = _measure_tilt(points), -float(points[:, 2].min())
    if tilt > LEVEL:
        yield Finding(
            level="fault",
            subject=subject,
            text=f"is tilted by {np.degrees(tilt):.0f}° against the face of the foot",
            remedy="turn it in the model until its z axis is normal to the face",
        )
    elif abs(above) > NEAR:
        where = "above" if above > 0.0 else "below"
        yield Finding(
            level="warning",
            subject=subject,
            text=f"is {1e3 * abs(above):.0f} mm {where} the lowest point of the foot",
            remedy="put it on the face on which the foot stands",
        )


def list_sole_points(model: mujoco.MjModel, site: str) -> Array:
    """List points that span the shapes of the foot that a site is on, in its frame, (p, 3) [m]."""
    number = model.site(site).id
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    foot = model.body_weldid[model.site_bodyid[number]]
    points = [
        data.xpos[body] + shape.sample() @ data.xmat[body].reshape(3, 3).T
        for body in np.flatnonzero(model.body_weldid == foot)
        for shape in read_shapes(model, int(body), keep_hulls=True)
    ]
    axes = data.site_xmat[number].reshape(3, 3)
    return (np.concatenate([np.zeros((0, 3)), *points]) - data.site_xpos[number]) @ axes


def _measure_tilt(points: Array) -> float:
    """Measure the angle between a site and the largest face of its foot that looks down [rad].

    It is 0 for a round foot, which has no such face.
    """
    try:
        hull, outline = ConvexHull(points), ConvexHull(points[:, :2]).volume
    except QhullError:
        return 0.0
    corners = points[hull.simplices]  # (f, 3, 3)
    edges = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2.0
    normals, of = np.unique(hull.equations[:, :3].round(3), axis=0, return_inverse=True)
    areas = np.bincount(of.ravel(), weights=area) * (normals[:, 2] < -STEEP)
    largest = int(np.argmax(areas))
    if areas[largest] < FLAT * outline:
        return 0.0
    return float(np.arccos(np.clip(-normals[largest, 2], -1.0, 1.0)))
