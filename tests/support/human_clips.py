"""A small BVH clip of a human, written by the test: lying on the back, then sitting up."""

from pathlib import Path

# Name, parent, offset [cm]; y is up, z forward. Only the root has channels beside the hips' pitch.
SKELETON = (
    ("Hips", "", (0, 90, 0)),
    ("Spine1", "Hips", (0, 22, 0)),
    ("Neck", "Spine1", (0, 34, 0)),
    ("LeftArm", "Spine1", (18, 27, 0)),
    ("LeftForeArm", "LeftArm", (0, -32, 0)),
    ("LeftHand", "LeftForeArm", (0, -25, 0)),
    ("RightArm", "Spine1", (-18, 27, 0)),
    ("RightForeArm", "RightArm", (0, -32, 0)),
    ("RightHand", "RightForeArm", (0, -25, 0)),
    ("LeftUpLeg", "Hips", (9, 0, 0)),
    ("LeftLeg", "LeftUpLeg", (0, -42, 0)),
    ("LeftFoot", "LeftLeg", (0, -42, 0)),
    ("LeftToeBase", "LeftFoot", (0, -6, 16)),
    ("RightUpLeg", "Hips", (-9, 0, 0)),
    ("RightLeg", "RightUpLeg", (0, -42, 0)),
    ("RightFoot", "RightLeg", (0, -42, 0)),
    ("RightToeBase", "RightFoot", (0, -6, 16)),
)
PERIOD = 0.05  # s
LYING, SITTING = (10.0, -90.0, 0.0), (10.0, -20.0, -70.0)
"""Height of the hips [cm], pitch of the root and of the thighs [deg]."""


def write_human_bvh(file: Path, frames: int = 21, *, without: str = "") -> Path:
    """Write a body that sits up from its back in so many frames, or lacks a joint."""
    lines = ["HIERARCHY", *_nest("Hips", without), "MOTION", f"Frames: {frames}"]
    lines.append(f"Frame Time: {PERIOD}")
    for frame in range(frames):
        share = frame / max(frames - 1, 1)
        pairs = zip(LYING, SITTING, strict=True)
        height, root, thigh = ((1.0 - share) * a + share * b for a, b in pairs)
        lines.append(f"0 {height} 0 0 {root} 0 {thigh} {thigh}")
    file.write_text("\n".join(lines) + "\n")
    return file


def _nest(name: str, without: str) -> list[str]:
    offset = next(row[2] for row in SKELETON if row[0] == name)
    channels = {
        "Hips": "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
        "LeftUpLeg": "1 Xrotation",
        "RightUpLeg": "1 Xrotation",
    }.get(name, "0")
    kind = "JOINT" if name != "Hips" else "ROOT"
    lines = [f"{kind} {name}", "{", "OFFSET {} {} {}".format(*offset), f"CHANNELS {channels}"]
    for child, parent, _ in SKELETON:
        if parent == name and child != without:
            lines += _nest(child, without)
    return [*lines, "}"]
