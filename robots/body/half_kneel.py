"""Half-kneel: one sole flat on the ground, the other knee and its toes as well, no hands."""

from __future__ import annotations

import numpy as np

from robots.body.limbs import LEGS, Limbs
from robots.body.shapes import sample_shapes
from robots.body.squats import (
    CLOSE,
    ROUGH,
    BothLegs,
    find_overlaps_but_arms,
    fit_posture,
)
from robots.posture import Posture
from robots.quaternion import Array, from_matrix, normalize
from robots.robot import Robot

HALF_KNEEL = "half-kneel"
TRIES = 40
SPREAD = 0.9  # rad, of the angles from which a fit begins
LEANS = (-0.1, 0.35)  # sines of the torso's lean forward
LEAST_SHANK = 0.25  # leg lengths by which the knee is at least in front of the ankle
KNEE_SHARE = 0.35  # of the way from the front sole to the other knee, where the weight is
LEAN, BALANCE = 1.0, 3.0  # weights, beside `CLOSE` of what has to touch the ground
SOLVED = 0.02  # leg lengths that a knee, toes or any body may be off the ground, or below it


def fit_half_kneels(robot: Robot) -> list[Posture]:
    """Fit half-kneels with the left foot in front, the nearest to the stance first.

    Raises:
        ValueError: if the legs do not bend so far.
    """
    found = HalfKneelFit(Limbs(robot)).draw(np.random.default_rng(0))
    if not found:
        raise ValueError(f"robot '{robot.name}' has no posture '{HALF_KNEEL}', expected another")
    return found


class HalfKneelFit:
    """Fits the legs of a robot to half-kneels with its left foot in front."""

    def __init__(self, limbs: Limbs) -> None:
        self._limbs, self._both, model = limbs, BothLegs(limbs), limbs.model
        self._home = limbs.robot.standing.joint_pos
        self._usual = find_overlaps_but_arms(limbs, self._home)
        back = limbs.all[LEGS[1]]
        assert back.sole is not None
        self._knee = back.middle
        self._ankle = back.middle if back.end is None else back.end
        shank = int(model.jnt_bodyid[limbs.ids[back.middle]])
        thigh = int(model.body_parentid[shank])
        weld = model.body_weldid
        at = {
            "knee": (weld[shank], weld[thigh]),
            "toes": (weld[model.site_bodyid[back.sole]],),
        }
        shapes = {k: sample_shapes(model, k) for k in range(1, model.nbody)}
        self._points = np.concatenate(list(shapes.values()))
        self._bodies = np.repeat([*shapes], [len(points) for points in shapes.values()])
        self._touching = [np.isin(weld[self._bodies], bodies) for bodies in at.values()]

    def draw(self, rng: np.random.Generator) -> list[Posture]:
        """Fit postures from random angles; list those that fit, the nearest to the stance first."""
        found = [self._fit(rng) for _ in range(TRIES)]
        sound = [each for each in found if each is not None]
        return sorted(sound, key=lambda each: float(np.sum((each.joint_pos - self._home) ** 2)))

    def _fit(self, rng: np.random.Generator) -> Posture | None:
        both, home = self._both, self._home
        lean = rng.uniform(*LEANS)
        start = home[both.joints] + rng.normal(scale=SPREAD, size=len(both.joints))
        angles = fit_posture(
            lambda values: both.look(home, values),
            lambda: self._measure(lean),
            start,
            home[both.joints],
            both.bounds,
            ROUGH,
        )
        heights = self._measure_heights()
        off = [*self._measure_touch(heights), max(-heights.min(), 0.0)]
        posture = self._read(angles)
        if np.abs(off).max() > SOLVED or self._measure_shank() < 0.0:
            return None
        if find_overlaps_but_arms(self._limbs, angles) - self._usual:
            return None
        return posture

    def _measure(self, lean: float) -> Array:
        """Measure how far the posture of the view is from a half-kneel."""
        limbs, heights = self._limbs, self._measure_heights()
        foot = limbs.leg(LEGS[0])
        axes, sole = foot.sole_axes, foot.sole_position
        middle = sole + KNEE_SHARE * (limbs.anchor(self._knee) - sole)
        over = (limbs.center_of_mass - middle) @ axes[:, :2] / self._both.length
        up = np.array([-np.sin(lean), 0.0, np.cos(lean)])
        touch = [*self._measure_touch(heights), min(self._measure_shank(), 0.0)]
        return np.concatenate(
            [
                CLOSE * np.array(touch),
                CLOSE * np.minimum(heights, 0.0),
                BALANCE * over,
                LEAN * (axes[:, 2] - up),
            ]
        )

    def _measure_heights(self) -> Array:
        """Measure points of all shapes over the plane of the front sole [leg lengths], (p,)."""
        data, foot = self._limbs.data, self._limbs.leg(LEGS[0])
        up, at = foot.sole_axes[:, 2], self._bodies
        ways = np.einsum("pij,pj->pi", data.xmat[at].reshape(-1, 3, 3), self._points)
        return (data.xpos[at] + ways - foot.sole_position) @ up / self._both.length

    def _measure_touch(self, heights: Array) -> list[float]:
        """Return the heights of the other knee and of its toes over the ground [leg lengths]."""
        return [float(heights[rows].min()) for rows in self._touching]

    def _measure_shank(self) -> float:
        """Measure how much farther than needed the knee is in front of the ankle."""
        limbs, forward = self._limbs, self._limbs.leg(LEGS[0]).sole_axes[:, 0]
        way = limbs.anchor(self._knee) - limbs.anchor(self._ankle)
        return float(way @ forward) / self._both.length - LEAST_SHANK

    def _read(self, angles: Array) -> Posture:
        """Return the posture of the view on the ground z = 0, the front sole at the origin."""
        foot = self._limbs.leg(LEGS[0])
        turn = foot.sole_axes.T
        return Posture(
            position=-turn @ foot.sole_position,
            orientation=normalize(from_matrix(turn)),
            joint_pos=angles,
        )
