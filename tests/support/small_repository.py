"""A made-up repository with one body: the small humanoid, with the sites that others measure."""

import pickle
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from small_humanoid import small_humanoid

from humanoid_getup.benchmarks.bodies.published_body import PublishedBody
from humanoid_getup.jobs.import_robot import import_robot
from humanoid_getup.jobs.requests.robots import ImportRequest

SMALL = PublishedBody(name="small", head_height=0.58, specialists=(0.25, 0.75, 0.5), unseen=(0.1,))


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

    def pickle_starts(self, count: int, seed: int = 0) -> np.ndarray:
        """Write start states of random joints, on the back; return their positions (count, nq)."""
        rng = np.random.default_rng(seed)
        qpos = np.tile(self.model.qpos0, (count, 1))
        qpos[:, 2] = 0.2
        qpos[:, 3:7] = [np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0]
        qpos[:, 7:] = rng.uniform(-3.0, 3.0, (count, self.model.nq - 7))
        path = SMALL.find_starts(self.folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        states = [[row.copy(), np.zeros(self.model.nu)] for row in qpos]
        path.write_bytes(pickle.dumps(states, protocol=4))
        return qpos


def make_repository(folder: Path) -> Repository:
    """Make it in a new folder, with the robot that is imported from it."""
    path = SMALL.find_model(folder / "theirs")
    path.parent.mkdir(parents=True)
    path.write_text(small_humanoid(change=add_sites))
    import_robot(ImportRequest(model=path, out=folder / "robots" / SMALL.name))
    model = mujoco.MjModel.from_xml_path(str(path))
    found = Repository(folder / "theirs", folder / "robots", model)
    found.pickle_starts(5)
    return found
