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


def test_torso_ends_where_its_mesh_does(world: World, mesh_world: World):
    """Support functions of the convex hulls: the planes that touch the torso from outside."""
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(1000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    error = support(world, "body_link", direction) - support(mesh_world, "body_link", direction)
    assert np.abs(error).mean() < 0.002  # 8.8 mm with a bounding box
    assert error.min() > -0.006


def support(world: World, link: str, direction: np.ndarray) -> np.ndarray:
    """Measure how far a link reaches in each direction of its frame (N, 3) [m], (N,)."""
    model = world.model
    body, reach = model.body(link), np.full(len(direction), -np.inf)
    for geom in range(body.geomadr[0], body.geomadr[0] + body.geomnum[0]):
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        own = direction @ turn.reshape(3, 3)
        size, kind = model.geom_size[geom], model.geom_type[geom]
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            far = np.abs(own) @ size
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            far = size[0] + np.abs(own[:, 2]) * size[1]
        else:
            mesh = model.mesh(model.geom_dataid[geom])
            first = mesh.vertadr[0]
            far = (own @ model.mesh_vert[first : first + mesh.vertnum[0]].T).max(axis=1)
        reach = np.maximum(reach, far + direction @ model.geom_pos[geom])
    return reach


def test_the_exchanged_shapes_are_the_only_difference(world: World, mesh_world: World):
    own, mesh = world.model, mesh_world.model
    np.testing.assert_array_equal(own.body_mass, mesh.body_mass)
    np.testing.assert_array_equal(own.body_inertia, mesh.body_inertia)
    np.testing.assert_array_equal(own.jnt_range, mesh.jnt_range)
    assert np.any(mesh.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
