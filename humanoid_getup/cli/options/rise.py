"""Options of `getup rise`, `run`, `play`, `sit` and `hold`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from humanoid_getup.cli.options.shared import CacheFolder, MoveOptions, RunOptions, StyleOption
from humanoid_getup.jobs.output_files import find_folder_problems
from humanoid_getup.jobs.requests.files import ROBOT
from humanoid_getup.jobs.requests.shared import (
    A_POLICY,
    BodyOption,
    Count,
    Keys,
    MotionName,
    PolicyName,
    PreferenceOptions,
)
from humanoid_getup.jobs.requests.values import between


@dataclass(frozen=True, kw_only=True)
class Rise(BodyOption, PreferenceOptions, RunOptions):
    """Get up from a fall: plan, filter through physics, play, judge; or run a policy."""

    attempts: Count = 3
    """Number of attempts before giving up."""
    method: Literal["plan", "policy", "auto"] = "plan"
    """Plan a motion, run a policy, or use the one with the better track record for the start."""
    policy: PolicyName | None = None
    """With --method policy or auto; default: robust, or styled with --style."""
    style: StyleOption = None
    planning: bool = True
    """Plan a collision-free path to the rising motion; otherwise interpolate."""
    filtering: bool = True
    """Filter the path through physics; otherwise play it unfiltered (simulated robots only)."""
    key: Keys = ()
    plan_cache: bool = True
    """Try the stored plan with the nearest start first, and store new plans."""
    cache_folder: CacheFolder = None

    def find_problems(self) -> list[str]:
        """Report options that do not fit the backend or each other as well."""
        problems = super().find_problems() + self._find_unused()
        if self.is_real and not self.filtering:
            problems.append("--no-filtering requires a simulated robot")
        if self.cache_folder is not None:
            owner = f"--cache-folder {self.cache_folder}"
            problems += find_folder_problems(self.cache_folder, (), owner)
        return problems

    def _find_unused(self) -> list[str]:
        """Report options of plans given for a policy, and the reverse."""
        problems = []
        if self.method == "plan" and self.policy is not None:
            problems.append(f"--policy is {self.policy}, expected --method policy or auto with it")
        given = {
            f"--prefer {self.prefer}": self.prefer != "time",
            "--search-budget": self.search_budget != PreferenceOptions.search_budget,
        }
        named = " and ".join(name for name, is_given in given.items() if is_given)
        if named and self.method == "policy":
            problems.append(f"{named}: expected --method plan or auto with it")
        if self.style is not None and self.method != "policy":
            problems.append(f"--style is {self.style}, expected --method policy with it")
        if self.method == "policy":
            problems += self.refuse_body(A_POLICY)
        if self.key and not (self.method == "plan" and self.planning and self.filtering):
            problems.append("--key: expected --method plan with it, planning and filtering")
        if named and not self.filtering:
            problems.append(f"{named}: expected filtering, not --no-filtering")
        return problems


@dataclass(frozen=True, kw_only=True)
class RunPolicy(RunOptions):
    """Run a trained policy once, supervised, and judge how it ends."""

    policy: Positional[PolicyName]
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: that of a policy file, else op3."""
    style: StyleOption = None
    longest: Annotated[float | None, between(0.001, 1e6, "s"), arg(metavar="S")] = None
    """Time after which the run ends, standing or not [s]; default: 12."""


@dataclass(frozen=True, kw_only=True)
class Play(BodyOption, RunOptions):
    """Play a rising motion and judge how it ends."""

    motion: Positional[MotionName]
    needs_origin: ClassVar[bool] = False
    preflight: bool = True
    """Play only what the preflight passes; --no-preflight requires a simulated robot."""
    without_imu: bool = False
    """Play it with a robot that has no IMU: open loop; whether it stands is unknown. Where it is
    held in the end, a key press switches torque off."""

    def find_problems(self) -> list[str]:
        """Report an option that does not fit the backend as well."""
        problems = super().find_problems()
        if self.is_real and not self.preflight:
            problems.append("--no-preflight requires a simulated robot")
        return problems + (self._find_blind_problems() if self.without_imu else [])

    def _find_blind_problems(self) -> list[str]:
        """Report options that require an orientation."""
        problems = []
        if self.then not in (None, "hold", "limp"):
            problems.append(
                f"--then is {self.then}, expected hold or limp with --without-imu: it is "
                "unknown whether the robot stands"
            )
        if self.scene != "flat":
            problems.append(f"--scene is {self.scene}, expected flat with --without-imu")
        return problems


@dataclass(frozen=True, kw_only=True)
class Sit(BodyOption, MoveOptions):
    """Sit and lie down from a stand, then torque off.

    A simulated robot starts standing; a real one is held by a person until it moves.
    """

    then: ClassVar[Literal["sit"]] = "sit"
    ending: ClassVar[Literal["sit"]] = "sit"


@dataclass(frozen=True, kw_only=True)
class Hold(BodyOption, MoveOptions):
    """Hold a robot in its stand, supervised, until a key is pressed.

    A simulated robot starts standing; a real one is held by a person until it has torque. In
    simulated time or without a terminal, the stand is held just long enough to be judged.
    """

    then: Literal["sit", "limp", "hand-over"] = "sit"
    """After that: sit and lie down, torque off where it stands, or leave torque on for another
    program."""

    @property
    def ending(self) -> Literal["hold", "limp", "hand-over"]:
        """What the robot does: it is always held first."""
        return "hold" if self.then == "sit" else self.then
