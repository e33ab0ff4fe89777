"""The links and joints of the generic humanoid, of one side where there are two."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HumanoidHinge:
    """A joint, of the left side if there are two."""

    name: str
    axis: str
    lower: float
    """[deg]"""
    upper: float
    """[deg]"""
    least: int = 20
    """Robots with fewer joints are stiff here."""
    segment: str = "other"


@dataclass(frozen=True)
class HumanoidLink:
    """A body of one box or capsule, of the left side if there are two; frames as OP3's."""

    name: str
    parent: str
    at: tuple[float, float, float]
    """Origin in the parent [m]."""
    center: tuple[float, float, float]
    """Of the box, or of the capsule [m]."""
    half_size: tuple[float, ...]
    """Of the box; or radius and half length of the capsule, which is upright [m]."""
    hinges: tuple[HumanoidHinge, ...] = ()
    is_paired: bool = False


LINKS = (
    HumanoidLink("pelvis", "", (0, 0, 0), (0, 0, 0.01), (0.04, 0.055, 0.02)),
    HumanoidLink(
        "waist",
        "pelvis",
        (0, 0, 0.035),
        (0, 0, 0.02),
        (0.03, 0.04, 0.012),
        (
            HumanoidHinge("waist_yaw", "z", -90, 90, 30),
            HumanoidHinge("waist_roll", "x", -30, 30, 30),
            HumanoidHinge("waist_pitch", "y", -20, 60, 30),
        ),
    ),
    HumanoidLink(
        "chest",
        "waist",
        (0, 0, 0.04),
        (0, 0, 0.05),
        (0.045, 0.06, 0.042),
        (
            HumanoidHinge("chest_yaw", "z", -45, 45, 49),
            HumanoidHinge("chest_roll", "x", -20, 20, 49),
            HumanoidHinge("chest_pitch", "y", -15, 30, 49),
        ),
    ),
    HumanoidLink(
        "head",
        "chest",
        (0, 0, 0.1),
        (0, 0, 0.045),
        (0.032, 0.01),
        (
            HumanoidHinge("neck_yaw", "z", -90, 90, segment="head"),
            HumanoidHinge("neck_pitch", "y", -40, 60, segment="head"),
            HumanoidHinge("neck_roll", "x", -30, 30, 30, "head"),
        ),
    ),
    HumanoidLink(
        "upper_arm",
        "chest",
        (0, 0.083, 0.08),
        (0, 0, -0.05),
        (0.018, 0.04),
        (HumanoidHinge("sho_pitch", "y", -180, 90), HumanoidHinge("sho_roll", "x", -5, 150)),
        is_paired=True,
    ),
    HumanoidLink(
        "forearm",
        "upper_arm",
        (0, 0, -0.11),
        (0, 0, -0.04),
        (0.016, 0.03),
        (HumanoidHinge("elbow", "y", -140, 0),),
        is_paired=True,
    ),
    HumanoidLink(
        "hand",
        "forearm",
        (0, 0, -0.085),
        (0, 0, -0.025),
        (0.022, 0.009, 0.02),
        (
            HumanoidHinge("wrist_yaw", "z", -90, 90, 30, "wrist"),
            HumanoidHinge("wrist_roll", "x", -30, 30, 30, "wrist"),
            HumanoidHinge("wrist_pitch", "y", -60, 60, 30, "wrist"),
        ),
        is_paired=True,
    ),
    HumanoidLink(
        "thumb",
        "hand",
        (0.032, 0, -0.012),
        (0, 0, -0.01),
        (0.005, 0.006),
        (
            HumanoidHinge("thumb_roll", "x", -40, 40, 49, "thumb"),
            HumanoidHinge("thumb_pitch", "y", -60, 0, 49, "thumb"),
        ),
        is_paired=True,
    ),
    HumanoidLink(
        "thumb_tip",
        "thumb",
        (0, 0, -0.022),
        (0, 0, -0.008),
        (0.005, 0.004),
        (HumanoidHinge("thumb_bend", "x", -60, 0, 49, "thumb"),),
        is_paired=True,
    ),
    *(
        HumanoidLink(
            finger,
            "hand",
            (x, 0, -0.048),
            (0, 0, -0.014),
            (0.0045, 0.01),
            (HumanoidHinge(f"{finger}_bend", "x", -80, 0, 49, "finger"),),
            is_paired=True,
        )
        for finger, x in (("index", 0.018), ("middle", 0.006), ("ring", -0.006), ("little", -0.018))
    ),
    HumanoidLink(
        "thigh",
        "pelvis",
        (0, 0.045, -0.03),
        (0, 0, -0.055),
        (0.026, 0.03),
        (
            HumanoidHinge("hip_yaw", "z", -60, 60),
            HumanoidHinge("hip_roll", "x", -20, 50),
            HumanoidHinge("hip_pitch", "y", -120, 30),
        ),
        is_paired=True,
    ),
    HumanoidLink(
        "shank",
        "thigh",
        (0, 0, -0.11),
        (0, 0, -0.055),
        (0.022, 0.03),
        (HumanoidHinge("knee", "y", 0, 140),),
        is_paired=True,
    ),
    HumanoidLink(
        "foot",
        "shank",
        (0, 0, -0.11),
        (0.005, 0, -0.02),
        (0.045, 0.03, 0.012),
        (
            HumanoidHinge("ankle_pitch", "y", -60, 60, segment="foot"),
            HumanoidHinge("ankle_roll", "x", -40, 40, segment="foot"),
        ),
        is_paired=True,
    ),
    HumanoidLink(
        "toes",
        "foot",
        (0.055, 0, -0.022),
        (0.015, 0, 0),
        (0.012, 0.03, 0.01),
        (HumanoidHinge("toe_pitch", "y", -60, 20, 49, "toes"),),
        is_paired=True,
    ),
)
