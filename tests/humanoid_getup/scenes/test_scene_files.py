"""Scene files and scenes by name: slopes as steep as they say, rough ground of a seed."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from nonempty import nonempty
from paths import REPOSITORY

from humanoid_getup.scenes.named_scenes import ROUGHNESS, BoxTable, load_scene, read_scene
from robots import Robot, quaternion
from robots.body.parts import leg_length

FULL = """
about = "everything"
unit = "m"
ground = { slope_deg = 10, friction = 0.5, sink = 0.01 }
spheres = [{ name = "ball", center = [1, 1, 1], radius = 0.2, rolling_friction = 0.01 }]
capsules = [{ name = "pole", start = [0, 0, 0.1], end = [0, 1, 0.1], radius = 0.05 }]
starts = [{ lying = "left", x = [-1, 1], heading_deg = [0, 90] }]
[[boxes]]
name = "box"
center = [1, 2, 3]
size = [0.2, 0.4, 0.6]
turn_deg = 90
friction = 0.3
"""


def write(folder: Path, text: str) -> Path:
    file = folder / "mine.toml"
    file.write_text(text)
    return file


def test_a_file_says_all_that_a_scene_has(op3: Robot, tmp_path: Path):
    scene = load_scene(str(write(tmp_path, FULL)), op3)
    assert scene.name == "mine"
    model = scene.compile(op3)
    box, pole, ball = (model.geom(name) for name in ("box", "pole", "ball"))
    np.testing.assert_allclose(box.pos, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(box.size, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(box.quat, [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    assert box.friction[0] == 0.3
    np.testing.assert_allclose(pole.pos, [0.0, 0.5, 0.1])
    np.testing.assert_allclose(pole.size[:2], [0.05, 0.5])
    assert ball.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE
    assert (ball.friction[2], ball.condim[0]) == (0.01, 6)
    assert scene.surface.friction == 0.5
    assert scene.surface.sink == 0.01
    assert scene.ground.height(np.array(1.0), np.array(5.0)) == pytest.approx(0.17633, abs=1e-5)
    (start,) = scene.starts
    assert (start.start_class, start.x) == ("left", (-1.0, 1.0))
    assert start.heading == pytest.approx((0.0, math.pi / 2))


def test_the_file_in_the_documentation_is_a_scene(op3: Robot, tmp_path: Path):
    page = (REPOSITORY / "docs" / "reference" / "scenes.md").read_text("utf-8")
    text = page.split("```toml\n")[1].split("```")[0]
    scene = read_scene(write(tmp_path, text), op3)
    assert [obstacle.name for obstacle in scene.obstacles] == ["crate"]
    assert scene.surface.rolling_friction > 0.0


def test_sizes_without_a_unit_are_shares_of_the_leg_and_heights_become_rough_ground(
    op3: Robot, tmp_path: Path
):
    text = '[[spheres]]\nname = "ball"\ncenter = [1, 0, 0]\nradius = 0.5'
    (ball,) = read_scene(write(tmp_path, text), op3).obstacles
    assert ball.radius == pytest.approx(0.5 * leg_length(op3))
    assert ball.position[0] == pytest.approx(leg_length(op3))
    text = 'unit = "m"\n[ground]\nheights = [[0, 0.1], [0.1, 0]]\ncell = 2'
    scene = read_scene(write(tmp_path, text), op3)
    assert scene.compile(op3).geom("ground").type[0] == mujoco.mjtGeom.mjGEOM_HFIELD
    assert scene.ground.height(np.array(1.0), np.array(-1.0)) == pytest.approx(0.1)


BALL = '[[spheres]]\nname = "ball"\ncenter = [0, 0, 0]\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("moon = 1", "unknown key moon, expected about, unit, ground"),
        ("[ground]\nfrictoin = 1", "unknown key ground.frictoin, expected friction"),
        (BALL + "radius = -1", "sphere 'ball': radius is -1, expected above 0"),
        (BALL, "sphere 'ball': radius is missing"),
        ("[ground]\nfriction = -0.1", r"ground.friction is -0\.1, expected a number from 0\.01"),
        ("[ground]\nslope_deg = 60", "ground.slope_deg is 60, expected degrees from -30 to 30"),
        ("[ground]\nheights = [[0, 0], [0, 0]]", "heights are all the same"),
        (
            "[ground]\nslope_deg = 5\nheights = [[0, 1], [0, 0]]",
            "has slope_deg and heights, expect",
        ),
        ("[ground]\nheights = [[0, 1e9], [0, 0]]", r"heights reach 1e\+09, expected -100 to 100"),
        (
            "[ground]\nheights = [[0, 1], [0, 0]]\n[[starts]]\nlying = 'prone'\nx = [0, 0.2]",
            "start 'prone': x is 0 to 0.2, expected within the field of heights, -0.125 to",
        ),
        (
            "[[starts]]\nlying = 'left'\nheading_deg = [90, -90]",
            "heading_deg is 90 to -90, expected",
        ),
        (BALL.replace("ball", "l_knee") + "radius = 1", "has the name of a part of robot 'op3'"),
        (BALL + "radius = 1\n" + BALL + "radius = 2", "have the name 'ball'"),
        (BALL.replace("ball", "ground") + "radius = 1", "have the name 'ground'"),
        ('[[starts]]\nlying = "upside down"', "expected supine, prone, left, right"),
        ('unit = "mile"', "unit is 'mile', expected leg, m"),
        ("=", "not TOML"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(op3: Robot, tmp_path: Path, text: str, message: str):
    with pytest.raises(ValueError, match=message) as raised:
        load_scene(str(write(tmp_path, text)), op3)
    assert "\n" not in str(raised.value)
    assert "mine.toml" in str(raised.value)


def test_a_tilted_box_is_higher_where_it_points():
    """A positive tilt raises the front, the way that the box is turned."""
    table = BoxTable(name="ramp", center=(0, 0, 0), size=(2, 1, 0.1), turn_deg=90.0, tilt_deg=30.0)
    front = quaternion.rotate(table.build(1.0).orientation, np.array([1.0, 0.0, 0.0]))
    assert front == pytest.approx([0.0, np.cos(np.radians(30.0)), 0.5])


def test_a_start_where_no_robot_comes_to_rest_is_refused_before_any_falls(
    op3: Robot, tmp_path: Path
):
    begin = "[[starts]]\nlying = 'supine'\nmargin = "
    for start in ("0\nx = [-1, 1]\ny = [0, 0.1]", "0\nsettled = true", "0.01"):
        assert load_scene(str(write(tmp_path, begin + start)), op3).starts
    for start in ("0", "0\nx = [-1, 1]"):
        file = write(tmp_path, begin + start)
        with pytest.raises(
            ValueError, match=r"start 'supine': [xy] is 0 alone and margin is 0, ex"
        ):
            load_scene(str(file), op3)


X, Y = np.meshgrid(np.linspace(-0.6, 0.6, 25), np.linspace(-0.6, 0.6, 25))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("moon", "unknown scene 'moon': expected beam, .*slope:10, rough:easy, .*or a .toml file"),
        ("slope:31", "scene slope:31: expected degrees from -30 to 30"),
        ("slope:steep", "scene slope:steep: expected degrees"),
        ("slope:nan", "scene slope:nan: expected degrees"),
        ("rough:", "scene rough:: expected rough:easy, rough:medium, rough:hard"),
        ("../named/flat", "unknown scene '../named/flat'"),
    ],
)
def test_an_unknown_scene_is_refused_with_what_is_allowed(op3: Robot, name: str, message: str):
    with pytest.raises(ValueError, match=message):
        load_scene(name, op3)


def test_a_slope_is_as_steep_as_its_name(op3: Robot):
    for degrees in (-30.0, 0.0, 12.5):
        height = load_scene(f"slope:{degrees:g}", op3).ground.height(X, Y)
        rise, aside = np.gradient(height, X[0], axis=1), np.ptp(height, axis=0)
        np.testing.assert_allclose(rise, np.tan(np.radians(degrees)), atol=1e-9)
        np.testing.assert_allclose(aside, 0.0, atol=1e-9)


def test_rough_ground_is_as_uneven_as_its_level_and_has_its_seed(op3: Robot):
    for level, share in nonempty(ROUGHNESS.items()):
        heights = [load_scene(f"rough:{level}", op3, seed).ground.height(X, Y) for seed in range(3)]
        most = np.abs(heights).max()
        assert 0.5 * share * leg_length(op3) < most <= share * leg_length(op3) + 1e-9
        again = load_scene(f"rough:{level}", op3, 0).ground.height(X, Y)
        assert np.array_equal(heights[0], again)
        assert not np.array_equal(heights[0], heights[1])
