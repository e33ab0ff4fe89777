"""One motion in many layouts of a BVH file is one motion: unit, axis, channels, names, rest."""

import math
from pathlib import Path

import numpy as np
import pytest
from paths import SHARED
from scipy.spatial.transform import Rotation

from humanoid_getup.clips.clip import Clip, ClipBody, read_body
from humanoid_getup.clips.clip_file import read_clip
from humanoid_getup.style.curves import measure_clip

# Name, parent, offset [cm]: x to the left, y up, z forward.
SKELETON = (
    ("Hips", "", (0, 0, 0)),
    ("LeftUpLeg", "Hips", (9, -4, 0)),
    ("LeftLeg", "LeftUpLeg", (0, -42, 0)),
    ("LeftFoot", "LeftLeg", (0, -41, 0)),
    ("LeftToeBase", "LeftFoot", (0, -6, 14)),
    ("RightUpLeg", "Hips", (-9, -4, 0)),
    ("RightLeg", "RightUpLeg", (0, -42, 0)),
    ("RightFoot", "RightLeg", (0, -41, 0)),
    ("RightToeBase", "RightFoot", (0, -6, 14)),
    ("Spine", "Hips", (0, 10, -1)),
    ("Spine1", "Spine", (0, 15, 1)),
    ("Neck", "Spine1", (0, 27, 0)),
    ("LeftArm", "Spine1", (17, 24, 0)),
    ("LeftForeArm", "LeftArm", (28, 0, 0)),
    ("LeftHand", "LeftForeArm", (24, 0, 0)),
    ("RightArm", "Spine1", (-17, 24, 0)),
    ("RightForeArm", "RightArm", (-28, 0, 0)),
    ("RightHand", "RightForeArm", (-24, 0, 0)),
)
FRAMES = 31
PERIOD = 0.05  # s


def pose_body() -> tuple[np.ndarray, dict[str, Rotation]]:
    """Make a rise from the back over a squat: places of the hips [cm], turns of the joints."""
    share = np.linspace(0.0, 1.0, FRAMES)
    bend = np.sin(np.pi * share)
    root = np.stack([20 * share, 12 + 83 * share**2, 60 * share], axis=-1)
    turns = {name: Rotation.identity(FRAMES) for name, *_ in SKELETON}

    def about(axis: str, degrees: np.ndarray) -> Rotation:
        return Rotation.from_euler(axis, degrees[:, None], degrees=True)

    turns["Hips"] = about("y", 30 * share) * about("x", -85 * (1 - share))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        turns[f"{side}UpLeg"] = about("x", -(70 + 10 * sign) * bend)
        turns[f"{side}Leg"] = about("x", 100 * bend)
        turns[f"{side}Arm"] = about("z", -sign * 70 * share) * about("y", 25 * bend)
        turns[f"{side}ForeArm"] = about("y", -sign * 40 * bend)
    turns["Spine1"] = about("x", 20 * bend) * about("y", 15 * bend)
    return root, turns


def write(
    file: Path,
    *,
    unit: float = 1.0,
    basis: np.ndarray | None = None,
    bones: np.ndarray | None = None,
    moves: str = "",
    named: str = "{}",
    renames: dict[str, str] | None = None,
) -> Path:
    """Write the rise.

    Args:
        file: File to write.
        unit: Units in a centimeter.
        basis: Rotation from our axes to those of the file, (3, 3).
        bones: Rotation of the frame of every joint below the root, with which the angles are not
            zero in a stand, (3, 3).
        moves: Whether all joints have position channels that "replace" the offset or "add" to it.
        named: Makes the joints' names.
        renames: Joints with other names.
    """
    root, turns = pose_body()
    turn = Rotation.from_matrix(np.eye(3) if basis is None else basis)
    own = Rotation.from_matrix(np.eye(3) if bones is None else bones)
    columns, lines = [], ["HIERARCHY"]
    renames = renames or {}

    def nest(name: str, parent: str, offset: tuple[int, int, int], frame: Rotation) -> None:
        inner = own if name.endswith(("Leg", "Foot", "Arm")) else Rotation.identity()
        place = unit * frame.inv().apply(turn.apply(np.array(offset, dtype=float)))
        local = frame.inv() * (turn * turns[name] * turn.inv()) * inner
        kind, moved = ("JOINT" if parent else "ROOT"), not parent or bool(moves)
        if not parent:
            columns.append(unit * turn.apply(root))
        elif moves:
            columns.append(np.tile(place if moves == "replace" else np.zeros(3), (FRAMES, 1)))
        columns.append(local.as_euler("ZXY", degrees=True))
        channels = "Xposition Yposition Zposition " * moved + "Zrotation Xrotation Yrotation"
        lines.append(f"{kind} {named.format(renames.get(name, name))}\n{{")
        lines.append("OFFSET {:.9f} {:.9f} {:.9f}".format(*place))
        lines.append(f"CHANNELS {len(channels.split())} {channels}")
        for child in SKELETON:
            if child[1] == name:
                nest(*child, inner)
        lines.append("}")

    nest(*SKELETON[0], Rotation.identity())
    rows = [" ".join(f"{value:.9f}" for value in row) for row in np.concatenate(columns, axis=1)]
    lines += ["MOTION", f"Frames: {FRAMES}", f"Frame Time: {PERIOD}", *rows]
    file.write_text("\n".join(lines) + "\n")
    return file


def describe(body: ClipBody) -> np.ndarray:
    """Return what the body's parts do, without its heading and place."""
    axes = np.swapaxes(body.torso, 1, 2)
    rows = [axes[:, :, 2], axes @ body.pelvis, axes @ body.chest, body.hips[:, 2] - body.hips[0, 2]]
    for track in body.limbs.values():
        rows += [np.einsum("tij,tj->ti", axes, part) for part in (track.upper, track.lower)]
        rows += [axes @ track.foot] if track.foot is not None else []
    return np.concatenate([row.reshape(len(row), -1) for row in rows], axis=1)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    return read_clip(write(tmp_path_factory.mktemp("clips") / "plain.bvh"))


def check_same(clip: Clip, plain: Clip) -> None:
    assert describe(read_body(clip)) == pytest.approx(describe(read_body(plain)), abs=1e-5)
    assert measure_clip(clip) == pytest.approx(measure_clip(plain), abs=1e-5)
    assert clip.leg_length == pytest.approx(plain.leg_length)


def test_the_body_is_read_in_meters_with_z_up(plain: Clip):
    assert str(plain.layout) == "unit cm, y up, rest pose: angles zero, sides: as named"
    assert plain.joints["Hips"][-1] == pytest.approx([0.2, -0.6, 0.95])
    assert plain.leg_length == pytest.approx(0.89)


@pytest.mark.parametrize(("unit", "name"), [(0.01, "m"), (10.0, "mm"), (1 / 2.54, "inch")])
def test_a_unit_is_that_in_which_the_body_is_as_tall_as_a_person(tmp_path, plain, unit, name):
    clip = read_clip(write(tmp_path / "a.bvh", unit=unit))
    assert f"unit {name}," in str(clip.layout)
    check_same(clip, plain)


def test_another_unit_is_asked_for_and_taken_as_it_is_given(tmp_path, plain):
    file = write(tmp_path / "a.bvh", unit=0.1)
    with pytest.raises(ValueError) as caught:
        read_clip(file)
    assert str(caught.value) == (
        f"clip {file}: its body is 17.37 units tall, expected 1 to 2.2 m in m, cm, mm, inch; "
        "--unit gives its unit, or the unit's meters"
    )
    clip = read_clip(file, unit=0.1)
    assert str(clip.layout).startswith("unit 0.1 m, y up")
    check_same(clip, plain)


# Rows: our x (left), y (up) and z (forward) in the file's axes.
BASES = {
    "x": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]),
    "z": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),  # faces -y, as in Blender
    "-x": np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    "-y": np.array([[-1, 0, 0], [0, -1, 0], [0, 0, 1]]),
    "-z": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
}


@pytest.mark.parametrize("up", BASES)
def test_any_axis_may_point_up(tmp_path, plain, up):
    clip = read_clip(write(tmp_path / "a.bvh", basis=BASES[up].T))
    assert clip.layout.up == up
    check_same(clip, plain)


def test_an_axis_that_is_given_points_up_whatever_the_body_does(tmp_path):
    clip = read_clip(write(tmp_path / "a.bvh"), up="z")
    assert clip.joints["Hips"][-1] == pytest.approx([0.2, 0.95, 0.6])
    assert clip.rest["Neck"][2] > 0.0


@pytest.mark.parametrize("moves", ["replace", "add"])
def test_position_channels_of_all_joints_replace_the_offsets_or_are_added(tmp_path, plain, moves):
    check_same(read_clip(write(tmp_path / "a.bvh", moves=moves)), plain)


@pytest.mark.parametrize("named", ["mixamorig:{}", "Character1_{}", "a:b:{}"])
def test_what_all_names_begin_with_is_ignored(tmp_path, plain, named):
    check_same(read_clip(write(tmp_path / "a.bvh", named=named)), plain)


def test_joints_are_renamed_by_their_names_in_the_file_or_without_what_all_begin_with(
    tmp_path, plain
):
    file = write(tmp_path / "a.bvh", named="x:{}", renames={"Neck": "Throat", "LeftLeg": "Knie"})
    check_same(read_clip(file, renames={"Throat": "Neck", "x:Knie": "LeftLeg"}), plain)


def test_without_a_rest_pose_the_straightest_frame_is_one(tmp_path, plain):
    bones = Rotation.from_euler("zx", [80, 40], degrees=True).as_matrix()
    file = write(tmp_path / "a.bvh", bones=bones)
    with pytest.raises(ValueError, match="its body stands along y or -z, expected one; --up gives"):
        read_clip(file)  # it lies with its feet where it stands later: the wall may be the floor
    clip = read_clip(file, up="y")
    assert clip.layout.rest_pose == "frame at 1.50 s (leans 0°)"
    got, wanted = describe(read_body(clip)), describe(read_body(plain))
    assert np.degrees(np.abs(got - wanted)).max() < 1.0


def test_exchanged_sides_are_found_by_the_feet(tmp_path, plain):
    sides = {name: name.replace("Left", "Right") for name, *_ in SKELETON if "Left" in name}
    sides |= {name: name.replace("Right", "Left") for name, *_ in SKELETON if "Right" in name}
    clip = read_clip(write(tmp_path / "a.bvh", renames=sides))
    assert clip.layout.sides == "exchanged, as both feet point backward"
    check_same(clip, plain)


def test_a_spine_joint_at_the_neck_or_the_hips_is_read_by_the_next(plain):
    joints, rest = dict(plain.joints), dict(plain.rest)
    for ends in (("Neck",), ("LeftUpLeg", "RightUpLeg")):
        joints["upperback"] = np.mean([joints[end] for end in ends], axis=0)
        rest["upperback"] = np.mean([rest[end] for end in ends], axis=0)
        doubled = Clip(file=plain.file, period=PERIOD, joints=joints, rest=rest)
        assert describe(read_body(doubled)) == pytest.approx(describe(read_body(plain)))


INPUTS = SHARED / "public-inputs"


@pytest.mark.skipif(not INPUTS.exists(), reason="needs the clips in ../shared/public-inputs")
def test_one_motion_in_the_layouts_of_many_programs_is_one_motion():
    """The shoulders of one file are elsewhere, and its arms hang differently."""
    plain = read_body(read_clip(INPUTS / "bvh_plain.bvh"))
    for file in sorted(INPUTS.glob("bvh_*.bvh")):
        body = read_body(read_clip(file))
        if "collinear" in file.name:
            body.limbs["left_arm"], body.limbs["right_arm"] = (
                plain.limbs[name] for name in ("left_arm", "right_arm")
            )
        off = np.abs(describe(body) - describe(plain)).max()
        assert off < (math.radians(1.0) if "bones" in file.name else 1e-5), file.name
