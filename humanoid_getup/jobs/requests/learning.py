"""Requests to make a pose prior, to train, to export and to evaluate a policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.commands.files import FOLDER, MADE, READ, ROBOT, Written
from humanoid_getup.commands.options import (
    EngineOptions,
    PolicyName,
    RobotOption,
    SceneOptions,
    Seed,
    TorqueOptions,
)
from humanoid_getup.commands.output_files import find_file_problems
from humanoid_getup.commands.values import Items, at_least, between

MOST_THREADS = 256
POLICY_FILE, DESCRIPTION_FILE = "policy.onnx", "description.json"


@dataclass(frozen=True, kw_only=True)
class PriorRequest(EngineOptions, RobotOption):
    """Plan many rises and fit the pose prior of styled policies to them."""

    out: Annotated[Path, FOLDER, arg(metavar="DIR")]
    """Folder for prior.npz, rises.npz and the planned motions; the same command continues."""
    rises: Annotated[int, at_least(4, step=4)] = 1000
    """Number of rises to plan, equally many of each class; policies add half as many."""
    policies: Annotated[tuple[str, ...], READ, Items(none=True), arg(metavar="POLICY,...")] = (
        "robust",
        "gentle",
    )
    """Policies of the robot whose rises are added; '' for none."""
    epochs: Annotated[int, at_least(1)] = 100
    """Passes over the postures."""
    fitted: Annotated[Path | None, READ, arg(metavar="FILE.npz")] = None
    """Keep a prior that was fitted before, and only collect rises."""
    seed: Seed = 0


@dataclass(frozen=True, kw_only=True)
class TrainRequest(RobotOption):
    """Train a policy that gets the robot up; the same command again continues a training."""

    out: Annotated[Path, FOLDER, arg(metavar="DIR")]
    """Folder for checkpoint, progress and TensorBoard files."""
    recipe: Literal["quick", "backwards", "robust", "gentle", "rough", "styled-quick", "styled"] = (
        "quick"
    )
    """Training recipe."""
    parent: Annotated[Path | None, READ, arg(metavar="DIR|FILE.onnx")] = None
    """Folder of a training whose policy is the initial one, or a policy file (.onnx) with the same
    actions; default: random weights."""
    prior: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder of a pose prior, see `getup prior`, for a training with style curves."""
    seed: Seed = 0
    threads: Annotated[int, at_least(0, at_most=MOST_THREADS)] = 0
    """Threads that step physics; 0: all of the machine."""
    device: str = "cpu"
    """Device of the networks: cpu or cuda."""
    physics: Literal["mujoco", "warp"] = "mujoco"
    """Engine that steps physics: mujoco on the processor, or warp (mujoco-warp) on a GPU: that of
    the networks, else the first one, else the processor, which is slow."""
    iterations: Annotated[int | None, at_least(1)] = None
    """Updates of the policy; default: the recipe's."""
    robots: Annotated[int | None, at_least(1)] = None
    """Number of robots that are simulated at once; default: the recipe's."""
    overlap: bool = False
    """Collect the next steps while the networks learn from the last ones, in one process."""


@dataclass(frozen=True, kw_only=True)
class ExportRequest(RobotOption):
    """Export the policy of a training, as far as it has come, to one ONNX file."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of the training."""
    out: Annotated[Path, MADE, arg(metavar="FILE")]
    """ONNX file to write; an existing file is replaced."""
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: the training's."""


@dataclass(frozen=True, kw_only=True)
class EvaluateRequest(EngineOptions, TorqueOptions, SceneOptions):
    """Evaluate a policy on settled falls that no training saw, by class, with intervals."""

    policy: Positional[PolicyName]
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: that of a policy file, else op3."""
    scene: Annotated[str, READ, arg(metavar="SCENE,...")] = "flat"
    """Names of scenes, see `getup scenes`, or scene files (.toml), with commas between them."""
    style: Annotated[str | None, READ, arg(metavar="STYLE,...")] = None
    """Styles that a policy with style curves follows, with commas between them: names, files,
    planned for the curves of a motion that is planned for each fall, or nearest, the default: of
    the named styles that begin nearest to the robot, the one that turns it least."""
    height_map: bool = False
    """Let a policy with a height map observe the ground; otherwise it assumes level ground."""
    n: Annotated[int, at_least(4, step=4)] = 1000
    """Number of falls in each scene, equally many of each class. Rough ground is another one for
    every four of them, unless they are read from a file."""
    falls: Annotated[Path | None, READ, arg(metavar="FILE")] = None
    """File of falls: read if it exists, else written."""
    delay: Annotated[float, between(0.0, 60.0, "ms"), arg(metavar="MS")] = 0.0
    """Delay of targets on their way to the servos [ms]."""
    voltage: Annotated[float | None, between(1.0, 30.0, "V"), arg(metavar="V")] = None
    """Supply voltage [V]; default: the robot's nominal one."""
    friction: Annotated[float | None, between(0.01, 10.0)] = None
    """Sliding friction coefficient of every contact; default: the scene's."""
    mass: Annotated[float, between(0.1, 10.0), arg(metavar="FACTOR")] = 1.0
    """Factor on the mass of every link."""
    backlash: Annotated[float, between(0.0, 10.0, "deg"), arg(metavar="DEG")] = 0.0
    """Backlash of every gear [deg]."""
    weak_servo: Annotated[float, between(0.0, 1.0), arg(metavar="FACTOR")] = 1.0
    """Factor on the torque of one servo, a different one in each robot."""
    push: Annotated[float, between(0.0, 10.0, "m/s"), arg(metavar="M/S")] = 0.0
    """Velocity change by a push in a random direction, once a second [m/s]."""
    imu_tilt: Annotated[float, between(0.0, 90.0, "deg"), arg(metavar="DEG")] = 0.0
    """Mounting error of the IMU about a random axis [deg]."""
    gyro_bias: Annotated[float, between(0.0, 360.0, "deg/s"), arg(metavar="DEG/S")] = 0.0
    """Bias of the gyro about a random axis [deg/s]."""
    noise: bool = False
    """Add the sensor noise of training."""
    variant: (
        Literal[
            "1 ms steps",
            "elliptic cones",
            "other solver",
            "soft contacts",
            "capsules",
            "menagerie servos",
        ]
        | None
    ) = None
    """Model variant to evaluate in; default: the physics of training."""

    def find_problems(self) -> list[str]:
        """Report files that cannot be written."""
        problems = super().find_problems()
        return problems if self.falls is None else problems + find_file_problems(self.falls)


@dataclass(frozen=True, kw_only=True)
class ImportPolicyRequest(RobotOption):
    """Make a policy that was trained elsewhere one that runs here.

    What describes it is read from its metadata (mjlab, microduck) or from Isaac Lab's env.yaml,
    each field with its source; nothing in these files is run.
    """

    network: Annotated[Positional[Path], READ, arg(metavar="FILE")]
    """Network that was trained elsewhere (.onnx)."""
    out: Annotated[Path, Written((POLICY_FILE, DESCRIPTION_FILE)), arg(metavar="DIR")]
    """Folder for policy.onnx and description.json."""
    config: Annotated[Path | None, READ, arg(metavar="FILE.yaml")] = None
    """Isaac Lab's env.yaml, for a policy that was trained with it."""
    joints: Annotated[tuple[str, ...], arg(metavar="NAME,...")] = ()
    """Names of its joints in the order of the simulator, which an env.yaml does not state."""
    rename: Annotated[tuple[str, ...], Items(), arg(metavar="THEIRS=OURS,...")] = ()
    """Joints that the robot calls otherwise; sides (left, l) and the word joint need none."""
    rate: Annotated[float | None, between(0.1, 10_000.0, "Hz"), arg(metavar="HZ")] = None
    """Policy steps per second [Hz]; default: what is described, or 50 for mjlab."""
    gain: Annotated[float | None, between(1e-3, 1e4, "N·m/rad"), arg(metavar="N·m/rad")] = None
    """Position gain of all joints in its training [N·m/rad]; default: what is described."""

    def find_problems(self) -> list[str]:
        """Report names without an equals sign as well."""
        problems = super().find_problems()
        wrong = [pair for pair in self.rename if len(pair.split("=")) != 2 or "" in pair.split("=")]
        if wrong:
            problems.append(f"--rename is {', '.join(wrong)}, expected THEIRS=OURS,...")
        return problems


@dataclass(frozen=True, kw_only=True)
class CheckPolicyRequest(RobotOption):
    """Compare a policy with a trace of it: observations and actions.

    Terms and joints that differ are named, each with its likely cause.
    """

    policy: Positional[PolicyName]
    trace: Annotated[Path, READ, arg(metavar="FILE.npz")]
    """What the program that trained it measured, observed and did, policy step by policy step."""
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: that of a policy file, else op3."""
