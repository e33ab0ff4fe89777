"""The links and joints of the generic humanoid, of one side where there are two."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Hinge:
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
class Link:
    """A body of one box or capsule, of the left side if there are two; frames as OP3's."""

    name: str
    parent: str
    at: tuple[float, float, float]
    """Origin in the parent [m]."""
    center: tuple[float, float, float]
    """Of the box, or of the capsule [m]."""
    half_size: tuple[float, ...]
    """Of the box; or radius and half length of the capsule, which is upright [m]."""
    hinges: tuple[Hinge, ...] = ()
    is_paired: bool = False


LINKS = (
    Link("pelvis", "", (0, 0, 0), (0, 0, 0.01), (0.04, 0.055, 0.02)),
    Link(
        "waist",
        "pelvis",
        (0, 0, 0.035),
        (0, 0, 0.02),
        (0.03, 0.04, 0.012),
        (
            Hinge("waist_yaw", "z", -90, 90, 30),
            Hinge("waist_roll", "x", -30, 30, 30),
            Hinge("waist_pitch", "y", -20, 60, 30),
        ),
    ),
    Link(
        "chest",
        "waist",
        (0, 0, 0.04),
        (0, 0, 0.05),
        (0.045, 0.06, 0.042),
        (
            Hinge("chest_yaw", "z", -45, 45, 49),
            Hinge("chest_roll", "x", -20, 20, 49),
            Hinge("chest_pitch", "y", -15, 30, 49),
        ),
    ),
    Link(
        "head",
        "chest",
        (0, 0, 0.1),
        (0, 0, 0.045),
        (0.032, 0.01),
        (
            Hinge("neck_yaw", "z", -90, 90, segment="head"),
            Hinge("neck_pitch", "y", -40, 60, segment="head"),
            Hinge("neck_roll", "x", -30, 30, 30, "head"),
        ),
    ),
    Link(
        "upper_arm",
        "chest",
        (0, 0.083, 0.08),
        (0, 0, -0.05),
        (0.018, 0.04),
        (Hinge("sho_pitch", "y", -180, 90), Hinge("sho_roll", "x", -5, 150)),
        is_paired=True,
    ),
    Link(
        "forearm",
        "upper_arm",
        (0, 0, -0.11),
        (0, 0, -0.04),
        (0.016, 0.03),
        (Hinge("elbow", "y", -140, 0),),
        is_paired=True,
    ),
    Link(
        "hand",
        "forearm",
        (0, 0, -0.085),
        (0, 0, -0.025),
        (0.022, 0.009, 0.02),
        (
            Hinge("wrist_yaw", "z", -90, 90, 30, "wrist"),
            Hinge("wrist_roll", "x", -30, 30, 30, "wrist"),
            Hinge("wrist_pitch", "y", -60, 60, 30, "wrist"),
        ),
        is_paired=True,
    ),
    Link(
        "thumb",
        "hand",
        (0.032, 0, -0.012),
        (0, 0, -0.01),
        (0.005, 0.006),
        (
            Hinge("thumb_roll", "x", -40, 40, 49, "thumb"),
            Hinge("thumb_pitch", "y", -60, 0, 49, "thumb"),
        ),
        is_paired=True,
    ),
    Link(
        "thumb_tip",
        "thumb",
        (0, 0, -0.022),
        (0, 0, -0.008),
        (0.005, 0.004),
        (Hinge("thumb_bend", "x", -60, 0, 49, "thumb"),),
        is_paired=True,
    ),
    *(
        Link(
            finger,
            "hand",
            (x, 0, -0.048),
            (0, 0, -0.014),
            (0.0045, 0.01),
            (Hinge(f"{finger}_bend", "x", -80, 0, 49, "finger"),),
            is_paired=True,
        )
        for finger, x in (("index", 0.018), ("middle", 0.006), ("ring", -0.006), ("little", -0.018))
    ),
    Link(
        "thigh",
        "pelvis",
        (0, 0.045, -0.03),
        (0, 0, -0.055),
        (0.026, 0.03),
        (
            Hinge("hip_yaw", "z", -60, 60),
            Hinge("hip_roll", "x", -20, 50),
            Hinge("hip_pitch", "y", -120, 30),
        ),
        is_paired=True,
    ),
    Link(
        "shank",
        "thigh",
        (0, 0, -0.11),
        (0, 0, -0.055),
        (0.022, 0.03),
        (Hinge("knee", "y", 0, 140),),
        is_paired=True,
    ),
    Link(
        "foot",
        "shank",
        (0, 0, -0.11),
        (0.005, 0, -0.02),
        (0.045, 0.03, 0.012),
        (
            Hinge("ankle_pitch", "y", -60, 60, segment="foot"),
            Hinge("ankle_roll", "x", -40, 40, segment="foot"),
        ),
        is_paired=True,
    ),
    Link(
        "toes",
        "foot",
        (0.055, 0, -0.022),
        (0.015, 0, 0),
        (0.012, 0.03, 0.01),
        (Hinge("toe_pitch", "y", -60, 20, 49, "toes"),),
        is_paired=True,
    ),
)
