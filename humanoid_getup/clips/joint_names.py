"""Names of a body's joints in capture systems and editors."""

from __future__ import annotations

from collections.abc import Collection, Mapping

# Of the left side; those of the right one follow.
LIMBS = {
    "hip": ("lfemur", "LeftUpLeg", "LeftHip", "LeftThigh", "lThigh", "LHipJoint", "L_Hip"),
    "knee": ("ltibia", "LeftLeg", "LeftKnee", "LeftShin", "LeftLowLeg", "lShin", "L_Knee"),
    "ankle": ("lfoot", "LeftFoot", "LeftAnkle", "lFoot", "L_Ankle"),
    "toes": ("ltoes", "LeftToeBase", "LeftToe", "lToe", "L_Toe", "L_Foot"),
    "shoulder": ("lhumerus", "LeftArm", "LeftUpArm", "LeftShoulder", "lShldr", "L_Shoulder"),
    "elbow": ("lradius", "LeftForeArm", "LeftLowArm", "LeftElbow", "lForeArm", "L_Elbow"),
    "wrist": ("lwrist", "LeftHand", "LeftWrist", "lHand", "L_Wrist"),
}
MIDDLE = {
    "neck": ("lowerneck", "Neck", "neck", "Neck1", "NeckBase"),
    "spine": ("upperback", "Spine1", "Spine", "Chest", "spine", "abdomen", "Spine_1"),
}
"""The spine is a joint above the pelvis, below the chest."""
FEET = ("foot", "toe", "ankle")
SIDES = ("left", "right")
MOST_LISTED = 40  # names in a message


def name_joint(what: str) -> tuple[str, ...]:
    """Return the known names of a joint, such as "left hip" or "neck"."""
    side, _, part = what.rpartition(" ")
    if side != "right":
        return LIMBS[part] if side else MIDDLE[part]
    return tuple(
        name.replace("Left", "Right")
        if "Left" in name
        else {"l": "r", "L": "R"}[name[0]] + name[1:]
        for name in LIMBS[part]
    )


OTHER_SIDE = {
    own: other
    for part in LIMBS
    for sides in (SIDES, SIDES[::-1])
    for own, other in zip(*(name_joint(f"{side} {part}") for side in sides), strict=True)
}
"""The joint of the other side of one of a limb."""


def is_foot(name: str) -> bool:
    """Tell whether a joint is one of a foot, by its name."""
    return any(part in name.lower() for part in FEET)


def list_names(names: Collection[str]) -> str:
    """List joints in a message, without ends of limbs."""
    own = [name for name in names if " end" not in name]
    return ", ".join(own[:MOST_LISTED]) + " ..." * (len(own) > MOST_LISTED)


def parse_renames(text: str) -> dict[str, str]:
    """Parse the names of joints and their new names, as FROM=TO,FROM=TO."""
    pairs = [part.rpartition("=") for part in text.split(",")]
    if not all(old and new for old, _, new in pairs):
        raise ValueError(f"rename is {text}, expected FROM=TO,...")
    return {old: new for old, _, new in pairs}


def rename_joints(names: Collection[str], renames: Mapping[str, str]) -> dict[str, str]:
    """Return the joint of each new name: the one given, else its own without what all begin with.

    Left out are a namespace (``mixamorig:``), and what all names below the root begin with up to
    an underscore (``Character1_``).
    """
    local = [name.rpartition(":")[2] for name in names]
    if len({*local}) < len(local):  # of two bodies
        local = [*names]
    begin = local[-1].partition("_")[0] + "_"
    if not all(name.startswith(begin) for name in local[1:]):
        begin = ""
    short = {old: new.removeprefix(begin) for old, new in zip(names, local, strict=True)}
    unknown = [old for old in renames if old not in short and old not in short.values()]
    if unknown:
        raise ValueError(f"it has no joint '{unknown[0]}' to rename, but {list_names(names)}")
    given = {renames.get(old) or renames.get(new): old for old, new in short.items()}
    given.pop(None, None)
    kept = {new: old for old, new in short.items() if old not in given.values()}
    return kept | {new: old for new, old in given.items() if new}
