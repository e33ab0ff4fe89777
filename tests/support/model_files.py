"""A model file as a user has one: the bodies of OP3 under other names, with motors."""

from __future__ import annotations

import re
from pathlib import Path

from robots import Robot

RENAMED = {
    "body_link": "trunk",
    "head_pan": "neck_yaw",
    "head_tilt": "neck_pitch",
    "sho_pitch": "shoulder_swing",
    "sho_roll": "shoulder_lift",
    "ank_pitch": "ankle_pitch",
    "ank_roll": "ankle_roll",
    "el_link": "elbow_link",
}
SIDES = {"l_": "left_", "r_": "right_"}
ELBOWS = {'"left_el"': '"left_elbow"', '"right_el"': '"right_elbow"'}
STALL_TORQUE = 4.1  # N·m, of OP3's servos: the importer finds their type by it
SITE, JOINT = re.compile(r" *<site .*\n"), re.compile(r'<joint name="(\w+)"')


def write_model(path: Path, op3: Robot) -> Path:
    """Write OP3 as a model that names its parts otherwise, without sites, with motors."""
    text = SITE.sub("", op3.model_file.read_text("utf-8"))
    for side, other in SIDES.items():
        text = re.sub(rf'"{side}', f'"{other}', text)
    for old, new in RENAMED.items():
        text = text.replace(old, new)
    for old, new in ELBOWS.items():
        text = text.replace(old, new)
    motors = "\n".join(
        f'    <motor joint="{name}" ctrlrange="-{STALL_TORQUE} {STALL_TORQUE}"/>'
        for name in JOINT.findall(text)
    )
    text = text.replace("</mujoco>", f"  <actuator>\n{motors}\n  </actuator>\n</mujoco>")
    path.write_text(text.replace('model="op3"', 'model="gnome"'), "utf-8")
    return path
