"""All that can be wrong between a robot.toml and the model it names."""

import mujoco
import numpy as np

from robots.schema import Description
from robots.validation import outside, shown

FREE, HINGE = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_HINGE
KINDS = {0: "free", 1: "ball", 2: "slide", 3: "hinge"}


def find_model_faults(description: Description, model: mujoco.MjModel) -> list[str]:
    """Find where a description and its compiled model do not fit together."""
    return [
        *_torso_faults(description, model),
        *_site_faults(description, model),
        *_joint_faults(description, model),
        *_undescribed_faults(description, model),
        *_standing_faults(description, model),
        *_actuator_faults(description, model),
    ]


def _torso_faults(description: Description, model: mujoco.MjModel) -> list[str]:
    if not description.torso:
        return []
    torso = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, description.torso)
    if torso < 0:
        is_free = np.isin(np.arange(model.nbody), model.jnt_bodyid[model.jnt_type == FREE])
        bodies = _names(model, mujoco.mjtObj.mjOBJ_BODY, model.nbody, is_free)
        return [f"torso: unknown body {shown(description.torso)}, allowed {bodies}"]
    joint = model.body_jntadr[torso]
    if joint < 0 or model.jnt_type[joint] != FREE:
        return [
            f"torso: body {shown(description.torso)} has no free joint in {description.model}, "
            "allowed a body with <freejoint/>"
        ]
    return []


def _site_faults(description: Description, model: mujoco.MjModel) -> list[str]:
    wanted = [("neck_site", description.neck_site), ("imu_site", description.imu_site)]
    wanted += [("sole_sites", site) for site in description.sole_sites]
    sites = _names(model, mujoco.mjtObj.mjOBJ_SITE, model.nsite)
    return [
        f"{key}: unknown site {shown(site)}, allowed {sites}"
        for key, site in wanted
        if site and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, site) < 0
    ]


def _joint_faults(description: Description, model: mujoco.MjModel) -> list[str]:
    faults = []
    for name in dict.fromkeys(row.name for row in description.joints if row.name):
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        if joint < 0:
            hinges = _names(model, mujoco.mjtObj.mjOBJ_JOINT, model.njnt, model.jnt_type == HINGE)
            faults.append(f"joint {shown(name)} is not in {description.model}, allowed {hinges}")
        elif model.jnt_type[joint] != HINGE:
            kind = KINDS[int(model.jnt_type[joint])]
            faults.append(f"joint {shown(name)} is a {kind} joint, allowed a hinge")
        elif not model.jnt_limited[joint]:
            faults.append(
                f"joint {shown(name)} has no range in {description.model}, "
                "allowed a range from a lower to an upper angle"
            )
    return faults


def _undescribed_faults(description: Description, model: mujoco.MjModel) -> list[str]:
    """Find joints that would move without a servo; only the torso's free joint may."""
    described = {row.name for row in description.joints}
    torso = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, description.torso)
    faults = []
    for joint in range(model.njnt):
        view, body = model.joint(joint), model.body(model.jnt_bodyid[joint])
        if view.name in described:
            continue
        if model.jnt_type[joint] != FREE:
            faults.append(
                f"{KINDS[int(model.jnt_type[joint])]} joint {shown(view.name)} of body "
                f"{shown(body.name)} in {description.model} has no row in joints, allowed one each"
            )
        elif torso >= 0 and body.id != torso:
            faults.append(
                f"body {shown(body.name)} in {description.model} has a free joint, "
                f"allowed only for the torso {shown(description.torso)}"
            )
    return faults


def _standing_faults(description: Description, model: mujoco.MjModel) -> list[str]:
    names = list(dict.fromkeys(row.name for row in description.joints if row.name))
    faults = [
        f"standing: unknown joint {shown(name)}, allowed {', '.join(map(shown, names))}"
        for name in description.standing
        if name not in names
    ]
    for name in names:
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        if joint < 0 or model.jnt_type[joint] != HINGE or not model.jnt_limited[joint]:
            continue
        angle, (lower, upper) = description.standing.get(name, 0.0), model.jnt_range[joint]
        if not lower <= angle <= upper:
            why = "" if name in description.standing else " (not named, so 0)"
            told = outside(angle, lower, upper, "rad")
            faults.append(f"standing: joint {shown(name)}{why} is {told}")
    return faults


def _actuator_faults(description: Description, model: mujoco.MjModel) -> list[str]:
    if not model.nu:
        return []
    names = _names(model, mujoco.mjtObj.mjOBJ_ACTUATOR, model.nu)
    return [
        f"{description.model} has actuators ({names}), allowed none: "
        "the servos come from the rows of joints"
    ]


def _names(
    model: mujoco.MjModel, kind: mujoco.mjtObj, count: int, chosen: np.ndarray | None = None
) -> str:
    """List the names of the model's objects of a kind."""
    ids = range(count) if chosen is None else np.flatnonzero(chosen)
    names = [mujoco.mj_id2name(model, kind, int(i)) for i in ids]
    return ", ".join(name for name in names if name) or "none: it has none with a name"
