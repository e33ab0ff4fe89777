"""Film strips: the right moments, the robot in the picture, one whole file."""

import copy
from pathlib import Path

import mujoco
import numpy as np
import pytest
from matplotlib.image import imread
from PIL import Image

from humanoid_getup.reporting import film_strip
from humanoid_getup.reporting.figure import save_figure
from humanoid_getup.reporting.video import write_video
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import place


@pytest.fixture(scope="module")
def empty(world: World) -> mujoco.MjModel:
    model = copy.copy(world.model)
    robot_geoms = model.body_rootid[model.geom_bodyid] != 0
    model.geom_rgba[robot_geoms, 3] = 0.0
    return model


def render(robot: Robot, model: mujoco.MjModel, posture: Posture) -> np.ndarray:
    try:
        return film_strip.render_frames(robot, model, place(robot, model, posture)[None])[0]
    except film_strip.NoRendererError as error:
        pytest.skip(str(error))


def lie(robot: Robot) -> Posture:
    return Posture(
        position=np.array([0.3, -0.2, 0.09]),
        orientation=quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -np.pi / 2),
        joint_pos=robot.standing.joint_pos,
    )


def test_the_robot_fills_the_picture_and_is_not_cut_off(op3, world, empty):
    posture = lie(op3)
    with_robot, without = (render(op3, model, posture) for model in (world.model, empty))
    seen = np.abs(with_robot.astype(int) - without).max(axis=2) > 60
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    size = film_strip.FRAME_SIZE[0]
    assert min(rows[0], columns[0]) > 0
    assert max(rows[-1], columns[-1]) < size - 1
    extent = max(rows[-1] - rows[0], columns[-1] - columns[0])
    assert extent > 0.6 * size


@pytest.mark.parametrize(("count", "rows"), [(4, 1), (12, 2)])
def test_a_strip_is_one_file_of_rows_of_six(tmp_path, count, rows, monkeypatch):
    monkeypatch.setattr(film_strip, "save_figure", save_figure)  # no draft
    pictures = np.full((count, 20, 20, 3), 200, dtype=np.uint8)
    film_strip.save_strip(
        pictures, np.arange(count) * 0.1, tmp_path / "strip.png", title="twelve steps"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["strip.png"]
    height, width, _ = imread(tmp_path / "strip.png").shape
    assert width == min(count, 6) * 300
    assert height == pytest.approx(rows * 300 + 68, abs=1)  # 68 pixels for the title


def test_without_gl_the_answer_is_an_error_that_says_so(op3, world, monkeypatch):
    class NoGl:
        def __init__(self, *_args: object, **_options: object) -> None:
            raise RuntimeError("cannot open\na display")

    monkeypatch.setattr(mujoco, "Renderer", NoGl)
    with pytest.raises(
        film_strip.NoRendererError, match=r"no GL to render with .*: cannot open a disp"
    ):
        film_strip.render_frames(op3, world.model, place(op3, world.model, op3.standing)[None])


FRAMES = [np.full((8, 8, 3), 25 * number, np.uint8) for number in range(10)]


@pytest.mark.parametrize("suffix", ["gif", "webp"])
def test_every_picture_is_shown_for_the_time_of_the_rate(tmp_path: Path, suffix: str):
    path = tmp_path / f"rise.{suffix}"
    write_video(FRAMES, 20, path)
    with Image.open(path) as video:
        assert video.n_frames == len(FRAMES)
        for number, frame in enumerate(FRAMES):
            video.seek(number)
            video.load()
            assert video.info["duration"] == 50  # ms
            shown = np.asarray(video.convert("RGB"), float)
            assert np.abs(shown - frame).max() < 6.0
