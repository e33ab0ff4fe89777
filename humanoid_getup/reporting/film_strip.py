"""Film strips: states, a stored motion, or keys with their rollout, in order of time."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from humanoid_getup.motions.motion import Motion
from humanoid_getup.reporting.figure import make_figure, save_figure
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import lowest_point, place
from robots.quaternion import Array

if TYPE_CHECKING:  # it optimizes, and is slow to import
    from humanoid_getup.motions.trial import Trial

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


def draw_motion(
    robot: Robot, motion: Motion, path: Path, *, scene: Scene = FLAT_SCENE, title: str = ""
) -> None:
    """Draw a motion as a film strip into a PNG file."""
    pictures, times = _render(World(robot, scene), motion, FRAMES)
    path.parent.mkdir(parents=True, exist_ok=True)
    title = title or f"{motion.name}: {motion.strategy}"
    save_strip(pictures, times, path, title=title)


def draw_motions(
    robot: Robot, motions: Sequence[Motion], path: Path, rows: Sequence[tuple[str, Array]] = ()
) -> None:
    """Draw motions into one PNG file, a row each, and rows of postures below them.

    A row of postures is its name and MuJoCo positions on flat ground, (K, nq).
    """
    pictures, captions = list[np.ndarray](), list[str]()

    def add(frames: np.ndarray, shown: list[str]) -> None:
        blank = [np.full_like(frames[:1], 255)] * (COLUMNS - len(frames))
        pictures.extend([frames, *blank])
        captions.extend([*shown, *[""] * len(blank)])

    world = World(robot, FLAT_SCENE)
    for motion in motions:
        frames, times = _render(world, motion, COLUMNS)
        add(frames, [motion.name, *(f"{time:.1f} s" for time in times[1:])])
    for name, qpos in rows:
        chosen = pick_frames(len(qpos), COLUMNS)
        add(render_frames(robot, world.model, qpos[chosen]), [name, *(f"{k}" for k in chosen[1:])])
    path.parent.mkdir(parents=True, exist_ok=True)
    save_sheet(np.concatenate(pictures), captions, path, title=f"{robot.name}: motions")


def _render(world: World, motion: Motion, frames: int) -> tuple[np.ndarray, Array]:
    """Render frames until a motion stands; return pictures and their times [s]."""
    robot, model = world.robot, world.model
    # All frames where it is not known when it stands.
    stands = motion.duration if motion.stand_time is None else motion.stand_time
    end = motion.time[0] + stands + AFTERMATH
    count = int(np.searchsorted(motion.time, min(end, motion.time[-1]), side="right"))
    rows = pick_frames(count, frames)
    qpos = np.array([place(robot, model, motion.posture(int(row))) for row in rows])
    return render_frames(robot, model, qpos), motion.time[rows] - motion.time[0]


def draw_trial(trial: Trial, path: Path) -> None:
    """Draw each key upright on the ground, then the rollout, as a PNG file."""
    robot, model, keyframes = trial.world.robot, trial.world.model, trial.keyframes
    times = np.concatenate([[0.0], np.cumsum(keyframes.duration)])
    keys = np.array([_stand_up(trial, key) for key in keyframes.keys])
    end = float(trial.stand.start_time) + AFTERMATH if trial.rises else np.inf
    qpos = trial.outcome.qpos
    rows = pick_frames(int(np.fmin(end / trial.outcome.record.period, len(qpos))))
    pictures = np.concatenate(
        [
            render_frames(robot, model, keys),
            render_frames(robot, model, qpos[rows]),
        ]
    )
    captions = [f"key {k + 1}: {time:.2f} s" for k, time in enumerate(times)]
    captions += [f"{(row + 1) * trial.outcome.record.period:.1f} s" for row in rows]
    ending = "ends as it should" if trial.succeeded else "fails"
    title = f"{keyframes.name}: its keys without physics, then played: {ending}"
    save_sheet(pictures, captions, path, title=title)


def _stand_up(trial: Trial, joint_pos: Array) -> Array:
    """Place joint angles with the torso as in the stance, the lowest point on the ground."""
    robot, model = trial.world.robot, trial.world.model
    posture = Posture(
        position=np.zeros(3), orientation=robot.standing.orientation, joint_pos=joint_pos
    )
    qpos = place(robot, model, posture)
    qpos[robot.layout(model).root_qpos + 2] -= lowest_point(model, qpos)
    return qpos
