"""OP3's boxes and capsules against the convex meshes of its links; skipped without these."""

import mujoco
import numpy as np
import pytest
from paths import REPOSITORY, SHARED

from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.body.overlap import overlaps_at
from robots.kinematics import place

MESHES = SHARED / "models" / "op3-mesh"
pytestmark = pytest.mark.skipif(not MESHES.exists(), reason="needs the mesh model in ../shared")
SAMPLES = 1500


@pytest.fixture(scope="module")
def mesh_world(op3: Robot) -> World:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(REPOSITORY / "benchmarks"))
        from mesh_robot import with_meshes  # pyright: ignore[reportMissingImports]
    return World(with_meshes(op3, MESHES))


def test_shapes_overlap_where_the_meshes_do(world: World, mesh_world: World, op3: Robot):
    rng = np.random.default_rng(0)
    depth = []
    scratch = mujoco.MjData(world.model), mujoco.MjData(mesh_world.model)
    for _ in range(SAMPLES):
        posture = Posture(
            position=np.array([0.0, 0.0, 1.0]),
            orientation=np.array([1.0, 0.0, 0.0, 0.0]),
            joint_pos=rng.uniform(op3.lower, op3.upper),
        )
        both = zip((world, mesh_world), scratch, strict=True)
        depth.append(
            [overlaps_at(w.model, place(w.robot, w.model, posture), data).max() for w, data in both]
        )
    own, mesh = np.array(depth).T
    clear, deep = 0.001, 0.006  # m
    assert np.sum(mesh > deep) > SAMPLES / 4
    assert np.sum((own > deep) & (mesh < clear)) <= 0.007 * SAMPLES  # 1.5 % with bounding boxes
    assert np.sum((mesh > deep) & (own < clear)) <= 0.003 * SAMPLES
