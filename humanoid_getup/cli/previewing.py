"""`getup motions preview`: the keys of a motion as they are, drawn and played once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.markup import escape

from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.inputs import find_keyframes, load_robot
from humanoid_getup.cli.options.own_motions import PreviewMotion
from humanoid_getup.cli.output import console_for, find_file_faults, phase
from humanoid_getup.motions.build import try_out
from humanoid_getup.motions.trial import Trial
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import lowest_point, place
from robots.quaternion import Array


def preview(command: PreviewMotion) -> int:
    """Play the keys once and draw them; 0 if that ends as it should."""
    robot = load_robot(command)
    (keyframes,) = find_keyframes(robot, [command.name], command.keyframes)
    path = command.picture or Path(f"{keyframes.name}.png")
    if faults := find_file_faults(path):
        raise BadInputError("; ".join(faults))
    console = console_for(None)
    with phase("playing the keys"):
        trial = try_out(World(robot, FLAT_SCENE), keyframes)
    console.print(f"{keyframes.name}, as it is: {escape(trial.describe())}")
    try:
        with phase("drawing"):
            draw(trial, path)
        console.print(f"film strip in {path}", markup=False)
    except film_strip.NoRendererError as error:
        console.print(f"no film strip: {error}", markup=False)
    return DID_IT if trial.succeeded else DID_NOT_STAND


def draw(trial: Trial, path: Path) -> None:
    """Draw each key upright on the ground, then the rollout, as a PNG file.

    Raises:
        NoRendererError: if there is no OpenGL.
    """
    robot, model, keyframes = trial.world.robot, trial.world.model, trial.keyframes
    times = np.concatenate([[0.0], np.cumsum(keyframes.duration)])
    keys = np.array([_stand_up(trial, key) for key in keyframes.keys])
    end = trial.stand.start_time + film_strip.AFTERMATH if trial.rises else np.inf
    qpos = trial.trace.qpos[0]
    rows = film_strip.pick_frames(int(np.fmin(end / trial.trace.period, len(qpos))))
    pictures = np.concatenate(
        [
            film_strip.render_frames(robot, model, keys),
            film_strip.render_frames(robot, model, qpos[rows]),
        ]
    )
    captions = [f"key {k + 1}: {time:.2f} s" for k, time in enumerate(times)]
    captions += [f"{(row + 1) * trial.trace.period:.1f} s" for row in rows]
    ending = "ends as it should" if trial.succeeded else "fails"
    title = f"{keyframes.name}: its keys without physics, then played: {ending}"
    film_strip.save_sheet(pictures, captions, path, title=title)


def _stand_up(trial: Trial, joint_pos: Array) -> Array:
    """Place joint angles with the torso as in the stance, the lowest point on the ground."""
    robot, model = trial.world.robot, trial.world.model
    posture = Posture(
        position=np.zeros(3), orientation=robot.standing.orientation, joint_pos=joint_pos
    )
    qpos = place(robot, model, posture)
    qpos[robot.layout(model).root_qpos + 2] -= lowest_point(model, qpos)
    return qpos
