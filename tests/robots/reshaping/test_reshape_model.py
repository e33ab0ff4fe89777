"""Other bodies: as text, and what becomes longer, what stays, and what mass and inertia do."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import Body, BodyError, Robot, load_robot, reshape
from robots.body.parts import leg_length
from robots.proportions import MAX_FACTOR, MIN_FACTOR, ORIGINAL, PARTS

ALL = ("shoulders", "arms", "torso", "legs")
NEARLY_ONE = 1.0 + 1e-9

# A chest on a waist joint carries two arms that hang down; a limb of each kind of shape, poses in
# frames, masses from the shapes, a hand of a mesh and a welded badge.
CHESTED = """
<mujoco>
  <compiler angle="degree"/>
  <asset><mesh name="hand" vertex="0 0 0 .02 0 0 0 .02 0 0 0 -.06 .02 .02 0"/></asset>
  <worldbody>
    <body name="pelvis"><freejoint name="root"/><site name="imu"/>
      <geom type="box" size=".03 .05 .02" mass=".4"/>
      <body name="chest" pos="0 0 .02"><joint name="waist" axis="0 0 1" range="-60 60"/>
        <geom name="chest" type="box" pos="0 0 .06" size=".03 .05 .06" mass=".6"/>
        <site name="neck" pos="0 0 .12"/>
        <body name="badge" pos=".03 0 .08"><geom type="sphere" size=".005" mass=".01"/></body>
        <body name="l_arm" pos="0 .07 .1"><joint name="l_arm" axis="0 1 0" range="-90 90"/>
          <frame pos="0 0 -.05" euler="0 0 90">
            <geom name="l_arm" type="capsule" size=".01 .04" mass=".1"/>
            <body name="l_hand" pos="0 0 -.05"><joint name="l_hand" axis="0 1 0" range="-90 90"/>
              <geom name="l_hand" type="mesh" mesh="hand" mass=".05"/>
              <site name="l_tip" pos="0 0 -.06"/></body></frame></body>
        <body name="r_arm" pos="0 -.07 .1"><joint name="r_arm" axis="0 1 0" range="-90 90"/>
          <geom type="cylinder" pos="0 0 -.05" size=".01 .05" mass=".1"/></body></body>
      <body name="l_leg" pos="0 .04 -.02"><joint name="l_leg" axis="0 1 0" range="-90 60"/>
        <geom type="ellipsoid" pos="0 0 -.05" size=".03 .02 .05" mass=".1"/>
        <site name="l_sole" pos="0 0 -.1"/></body>
      <body name="r_leg" pos="0 -.04 -.02"><joint name="r_leg" axis="0 1 0" range="-90 60"/>
        <geom type="box" pos="0 0 -.05" size=".03 .02 .05" mass=".1"/>
        <site name="r_sole" pos="0 0 -.1"/></body></body>
  </worldbody>
</mujoco>
"""
JOINTS = ("waist", "l_arm", "l_hand", "r_arm", "l_leg", "r_leg")


@pytest.fixture(scope="module")
def chested(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    folder = tmp_path_factory.mktemp("chested")
    return make_robot(folder, CHESTED)


def make_robot(folder: Path, model: str) -> Robot:
    """Make a robot of a model, all of whose joints are their own mirror images."""
    rows = "\n".join(
        f'{{ name = "{name}", id = {k + 1}, servo = "XM430-W350", sign = 1, zero_ticks = 2048, '
        f'mirror = "{name}", mirror_sign = 1, segment = "other" }},'
        for k, name in enumerate(JOINTS)
    )
    (folder / "model.xml").write_text(model)
    (folder / "robot.toml").write_text(
        'name = "chested"\nmodel = "model.xml"\ntorso = "pelvis"\nneck_site = "neck"\n'
        'imu_site = "imu"\nsole_sites = ["l_sole", "r_sole"]\ncontrol_period = 0.008\n'
        f"supply_voltage = 12.0\njoints = [\n{rows}\n]\n[standing]\n"
    )
    return load_robot(folder)


def at_zero(robot: Robot) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model with all joints at zero and the torso at the origin."""
    model = robot.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def mass_matrix(robot: Robot) -> np.ndarray:
    model, data = at_zero(robot)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return matrix


def site(robot: Robot, name: str) -> np.ndarray:
    return at_zero(robot)[1].site(name).xpos.copy()


def body(robot: Robot, name: str) -> np.ndarray:
    return at_zero(robot)[1].body(name).xpos.copy()


@pytest.mark.parametrize("name", ["op3", "tiny", "chested"])
def test_factors_of_nearly_one_change_nearly_nothing(name: str, request):
    robot: Robot = request.getfixturevalue(name)
    parts = ALL if name != "tiny" else ("torso", "legs")
    same = reshape(robot, Body(**dict.fromkeys(parts, NEARLY_ONE)))
    assert mass_matrix(same) == pytest.approx(mass_matrix(robot), abs=1e-8)
    (old, was), (new, now) = at_zero(robot), at_zero(same)
    assert now.xpos == pytest.approx(was.xpos, abs=1e-8)
    assert now.site_xpos == pytest.approx(was.site_xpos, abs=1e-8)
    assert new.body_mass == pytest.approx(old.body_mass, rel=1e-8)
    beams = [new.geom(k).name.endswith("_shoulder") for k in range(new.ngeom)]
    primitive = old.geom_type != mujoco.mjtGeom.mjGEOM_MESH
    kept = now.geom_xpos[~np.array(beams)]
    assert kept[primitive] == pytest.approx(was.geom_xpos[primitive], abs=1e-8)
    sizes = new.geom_size[~np.array(beams)]
    assert sizes[primitive] == pytest.approx(old.geom_size[primitive], abs=1e-8)
    assert same.standing_neck_height == pytest.approx(robot.standing_neck_height)
    assert same.standing.position == pytest.approx(robot.standing.position, abs=1e-8)


def test_longer_arms_reach_as_much_further_and_weigh_as_much_more(op3: Robot):
    long = reshape(op3, Body(arms=1.6))
    reach = site(op3, "l_hand") - body(op3, "l_sho_pitch_link")
    further = site(long, "l_hand") - body(long, "l_sho_pitch_link")
    assert further[1] == pytest.approx(1.6 * reach[1])  # along the arm
    assert further[[0, 2]] == pytest.approx(reach[[0, 2]], abs=1e-9)  # across it
    assert body(long, "l_sho_pitch_link") == pytest.approx(body(op3, "l_sho_pitch_link"))
    old, new = op3.spec().compile(), long.spec().compile()
    for k in range(1, old.nbody):
        is_arm = "sho" in old.body(k).name or "_el_" in old.body(k).name
        assert new.body_mass[k] == pytest.approx((1.6 if is_arm else 1.0) * old.body_mass[k])
    forearm = new.geom("l_el").size - old.geom("l_el").size
    # 164 mm from end to end become 262.4 mm; the radius stays.
    assert forearm == pytest.approx([0.0, 0.5 * 0.6 * 0.164, 0.0])


def test_a_longer_torso_rises_above_the_hips(op3: Robot):
    tall = reshape(op3, Body(torso=2.2))
    for name, high in (("l_sho_pitch_link", 0.111), ("head_pan_link", 0.1365)):
        assert body(tall, name) == pytest.approx([-0.001, body(op3, name)[1], 2.2 * high])
    assert body(tall, "l_hip_yaw_link") == pytest.approx(body(op3, "l_hip_yaw_link"))
    assert site(tall, "neck")[2] == pytest.approx(2.2 * 0.1365)
    # The torso stands upright: the neck is higher by what the torso is longer.
    tilt = op3.standing.gravity_b @ np.array([0.0, 0.0, -1.0])
    grown = tall.standing_neck_height - op3.standing_neck_height
    assert grown == pytest.approx(1.2 * 0.1365 * tilt, rel=0.01)
    assert leg_length(tall) == leg_length(op3)
    assert tall.spec().compile().body("body_link").mass[0] == pytest.approx(2.2 * 1.34928, rel=1e-3)


def test_wider_shoulders_move_the_arms_and_bridge_the_gap(op3: Robot):
    wide = reshape(op3, Body(shoulders=2.0))
    for side, arm in ((1, "l_sho_pitch_link"), (-1, "r_sho_pitch_link")):
        assert body(wide, arm) == pytest.approx([-0.001, side * 0.12, 0.111])
        beam = wide.spec().compile().geom(f"{arm}_shoulder")
        assert beam.pos == pytest.approx([-0.001, side * 0.09, 0.1073])
        assert beam.size == pytest.approx([0.021, 0.03, 0.0163])  # thick as the first link
    assert body(wide, "head_pan_link") == pytest.approx(body(op3, "head_pan_link"))
    old, new = op3.spec().compile(), wide.spec().compile()
    added = new.body_mass - old.body_mass
    assert added[old.body("body_link").id] == added.sum()  # the torso's alone
    assert 0.2 < added.sum() / 1.34928 < 0.35  # at the height of the shoulders: 0.28 of it


@pytest.mark.parametrize("text", ["shoulders=2.0", "arms=1.6", "arms=1.6,torso=2.2", "legs=0.7"])
def test_left_and_right_stay_mirror_images(op3: Robot, text: str):
    robot = reshape(op3, Body.parse(text))
    model, data = at_zero(robot)
    names = [model.body(k).name for k in range(model.nbody)]
    left = [name for name in names if name.startswith("l_")]
    assert len(left) == 9
    for name in left:
        one, other = data.body(name), data.body("r" + name[1:])
        assert one.xpos == pytest.approx(other.xpos * [1, -1, 1], abs=1e-12)
        assert one.xipos == pytest.approx(other.xipos * [1, -1, 1], abs=1e-12)
        masses = model.body(name).mass, model.body("r" + name[1:]).mass
        assert masses[0] == pytest.approx(masses[1])


def test_a_tiny_robot_without_arms_can_be_reshaped_too(tiny: Robot):
    other = reshape(tiny, Body(torso=2.0, legs=1.5))
    assert leg_length(other) == pytest.approx(1.5 * leg_length(tiny))
    # The torso is a box from -0.05 to 0.05 around the hips; its upper half alone is stretched.
    model, _ = at_zero(other)
    assert model.geom_pos[0] == pytest.approx([0.0, 0.0, 0.025])
    assert model.geom_size[0] == pytest.approx([0.02, 0.05, 0.075])
    assert model.body("torso").mass[0] == pytest.approx(0.75)
    assert other.standing_neck_height == pytest.approx(0.1 + 0.15)
    with pytest.raises(BodyError, match="robot 'tiny' has no arms, expected torso or legs alone"):
        reshape(tiny, Body(arms=1.6))


def test_a_chest_on_a_waist_is_trunk_and_what_hangs_on_it_are_arms(chested: Robot):
    other = reshape(chested, Body(arms=2.0, torso=1.5, shoulders=1.5))
    # The hips are at -0.02, the waist at 0.02: half of that higher, at 0.04.
    assert body(other, "chest") == pytest.approx([0.0, 0.0, 0.04])
    assert site(other, "neck")[2] == pytest.approx(0.04 + 1.5 * 0.12)
    assert body(other, "badge") == pytest.approx([0.03, 0.0, 0.04 + 1.5 * 0.08])
    assert body(other, "l_arm") == pytest.approx([0.0, 0.105, 0.04 + 1.5 * 0.1])
    assert site(other, "l_tip") - body(other, "l_arm") == pytest.approx([0.0, 0.0, -2.0 * 0.16])
    model, _ = at_zero(other)
    assert model.geom("l_arm").size[:2] == pytest.approx([0.01, 2.0 * 0.05 - 0.01])
    assert model.body("r_arm").mass[0] == pytest.approx(0.2)


def test_a_mesh_is_stretched_point_by_point(chested: Robot):
    def points(robot: Robot) -> np.ndarray:
        model, data = at_zero(robot)
        geom = model.geom("l_hand").id
        mesh = model.mesh(int(model.geom_dataid[geom]))
        first = int(mesh.vertadr[0])
        vertices = model.mesh_vert[first : first + int(mesh.vertnum[0])]
        world = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        away = world - data.body("l_hand").xpos
        return away[np.lexsort(away.round(6).T)]

    expected = points(chested) * [1.0, 1.0, 2.0]
    assert points(reshape(chested, Body(arms=2.0))) == pytest.approx(expected, abs=1e-6)


factors = st.floats(MIN_FACTOR, MAX_FACTOR)


@given(st.fixed_dictionaries({}, optional=dict.fromkeys(PARTS, factors)))
def test_a_body_survives_the_trip_through_text(chosen: dict[str, float]):
    body = Body(**chosen)
    assert Body.parse(str(body)) == body
    assert Body.parse("arms=1,legs=1.0") == Body.parse(" ") == ORIGINAL


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tail=2", "body 'tail=2': unknown part 'tail', expected shoulders, arms, torso, legs"),
        ("arms", "arms is '', expected a factor from 0.25 to 4"),
        ("arms=nan", "arms is 'nan'"),
        ("arms=4.1", "arms is '4.1'"),
        ("arms=1.6,arms=1.7", "arms is given twice, expected once"),
        ("arms=0,tail=1", "arms is '0', expected a factor from 0.25 to 4; unknown part 'tail'"),
    ],
)
def test_what_is_wrong_is_reported_in_one_line(text: str, message: str):
    with pytest.raises(BodyError) as error:
        Body.parse(text)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
