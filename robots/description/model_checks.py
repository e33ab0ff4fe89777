"""Checks of a robot.toml against the model that it names."""

from collections.abc import Iterable, Iterator

import mujoco
import numpy as np

from robots.description.schema import RobotTable
from robots.storage.validation import outside, shown

FREE, HINGE = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_HINGE
OBJECT = mujoco.mjtObj
NUMBERS = {
    (OBJECT.mjOBJ_BODY, "body"): ("mass", "inertia", "pos", "quat", "ipos", "iquat"),
    (OBJECT.mjOBJ_JOINT, "jnt"): ("range", "axis", "pos", "actfrcrange"),
    (OBJECT.mjOBJ_GEOM, "geom"): ("size", "pos", "quat", "friction"),
    (OBJECT.mjOBJ_SITE, "site"): ("pos", "quat"),
    (OBJECT.mjOBJ_ACTUATOR, "actuator"): ("gear", "forcerange", "ctrlrange", "gainprm", "biasprm"),
    (OBJECT.mjOBJ_KEY, "key"): ("qpos",),
}
"""Arrays of a model to check, by the kind of its objects."""
JOINT_KINDS = {0: "free", 1: "ball", 2: "slide", 3: "hinge"}


def find_number_problems(model: mujoco.MjModel) -> Iterator[str]:
    """Find numbers of a compiled model that are not finite: MuJoCo accepts nan."""
    for (kind, prefix), keys in NUMBERS.items():
        for key in keys:
            rows = getattr(model, f"{prefix}_{key}")
            wrong = ~np.isfinite(rows).reshape(len(rows), rows.size // max(len(rows), 1))
            for row in np.flatnonzero(wrong.any(axis=1)):
                name = mujoco.mj_id2name(model, kind, int(row)) or f"number {row}"
                owner = f"{kind.name.removeprefix('mjOBJ_').lower()} {shown(name)}"
                yield f"{owner} has a {key} of {rows[row]}, expected finite numbers"


def find_model_problems(table: RobotTable, model: mujoco.MjModel) -> list[str]:
    """Find contradictions between a description and its compiled model."""
    return [
        *find_number_problems(model),
        *_torso_problems(table, model),
        *_site_problems(table, model),
        *_joint_problems(table, model),
        *_passive_problems(table, model),
        *_undescribed_problems(table, model),
        *_standing_problems(table, model),
        *_actuator_problems(table, model),
    ]


def _torso_problems(table: RobotTable, model: mujoco.MjModel) -> list[str]:
    if not table.torso:
        return []
    torso = mujoco.mj_name2id(model, OBJECT.mjOBJ_BODY, table.torso)
    if torso < 0:
        bodies = _names(model, OBJECT.mjOBJ_BODY, model.jnt_bodyid[model.jnt_type == FREE])
        return [f"torso: unknown body {shown(table.torso)}, expected {bodies}"]
    joint = model.body_jntadr[torso]
    if joint < 0 or model.jnt_type[joint] != FREE:
        return [
            f"torso: body {shown(table.torso)} has no free joint in {table.model}, "
            "expected a body with <freejoint/>"
        ]
    return []


def _site_problems(table: RobotTable, model: mujoco.MjModel) -> list[str]:
    wanted = [("neck_site", table.neck_site), ("imu_site", table.imu_site)]
    wanted += [("sole_sites", site) for site in table.sole_sites]
    sites = _names(model, OBJECT.mjOBJ_SITE, range(model.nsite))
    return [
        f"{key}: unknown site {shown(site)}, expected {sites}"
        for key, site in wanted
        if site and mujoco.mj_name2id(model, OBJECT.mjOBJ_SITE, site) < 0
    ]


def _joint_problems(table: RobotTable, model: mujoco.MjModel) -> Iterator[str]:
    for name in dict.fromkeys(row.name for row in table.joints if row.name):
        joint = mujoco.mj_name2id(model, OBJECT.mjOBJ_JOINT, name)
        if joint < 0:
            ids = np.flatnonzero(model.jnt_type == HINGE)
            hinges = _names(model, OBJECT.mjOBJ_JOINT, ids)
            yield f"joint {shown(name)} is not in {table.model}, expected {hinges}"
        elif model.jnt_type[joint] != HINGE:
            kind = JOINT_KINDS[int(model.jnt_type[joint])]
            yield f"joint {shown(name)} is a {kind} joint, expected a hinge"
        elif not model.jnt_limited[joint]:
            yield (
                f"joint {shown(name)} has no range in {table.model}, "
                "expected a range from a lower to an upper angle"
            )


def _passive_problems(table: RobotTable, model: mujoco.MjModel) -> Iterator[str]:
    """Find passive joints that are not hinges of the model, or that have a servo."""
    described = {row.name for row in table.joints}
    for name in table.passive_joints:
        joint = mujoco.mj_name2id(model, OBJECT.mjOBJ_JOINT, name)
        if name in described:
            yield f"passive_joints: {shown(name)} has a row in joints, expected none"
        elif joint < 0:
            yield f"passive_joints: {shown(name)} is not in {table.model}"
        elif model.jnt_type[joint] != HINGE:
            kind = JOINT_KINDS[int(model.jnt_type[joint])]
            yield f"passive_joints: {shown(name)} is a {kind} joint, expected a hinge"


def _undescribed_problems(table: RobotTable, model: mujoco.MjModel) -> Iterator[str]:
    """Find joints that would move without a servo, and are neither passive nor the torso's."""
    described = {row.name for row in table.joints} | set(table.passive_joints)
    torso = mujoco.mj_name2id(model, OBJECT.mjOBJ_BODY, table.torso)
    for joint in range(model.njnt):
        view, body = model.joint(joint), model.body(model.jnt_bodyid[joint])
        if view.name in described:
            continue
        if model.jnt_type[joint] != FREE:
            yield (
                f"{JOINT_KINDS[int(model.jnt_type[joint])]} joint {shown(view.name)} of body "
                f"{shown(body.name)} in {table.model} has no row in joints, expected one each, "
                "or its name in passive_joints if it has no servo"
            )
        elif torso >= 0 and body.id != torso:
            yield (
                f"body {shown(body.name)} in {table.model} has a free joint, "
                f"expected only for the torso {shown(table.torso)}"
            )


def _standing_problems(table: RobotTable, model: mujoco.MjModel) -> list[str]:
    names = list(dict.fromkeys(row.name for row in table.joints if row.name))
    problems = [
        f"standing: unknown joint {shown(name)}, expected {', '.join(map(shown, names))}"
        for name in table.standing
        if name not in names
    ]
    for name in names:
        joint = mujoco.mj_name2id(model, OBJECT.mjOBJ_JOINT, name)
        if joint < 0 or model.jnt_type[joint] != HINGE or not model.jnt_limited[joint]:
            continue
        angle, (lower, upper) = table.standing.get(name, 0.0), model.jnt_range[joint]
        if angle < lower or angle > upper:  # nan has been reported
            why = "" if name in table.standing else " (not named, so 0)"
            found = outside(angle, lower, upper, "rad")
            problems.append(f"standing: joint {shown(name)}{why} is {found}")
    return problems


def _actuator_problems(table: RobotTable, model: mujoco.MjModel) -> list[str]:
    if not model.nu:
        return []
    names = _names(model, OBJECT.mjOBJ_ACTUATOR, range(model.nu))
    return [
        f"{table.model} has actuators ({names}), expected none: "
        "the servos come from the rows of joints"
    ]


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj, ids: Iterable[int]) -> str:
    names = [mujoco.mj_id2name(model, kind, int(i)) for i in ids]
    return ", ".join(name for name in names if name) or "none: it has none with a name"
