"""A made-up repository with one body: the small humanoid, with the sites that others measure."""

import pickle
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from small_humanoid import small_humanoid

from humanoid_getup.commands.robot.import_robot import ImportRequest, import_robot

NAME, PACKAGE = "small", "unified_humanoid_get_up_env"


def add_sites(spec: mujoco.MjSpec) -> None:
    """Add the sites: two of them on parts that are welded, as models have them."""
    holder = spec.body("head").add_body(name="holder", pos=[0.0, 0.0, 0.02], quat=[0.8, 0, 0, 0.6])
    holder.add_site(name="camera", pos=[0.02, 0.01, 0.03])
    sole = spec.body("left_foot").add_body(name="plate", pos=[0.015, 0.0, -0.03])
    sole.add_site(name="left_foot")
    spec.body("right_foot").add_site(name="right_foot", pos=[0.015, 0.0, -0.03])


@dataclass(frozen=True)
class Repository:
    """A copy of a repository, its body as read, and a folder with the body's robot."""

    folder: Path
    robots: Path
    model: mujoco.MjModel


def make_repository(folder: Path) -> Repository:
    """Make it in a new folder, with five starts on the back, and the robot imported from it."""
    package = folder / "theirs" / PACKAGE
    path = package / "mujoco_simulator" / "model" / f"{NAME}.xml"
    path.parent.mkdir(parents=True)
    path.write_text(small_humanoid(change=add_sites))
    import_robot(ImportRequest(model=path, out=folder / "robots" / NAME))
    model = mujoco.MjModel.from_xml_path(str(path))
    qpos = np.tile(model.qpos0, (5, 1))
    qpos[:, 2] = 0.2
    qpos[:, 3:7] = [np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0]
    qpos[:, 7:] = np.random.default_rng(0).uniform(-3.0, 3.0, (5, model.nq - 7))
    starts = package / "env" / NAME / "standup_initial_configurations.pkl"
    starts.parent.mkdir(parents=True)
    states = [[row.copy(), np.zeros(model.nu)] for row in qpos]
    starts.write_bytes(pickle.dumps(states, protocol=4))
    return Repository(folder / "theirs", folder / "robots", model)
