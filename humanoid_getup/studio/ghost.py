"""Ghost: a second, translucent robot on the stage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from mjviser.conversions import merge_geoms

from humanoid_getup.studio.stage_model import GHOST

if TYPE_CHECKING:
    import viser

COLOR, OPACITY = (90, 140, 245), 0.35


class Ghost:
    """Draws the bodies of a stage's ghost; batched meshes, as of the robot, are opaque."""

    def __init__(self, server: viser.ViserServer, model: mujoco.MjModel) -> None:
        """Add its meshes, hidden."""
        self._frame = server.scene.add_frame("/ghost", show_axes=False, visible=False)
        self._bodies: dict[int, viser.MeshHandle] = {}
        for body in range(model.nbody):
            geoms = np.flatnonzero((model.geom_bodyid == body) & (model.geom_group < 3)).tolist()
            if not model.body(body).name.startswith(GHOST) or not geoms:
                continue
            mesh = merge_geoms(model, geoms)
            self._bodies[body] = server.scene.add_mesh_simple(
                f"/ghost/{body}",
                mesh.vertices,
                mesh.faces,
                color=COLOR,
                opacity=OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )

    def show(self, data: mujoco.MjData) -> None:
        """Show it where the bodies of the stage are."""
        self._frame.visible = True
        for body, handle in self._bodies.items():
            handle.position, handle.wxyz = data.xpos[body], data.xquat[body]

    def hide(self) -> None:
        """Hide it."""
        self._frame.visible = False
