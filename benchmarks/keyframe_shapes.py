"""Find which shape decides whether a page of the maker's keyframes gets up.

The robot lies on its back in the maker's walking stance, disturbed (torso 10° about its pitch and
5° about its roll, joints 2°, standard deviations), settles with its joints held, and plays a page.
This is repeated with the shapes of one group of links exchanged at a time for those of a mesh
model of the OP3 (see mesh_robot.py), with blunt handles, with other friction, and with the servos
of the MuJoCo Menagerie.

    python benchmarks/keyframe_shapes.py --peers FOLDER --meshes FOLDER --n 30 --seed 0
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import tyro
from mesh_robot import vary, with_meshes
from peer_keyframes import PAGES_FILE, Page
from rich.console import Console
from rich.table import Table

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.rollouts.play import play
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, load_robot, quaternion
from robots.kinematics import lowest_point, place
from robots.quaternion import Array
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

SETTLING = 1.5  # s in the stance before the page begins
DROP = 0.02  # m
PITCH, ROLL, JOINTS = np.radians([10.0, 5.0, 2.0])
SUPINE = -np.pi / 2  # rad about the y axis
HANDLES = {
    "back": ("l_back_handle", "r_back_handle"),
    "front": ("l_front_handle", "r_front_handle"),
}
LINKS = {
    "torso": ("body_link",),
    "head": ("head_pan_link", "head_tilt_link"),
    "upper arms": ("l_sho_roll_link", "r_sho_roll_link"),
    "forearms": ("l_el_link", "r_el_link"),
    "hips": ("l_hip_roll_link", "r_hip_roll_link"),
    "thighs, shanks": ("l_hip_pitch_link", "r_hip_pitch_link", "l_knee_link", "r_knee_link"),
    "ankles": ("l_ank_pitch_link", "r_ank_pitch_link"),
    "feet": ("l_ank_roll_link", "r_ank_roll_link"),
}
FRICTIONS = (0.5, 1.0)


def square_handles(spec: mujoco.MjSpec, side: str) -> None:
    """Make the handles of the back or the front boxes as large as the capsules."""
    for name in HANDLES[side]:
        handle = spec.geom(name)
        ends = handle.fromto.reshape(2, 3)
        radius, length = handle.size[0], np.abs(ends[1, 2] - ends[0, 2])
        body, middle = handle.parent, ends.mean(axis=0)
        spec.delete(handle)
        size = [radius, radius, length / 2 + radius]
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=middle, size=size)


def use_menagerie_servos(robot: Robot, spec: mujoco.MjSpec) -> None:
    """Replace the motors by the Menagerie's position servos, with its damping."""
    for name in robot.joint_names:
        joint, servo = spec.joint(name), spec.actuator(name)
        joint.damping[0], joint.armature, joint.frictionloss = 1.084, 0.045, 0.03
        servo.set_to_position(kp=21.1)
        servo.forcerange[:] = [-5.0, 5.0]


def make_variants(robot: Robot, meshes: Path) -> dict[str, Robot]:
    """Make the robots that are compared, by name."""
    return {
        "as described": robot,
        "meshes: all links": with_meshes(robot, meshes),
        **{f"meshes: {name}": with_meshes(robot, meshes, links) for name, links in LINKS.items()},
        **{
            f"square {side} handles": vary(robot, lambda s, side=side: square_handles(s, side))
            for side in HANDLES
        },
        "Menagerie servos": vary(robot, lambda spec: use_menagerie_servos(robot, spec)),
    }


def sample_starts(world: World, stance: Array, n: int, rng: np.random.Generator) -> Array:
    """Sample starts on the back, just above the ground; MuJoCo positions (n, nq)."""
    robot, model = world.robot, world.model
    x, y = np.eye(3)[:2]
    starts = []
    for _ in range(n):
        pitch = quaternion.from_axis_angle(y, SUPINE + rng.normal(scale=PITCH))
        roll = quaternion.from_axis_angle(x, rng.normal(scale=ROLL))
        posture = Posture(
            position=np.array([0.0, 0.0, 1.0]),
            orientation=quaternion.normalize(quaternion.multiply(roll, pitch)),
            joint_pos=np.clip(
                stance + rng.normal(scale=JOINTS, size=robot.n), robot.lower, robot.upper
            ),
        )
        qpos = place(robot, model, posture)
        qpos[robot.layout(model).root_qpos + 2] += DROP - lowest_point(model, qpos)
        starts.append(qpos)
    return np.array(starts)


def play_page(world: World, page: Page, stance: Array, starts: Array, friction: float) -> int:
    """Play a page from starts (n, nq); return how often it stood."""
    robot, n = world.robot, len(starts)
    period = robot.control_period
    targets = np.concatenate(
        [
            np.tile(stance, (round(SETTLING / period), 1)),
            page.begin_at(stance)(np.arange(0.0, page.time[-1], period)),
            np.tile(page.joint_pos[-1], (round(HOLD / period), 1)),
        ]
    )
    parameters = DomainParameters.nominal(world, n, friction=friction)
    record = play(world, Scenarios(starts=starts, parameters=parameters), [targets] * n)
    return int(Outcome(record, robot).stood.sum())


def compare(robot: Robot, peers: Path, meshes: Path, *, number: int, n: int, seed: int) -> Any:
    """Play a page on every variant, from the same starts."""
    walk_ready = json.loads((peers / PAGES_FILE).read_text("utf-8"))["walk_ready_rad"]
    stance = np.array([walk_ready[name] for name in robot.joint_names])
    page, own = Page.load(peers, number, robot), World(robot)
    starts = sample_starts(own, stance, n, np.random.default_rng(seed))
    cases = {}
    for name, variant in make_variants(robot, meshes).items():
        world = World(variant)
        cases[name] = play_page(world, page, stance, starts, own.scene.surface.friction)
    for friction in FRICTIONS:
        cases[f"friction {friction}"] = play_page(own, page, stance, starts, friction)
    return {
        "name": "keyframe_shapes",
        "page": number,
        "seed": seed,
        "n": n,
        "cases": {
            name: {"stood": stood, "stood_interval_95": wilson_interval(stood, n)}
            for name, stood in cases.items()
        },
    }


@dataclass(frozen=True, kw_only=True)
class Options:
    """Play a page of the maker's keyframes on variants of the robot."""

    peers: Path
    """Folder with the decoded pages."""
    meshes: Path
    """Folder of the mesh model."""
    page: int = 202
    n: int = 30
    """Plays of each variant."""
    seed: int = 0
    robot: str = "op3"
    json: Path | None = None
    """Where figures are written."""


def main(options: Options) -> None:
    """Measure, print, write."""
    robot = load_robot(options.robot)
    result = compare(
        robot,
        options.peers,
        options.meshes,
        number=options.page,
        n=options.n,
        seed=options.seed,
    )
    table = Table("variant", f"stood, of {options.n}", box=None, header_style="bold")
    for name, case in result["cases"].items():
        table.add_row(name, str(case["stood"]))
    Console(width=100).print(table)
    if options.json is not None:
        write_atomically(options.json, to_json(result))


if __name__ == "__main__":
    main(tyro.cli(Options))
