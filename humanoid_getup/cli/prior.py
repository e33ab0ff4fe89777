"""`getup prior`: plan rises, and fit the pose prior to them."""

from __future__ import annotations

from humanoid_getup.cli.errors import needing, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import load_robot
from humanoid_getup.cli.options.prior import MakePrior
from humanoid_getup.cli.output import console_for, counting, phase


def make_prior(command: MakePrior) -> int:
    """Collect rises, fit the prior, write both."""
    robot = load_robot(command)
    with phase("loading torch"), needing("train"):
        from sim2real.pose_prior.pose_prior import PosePrior
        from sim2real.pose_prior.rise_set import RiseSet
        from sim2real.prior_training.collect import collect_rises, load_policy
        from sim2real.prior_training.fit import FitOptions, Postures, fit_prior
        from sim2real.training.styled_training import PRIOR, RISES
    with phase("loading"), refusing():
        policies = {name: load_policy(robot, name) for name in command.policies}
        fitted = PosePrior.load(command.fitted, robot) if command.fitted else None
    with refusing():
        with counting("rises", command.rises) as count:
            found = collect_rises(
                robot,
                command.rises,
                command.seed,
                command.out,
                policies,
                jobs=command.jobs,
                report=count,
            )
        rises = RiseSet.join(robot, found)
        told, prior = "", fitted
        if prior is None:
            errors: list[float] = []
            with counting("epochs", command.epochs) as count:

                def note(_epoch: int, error: float) -> None:
                    errors.append(error)
                    count(1)

                prior = fit_prior(
                    Postures.of(rises), command.seed, FitOptions(epochs=command.epochs), note
                )
            told = f"; the decoder leaves {100.0 * errors[-1]:.1f} % of the variance"
        rises.save(command.out / RISES)
        prior.save(command.out / PRIOR)
    console_for(None).print(
        f"{command.out}: {len(rises)} rises, {len(rises.qpos)} postures; {prior.size} latent "
        f"parameters{told}"
    )
    return DID_IT
