"""Train with style curves, each time without one of the things that are said to matter.

On flat ground, each from nothing: imitation, then as many policy steps.

- whole: the recipe styled-quick;
- plain VAE: encoder and decoder of the prior do not get the style features;
- no VAE: latent parameters are joint angles themselves, as sums and differences of both sides;
- no motion starts: episodes after the imitation begin with falls instead;
- no assistive force, and with it costs that count in full from the beginning;
- no imitation.

On the terrain, each from the same policy:

- terrain: the recipe styled;
- all open: without the curriculum, robots on all levels at once;
- no restarts: a robot that deviates from its curves ends its episode;
- no ankle balance (an exported policy would have it again).

    python benchmarks/style_ablations.py --prior out/prior --parent out/styled --out out/ablations

Every training writes its progress.csv below `--out`; the same command continues. `--draw FILE`
draws the average return rates, [Frezzato22], section 6.4.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from humanoid_getup.style.features import COUNT
from robots import Robot, load_robot
from robots.quaternion import Array
from robots.storage.files import write_atomically
from sim2real.environment.starts import terrain
from sim2real.environment.styled import ankle_balance
from sim2real.pose_prior.pose_prior import Network, PosePrior
from sim2real.pose_prior.rise_set import RiseSet
from sim2real.prior_training.fit import FitOptions, Postures, fit_prior
from sim2real.training import imitation
from sim2real.training.config import FLAT_STYLE, RECIPES, STEPS, Recipe
from sim2real.training.iteration_log import TrainReport
from sim2real.training.networks.symmetric_model import split
from sim2real.training.runner import TrainingRunner
from sim2real.training.styled_training import PRIOR, RISES
from sim2real.training.train import POOL, PROGRESS, TrainingInputs, train

NEARLY_LINEAR = 1e-2  # input of a hyperbolic tangent, which it changes by 3e-5 of it
ROUNDS = 6  # of imitation; the recipe has more
SMOOTH = 10  # iterations that are averaged in the picture


@dataclass(frozen=True, kw_only=True)
class Options:
    """Train without one thing at a time."""

    prior: Path
    """Folder of the pose prior."""
    parent: Path | None = None
    """Training or policy file that those on the terrain begin with; none without."""
    out: Path
    robot: str = "op3"
    seed: int = 0
    steps: int = 1_000_000
    """Policy steps of each training, after its imitation."""
    only: tuple[str, ...] = ()
    draw: Path | None = None


@dataclass(frozen=True)
class Ablation:
    """A training without one thing."""

    recipe: Recipe
    prior: str = "conditional"
    imitates: bool = True
    changes: tuple[tuple[object, str, object], ...] = ()
    """Owners of constants, their names, and their values meanwhile."""


def list_ablations() -> dict[str, Ablation]:
    """List the trainings on flat ground, and after them those on the terrain."""
    quick, whole = RECIPES["styled-quick"], RECIPES["styled"]
    styled = whole.style or FLAT_STYLE
    still = replace(FLAT_STYLE, motions=0.0, falls=FLAT_STYLE.falls + FLAT_STYLE.motions)
    return {
        "whole": Ablation(quick),
        "plain VAE": Ablation(quick, prior="plain"),
        "no VAE": Ablation(quick, prior="none"),
        "no motion starts": Ablation(replace(quick, style=still)),
        "no assistive force": Ablation(replace(quick, lift=0.0)),
        "no imitation": Ablation(quick, imitates=False),
        "terrain": Ablation(whole),
        "terrain, all open": Ablation(whole, changes=((terrain, "TO_OPEN", 0),)),
        "terrain, no restarts": Ablation(replace(whole, style=replace(styled, restarts=0.0))),
        "terrain, no ankle balance": Ablation(
            whole, changes=((ankle_balance, "GAINS", np.zeros(2)),)
        ),
    }


def make_joint_prior(postures: Postures) -> PosePrior:
    """Make a prior whose latent parameters are joint angles, in their standard deviations.

    Each is a sum or a difference of the two sides, so that it is symmetric or antisymmetric.
    """
    robot = postures.robot
    kept, turned = (
        rows.numpy().astype(float)
        for rows in split((robot.mirror_index.tolist(), robot.mirror_sign.tolist()))
    )
    rows = np.concatenate([kept, turned])
    k = len(rows)

    def layers(first: Array, last: Array) -> Network:
        weights: Any = (NEARLY_LINEAR * first, np.eye(k), last / NEARLY_LINEAR)
        weights = tuple(weight.astype(np.float32) for weight in weights)
        return Network(weights, tuple(np.zeros_like(weight[:, 0]) for weight in weights))

    unused = np.zeros((k, COUNT))
    return PosePrior(
        robot=robot,
        latent_sign=np.repeat([1.0, -1.0], [len(kept), len(turned)]),
        latent_mean=np.zeros(k),
        latent_std=np.ones(k),
        pos_mean=postures.pos_mean,
        pos_std=postures.pos_std,
        feature_mean=postures.feature_mean,
        feature_std=postures.feature_std,
        encoder=layers(
            np.concatenate([rows, unused], axis=1), np.concatenate([np.eye(k), np.zeros((k, k))])
        ),
        decoder=layers(np.concatenate([np.eye(k), unused], axis=1), rows.T),
    )


def make_prior(robot: Robot, kind: str, source: Path, seed: int, folder: Path) -> Path:
    """Write a folder with the rises and a prior of a kind; return it."""
    if kind == "conditional":
        return source
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / RISES, (source / RISES).read_bytes())
    if not (folder / PRIOR).exists():
        rises = RiseSet.load(source / RISES, robot)
        postures = Postures.of(rises)
        plain = FitOptions(conditional=False)
        made = make_joint_prior(postures) if kind == "none" else fit_prior(postures, seed, plain)
        made.save(folder / PRIOR)
    return folder


@contextmanager
def changed(owner: object, name: str, value: object) -> Iterator[None]:
    """Let something have another value for a while."""
    usual = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, usual)


def run(
    robot: Robot,
    ablation: Ablation,
    options: Options,
    folder: Path,
    report: Callable[[TrainReport], None],
) -> None:
    """Train as an ablation asks for."""
    recipe = ablation.recipe
    recipe = replace(recipe, iterations=max(options.steps // (STEPS * recipe.robots), 1))
    kind = ablation.prior
    prior = make_prior(robot, kind, options.prior, options.seed, options.out / f"prior, {kind}")
    begin = TrainingRunner.imitate if ablation.imitates else _only_fit_critic
    changes = (
        (imitation, "PARTS", ROUNDS),
        (TrainingRunner, "imitate", begin),
        *ablation.changes,
    )
    pool = options.out / f"{'terrain' if recipe.terrain else 'flat'} {POOL}"
    folder.mkdir(parents=True, exist_ok=True)
    if pool.exists():  # all begin with the same falls
        write_atomically(folder / POOL, pool.read_bytes())
    with ExitStack() as stack:
        for change in changes:
            stack.enter_context(changed(*change))
        train(
            robot,
            recipe,
            options.seed,
            folder,
            TrainingInputs(parent=options.parent if recipe.terrain else None, prior=prior),
            report,
        )
    write_atomically(pool, (folder / POOL).read_bytes())


def _only_fit_critic(runner: TrainingRunner, seed: int) -> list[float]:
    """Begin without imitation: statistics and critic are those of random weights."""
    observed = runner.env.get_observations()
    for model in (runner.alg.actor, runner.alg.critic):
        model.update_normalization(observed)
    return runner.fit_critic(seed)


def draw(folders: dict[str, Path], file: Path) -> None:
    """Draw the average return rate of trainings over their policy steps."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(11.0, 4.0), layout="constrained", sharey=True)
    for name, folder in folders.items():
        if not (folder / PROGRESS).exists():
            continue
        with (folder / PROGRESS).open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        rate = np.array([float(row["return_rate"]) for row in rows])
        if len(rate) < SMOOTH:
            continue
        smooth = np.convolve(rate, np.ones(SMOOTH) / SMOOTH, mode="valid")
        steps = np.array([float(row["steps"]) for row in rows])[SMOOTH - 1 :]
        panels[int(name.startswith("terrain"))].plot(steps / 1e6, smooth, label=name)
    for panel, title in zip(panels, ("flat ground", "terrain"), strict=True):
        panel.set(xlabel="policy steps [million]", title=title)
        panel.grid(alpha=0.3)
        panel.legend()
    panels[0].set_ylabel("average return rate")
    figure.savefig(file, dpi=120)


def main(options: Options) -> None:
    """Train what is asked for, and draw it."""
    robot, ablations = load_robot(options.robot), list_ablations()
    folders = {name: options.out / name for name in ablations}
    if unknown := set(options.only) - set(ablations):
        raise SystemExit(f"--only is {', '.join(unknown)}, expected {', '.join(ablations)}")
    for name, ablation in ablations.items():
        if options.only and name not in options.only:
            continue
        if name.startswith("terrain") and options.parent is None:
            continue
        reports: list[TrainReport] = []
        run(robot, ablation, options, folders[name], reports.append)
        last = reports[-10:]
        if last:
            stood = sum(r.stood for r in last) / max(sum(r.falls for r in last), 1)
            rate = float(np.mean([r.return_rate for r in last]))
            print(f"{name:20} return rate {rate:.3f}, {stood:.0%} of falls stand", flush=True)
    if options.draw is not None:
        draw(folders, options.draw)


if __name__ == "__main__":
    main(tyro.cli(Annotated[Options, tyro.conf.arg(name="")], config=(tyro.conf.OmitArgPrefixes,)))
