"""Film strips: a motion as a few pictures in order of time."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from humanoid_getup.reporting.figure import make_figure, save_figure
from robots import Robot, quaternion
from robots.quaternion import Array

FRAMES = 12
COLUMNS = 6
FRAME_SIZE = (400, 400)  # pixels, width and height of one picture
INCH, GAP = 1.5, 0.02  # width of one picture in the strip, and of the line between two
FIELD_OF_VIEW = 26.0  # deg, vertical; a narrow one keeps the proportions
VIEW_HEIGHT = 1.75  # height of the picture over the robot's standing neck height
VIEW_FROM = 125.0  # deg to the left of the final heading, where the camera looks to
AFTERMATH = 0.3  # s of the stand that are shown

TRUNK, LEFT, RIGHT = (0.93, 0.92, 0.90), (0.95, 0.61, 0.25), (0.25, 0.48, 0.70)
SHADOW_REACH = 5.0  # m; where the shadow map ends, the ground is speckled
SHADOW_OF_TALL = 12.0  # the same in standing neck heights, for robots far taller than OP3
SOLE_SHADE = 0.72  # soles are darker than their limbs


class NoRendererError(RuntimeError):
    """No OpenGL is available for rendering."""


def pick_frames(count: int, frames: int = FRAMES) -> NDArray[np.intp]:
    """Pick rows spread evenly over ``count`` samples, from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(frames, count)).round().astype(np.intp))


def render_frames(
    robot: Robot,
    model: mujoco.MjModel,
    qpos: Array,
    *,
    azimuth: float | None = None,
    view: float = VIEW_HEIGHT,
) -> np.ndarray:
    """Render states (K, nq) as `iterate_frames` does, (K, height, width, 3)."""
    return np.array(list(iterate_frames(robot, model, qpos, azimuth=azimuth, view=view)))


def iterate_frames(
    robot: Robot,
    model: mujoco.MjModel,
    qpos: Array,
    *,
    azimuth: float | None = None,
    view: float = VIEW_HEIGHT,
    size: tuple[int, int] = FRAME_SIZE,
) -> Iterator[np.ndarray]:
    """Render states (K, nq) with a camera that follows the robot; yield (height, width, 3) each.

    Without an azimuth [deg], the view is obliquely from the front of the robot's final heading.
    The height of the picture is ``view`` times the robot's standing neck height.
    """
    width, height = size
    model = paint(robot, model)
    data, layout = mujoco.MjData(model), robot.layout(model)
    seen = np.flatnonzero(_is_robots(robot, model))
    if azimuth is None:
        ahead = quaternion.rotate(qpos[-1, layout.root_orientation], np.array([1.0, 0.0, 0.0]))
        azimuth = float(np.degrees(np.arctan2(ahead[1], ahead[0]))) - VIEW_FROM
    camera = _make_camera(robot, azimuth, view)
    with _open(model, height, width) as renderer:
        for state in qpos:
            data.qpos[:] = state
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_camlight(model, data)
            points = data.geom_xpos[seen]
            camera.lookat[:] = 0.5 * (points.min(axis=0) + points.max(axis=0))
            renderer.update_scene(data, camera)
            yield renderer.render().copy()


def save_run(
    robot: Robot, model: mujoco.MjModel, qpos: Array, end: float, path: Path, *, title: str = ""
) -> None:
    """Save states (T, nq), one a control period, up to row ``end`` and the last one, as PNG."""
    last = len(qpos) - 1
    rows = np.union1d(pick_frames(round(min(last, end)), FRAMES - 1), [last])
    pictures = render_frames(robot, model, qpos[rows])
    save_strip(pictures, rows * robot.control_period, path, title=title)


def save_strip(pictures: np.ndarray, times: ArrayLike, path: Path, *, title: str = "") -> None:
    """Save pictures (K, height, width, 3) taken at ``times`` [s] as PNG, row by row."""
    save_sheet(pictures, [f"{time:.1f} s" for time in np.asarray(times)], path, title=title)


def save_sheet(
    pictures: np.ndarray, captions: Sequence[str], path: Path, *, title: str = ""
) -> None:
    """Save pictures (K, height, width, 3) with a caption each as PNG, row by row."""
    columns = min(COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    head = 0.34 if title else 0.0
    size = (columns * INCH, rows * INCH + head)
    figure = make_figure(*size, layout=None)
    if title:
        place = {"x": 0.5, "y": 1.0 - 0.5 * head / size[1], "ha": "center", "va": "center"}
        figure.text(**place, s=title, fontsize=10, parse_math=False)
    for k, (picture, caption) in enumerate(zip(pictures, captions, strict=True)):
        row, column = divmod(k, columns)
        corner = (column * INCH / size[0], (rows - 1 - row) * INCH / size[1])
        extent = ((INCH - GAP) / size[0], (INCH - GAP) / size[1])
        axis = figure.add_axes((*corner, *extent))
        axis.imshow(picture, interpolation="lanczos", aspect="auto")
        axis.set_axis_off()
        place = {"x": 0.05, "y": 0.94, "transform": axis.transAxes, "va": "top"}
        axis.text(**place, s=caption, fontsize=8, parse_math=False)
    save_figure(figure, path, dpi=200)


def _make_camera(robot: Robot, azimuth: float, view: float) -> mujoco.MjvCamera:
    """Make a camera in whose picture the robot fits, lying or standing."""
    camera = mujoco.MjvCamera()
    seen = view * robot.standing_neck_height
    camera.distance = 0.5 * seen / np.tan(np.radians(0.5 * FIELD_OF_VIEW))
    camera.azimuth, camera.elevation = azimuth, -24.0
    return camera


def _open(model: mujoco.MjModel, height: int, width: int) -> mujoco.Renderer:
    try:
        return mujoco.Renderer(model, height=height, width=width)
    except Exception as error:  # GL back ends raise errors of any type
        reason = " ".join(str(error).split())
        wish = os.environ.get("MUJOCO_GL", "")
        if isinstance(error, AttributeError):  # MUJOCO_GL disables rendering
            reason = "it is switched off"
        raise NoRendererError(f"no GL to render with (MUJOCO_GL={wish}): {reason}") from error


def paint(robot: Robot, model: mujoco.MjModel) -> mujoco.MjModel:
    """Color trunk, left and right limbs differently, in a copy of the model."""
    model = copy.copy(model)
    model.vis.global_.fovy = FIELD_OF_VIEW
    reach = max(SHADOW_REACH, SHADOW_OF_TALL * robot.standing_neck_height)
    model.vis.map.shadowclip = reach / model.stat.extent
    color = np.tile(TRUNK, (model.nbody, 1))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    torso = robot.layout(model).torso
    for name, mirror in zip(robot.joint_names, robot.mirror_index, strict=True):
        body = int(model.joint(name).bodyid[0])
        if robot.joint_names[mirror] != name:
            is_left = data.xpos[body, 1] > data.xpos[torso, 1]
            color[body] = LEFT if is_left else RIGHT
    soles = {int(model.site(site).bodyid[0]) for site in robot.sole_sites}
    for geom in np.flatnonzero(_is_robots(robot, model) & (model.geom_matid < 0)):
        body = int(model.geom_bodyid[geom])
        shade = SOLE_SHADE if body in soles else 1.0
        model.geom_rgba[geom, :3] = shade * color[body]
    return model


def _is_robots(robot: Robot, model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Find which geoms belong to the robot, (ngeom,)."""
    root = model.body_rootid[robot.layout(model).torso]
    return np.asarray(model.body_rootid[model.geom_bodyid] == root)
