"""Options that commands share. Nothing heavy is imported before a command runs."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from humanoid_getup.cli.checks import at_least, positive
from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.output import find_folder_faults, find_json_faults
from humanoid_getup.cli.ports import find_port_faults

if TYPE_CHECKING:
    import numpy as np

    from humanoid_getup.cli.backends import BackendChoice
    from humanoid_getup.policy.onnx_policy import OnnxPolicy
    from humanoid_getup.simulation.falls import Fall
    from humanoid_getup.simulation.world import World
    from robots import Robot

UNCLASSED = "other"  # start class of a posture that lies on no side

JsonTarget = Annotated[
    str | None,
    arg(metavar="FILE|-", help="Write the results as JSON to a file; - prints JSON alone."),
]
MotionName = Annotated[
    str,
    arg(metavar="MOTION", help="Name of a motion in the robot's database, or an .npz file."),
]
Origin = Annotated[
    str | None,
    arg(
        name="from",
        metavar="supine|prone|left|right|FILE",
        help="Start of a simulated robot: class of a sampled fall, or a posture file.",
    ),
]
PolicyName = Annotated[
    str, arg(metavar="NAME|FILE", help="Name of a policy of the robot, or an .onnx file.")
]
Ports = Annotated[tuple[str, ...], arg(metavar="PATH|NAME=PATH")]
PwmLimited = Annotated[
    bool, arg(help="Apply the torque limit as a PWM limit, as servos in position mode do.")
]
Seed = Annotated[int, at_least(0), arg(help="Random seed.")]
TorqueLimitOption = Annotated[
    float | None,
    positive("N·m"),
    arg(metavar="N·m", help="Torque limit per servo [N·m]; default: stall torque."),
]


@dataclass(frozen=True, kw_only=True)
class RobotOption:
    """Which robot."""

    robot: str = "op3"
    """Name of a robot, or a folder with a robot.toml."""

    def load_robot(self) -> Robot:
        """Load the robot."""
        from robots import load_robot

        with refusing():
            return load_robot(self.robot)


@dataclass(frozen=True, kw_only=True)
class WorldOptions(RobotOption):
    """Robot, scene, seed, and where the results go."""

    scene: str = "flat"
    """Name of a scene."""
    seed: Seed = 0
    json: JsonTarget = None

    def find_faults(self) -> list[str]:
        """Report all that is wrong beyond the type and range of single values."""
        return find_json_faults(self.json)

    def load_stage(self) -> World:
        """Check the options, then load the robot into its scene."""
        if faults := self.find_faults():
            raise BadInputError("; ".join(faults))
        from humanoid_getup.simulation.world import World

        with refusing():
            return World(self.load_robot(), self.scene)


@dataclass(frozen=True, kw_only=True)
class RunOptions(WorldOptions):
    """Options of every command that moves a robot."""

    backend: Literal["twin", "virtual", "dynamixel"] = "twin"
    """MuJoCo twin, virtual servos on a virtual bus, or a robot with Dynamixel servos."""
    port: Ports = ()
    """Serial port; for a robot with several, one NAME=PATH each. Without it, --backend virtual
    serves a virtual robot of its own."""
    release: Literal["limp", "hold"] = "limp"
    """State of the servos at the end: torque off, or holding the last position."""
    torque_limit: TorqueLimitOption = None
    realtime: bool = False
    """Run a simulated robot in real time."""
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder for report.json, motion.npz, flight.mcap, strip.png and torque.png."""

    def find_faults(self) -> list[str]:
        """Report all that is wrong beyond the type and range of single values."""
        faults = super().find_faults() + find_port_faults(self.backend, self.port)
        return faults if self.out is None else faults + find_folder_faults(self.out)

    @property
    def is_real(self) -> bool:
        """Whether the robot may be a real one."""
        return bool(self.port)

    def open_body(self, world: World) -> AbstractContextManager[BackendChoice]:
        """Open the backend."""
        from humanoid_getup.cli.backends import open_body

        return open_body(
            world,
            self.backend,
            ports=self.port,
            realtime=self.realtime,
            release=self.release,
            seed=self.seed,
        )


def find_start_faults(origin: str | None, *, is_real: bool, needs_one: bool) -> list[str]:
    """Report a start that is missing, or given for a robot that cannot be placed."""
    if is_real and origin is not None:
        return [f"--from is '{origin}', expected a simulated robot: a real one starts as it lies"]
    if needs_one and not is_real and origin is None:
        return ["--from is missing, expected supine, prone, left, right or a posture file"]
    return []


def find_start(world: World, origin: str, rng: np.random.Generator) -> Fall:
    """Sample a settled fall of a class, or load a posture file."""
    from humanoid_getup.playback.estimation import check_start
    from humanoid_getup.simulation.falls import CLASSES, Fall, classify, sample_falls
    from robots import load_posture

    with refusing():
        if origin in CLASSES:
            return sample_falls(world, {origin: 1}, rng)[0]
        path = Path(origin)
        if not path.exists():
            raise ValueError(
                f"unknown start '{origin}', expected {', '.join(CLASSES)} or a posture file"
            )
        posture = load_posture(path, world.robot)
        check_start(world, posture)
    return Fall(posture=posture, start_class=classify(posture.orientation) or UNCLASSED)


def load_policy(
    robot: Robot, name: str, torque_limit: float | None, longest: float | None = None
) -> OnnxPolicy:
    """Load a policy of a robot by name, or an .onnx file.

    Raises:
        BadInputError: if there is no such policy, or it does not fit the robot.
    """
    from humanoid_getup.policy.onnx_policy import LONGEST, OnnxPolicy, find_policy

    with refusing():
        file = find_policy(robot, name)
        return OnnxPolicy.load(file, robot, torque_limit=torque_limit, longest=longest or LONGEST)
