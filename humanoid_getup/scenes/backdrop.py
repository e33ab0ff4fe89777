"""Backdrop for pictures of a scene: sky, light, and a pattern on the ground."""

from __future__ import annotations

import mujoco

from robots.ground import GROUND

PICTURE = (1920, 1440)  # largest off-screen picture, pixels


def add_backdrop(spec: mujoco.MjSpec, ground: mujoco.MjsGeom) -> None:
    """Add sky and light to a model, and a pattern to its ground."""
    _add_sky(spec)
    _add_light(spec)
    _add_pattern(spec, ground)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = PICTURE
    spec.stat.extent = 1.0


def _add_pattern(spec: mujoco.MjSpec, ground: mujoco.MjsGeom) -> None:
    spec.add_texture(
        name=GROUND,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.86, 0.87, 0.89],
        rgb2=[0.78, 0.80, 0.83],
        mark=mujoco.mjtMark.mjMARK_EDGE,
        markrgb=[0.70, 0.72, 0.75],
        width=300,
        height=300,
    )
    material = spec.add_material(name=GROUND, texrepeat=[5, 5], texuniform=True, reflectance=0.05)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = GROUND
    ground.material = GROUND
    ground.rgba[:] = 1.0


def _add_sky(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.96, 0.97, 0.98],
        rgb2=[0.78, 0.84, 0.90],
        width=256,
        height=1536,
    )


def _add_light(spec: mujoco.MjSpec) -> None:
    spec.worldbody.add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.8, 0.6, 3.0],
        dir=[-0.25, -0.2, -1.0],
        diffuse=[0.55, 0.55, 0.55],
        specular=[0.2, 0.2, 0.2],
    )
    spec.visual.headlight.ambient[:] = 0.38
    spec.visual.headlight.diffuse[:] = 0.30
    spec.visual.headlight.specular[:] = 0.05
    spec.visual.quality.shadowsize = 4096
