"""Play every stored motion: time, load, lowest torque limit, and robustness.

Each from its own start: undisturbed, under falling torque limits, and disturbed (start angles by 3°
and the root by 5°, standard deviations; friction 0.4 to 1.2, supply 11.0 to 12.6 V, uniform).

    python benchmarks/play_motions.py --n 50 --json motions.json
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import tyro
from script import LOAD_FIGURES, Options, do_pieces, write_results

from humanoid_getup.benchmarks.motions import MotionPiece, MotionSummary, measure_motion
from humanoid_getup.motions.motion import MIRRORED_SUFFIX
from humanoid_getup.motions.motion_database import load_database

FIGURES = (*LOAD_FIGURES, "lowest_torque_limit_nm", "disturbed_succeeded", "disturbed_n")


@dataclass(frozen=True, kw_only=True)
class MotionOptions(Options):
    """Options of this script."""

    n: int = 50
    """Disturbed plays of each motion."""
    motions: tuple[str, ...] = ()
    """Names of motions; default: all but mirror images."""


def main(options: MotionOptions) -> None:
    """Measure, and write the figures of every motion."""
    stored = load_database(options.load_robot()).motions
    own = [motion for motion in stored if not motion.name.endswith(MIRRORED_SUFFIX)]
    pieces = [
        MotionPiece(motion=motion, number=number, seed=options.seed, each=options.n)
        for number, motion in enumerate(own)
        if not options.motions or motion.name in options.motions
    ]
    found = do_pieces(partial(play_motion, options), pieces, options)
    cases = {piece.motion.name: figures for piece, figures in zip(pieces, found, strict=True)}
    result = options.describe("motions", options.n) | {"cases": cases}
    write_results(result, FIGURES, options.json)


def play_motion(options: MotionOptions, piece: MotionPiece) -> MotionSummary:
    """Play a motion undisturbed and disturbed."""
    return measure_motion(load_world(options), piece, threads=options.threads)


load_world = lru_cache(maxsize=1)(MotionOptions.load_world)


if __name__ == "__main__":
    main(tyro.cli(MotionOptions, description=__doc__))
