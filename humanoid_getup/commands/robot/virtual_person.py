"""A person at the virtual robot of `getup bus`, who does what is typed there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from drivers.virtual_bus.served_robot import ServedRobot
from humanoid_getup.commands.console import warn
from humanoid_getup.commands.inputs import STANDING, find_held_posture, find_start
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.bench import ServoBench
from robots.kinematics import lowest_point, place

HANGING = 0.05  # m above the ground at which a robot is held in any posture but its stance
EXPECTED = "expected hold POSTURE, hang POSTURE, turn JOINT:DEG, let go, or lay CLASS"


class VirtualPerson:
    """Holds a served robot, turns its joints, lets it go, and lays it down."""

    def __init__(
        self, served: ServedRobot, world: World | ServoBench, rng: np.random.Generator
    ) -> None:
        """Stand beside a robot; ``rng`` draws the falls in which it is laid down."""
        self._served, self._world, self._rng = served, world, rng
        self._robot: Robot = world if isinstance(world, ServoBench) else world.robot

    def do(self, sentence: str) -> None:
        """Do what a sentence says, such as "hold zero", or refuse it; nothing has changed then."""
        verb, _, rest = sentence.strip().partition(" ")
        does = {"hold": self.hold, "hang": self.hang, "turn": self.turn, "lay": self.lay}
        if sentence.split() == ["let", "go"]:
            self.let_go()
        elif verb in does and rest.strip():
            does[verb](rest.strip())
        else:
            raise ValueError(f"'{sentence.strip()}' is not understood, {EXPECTED}")

    def hold(self, at: str) -> None:
        """Hold the robot in a posture: zero or a file in the air, standing on the ground."""
        if at != STANDING:
            self.hang(at)
        else:
            self._served.hold(self._robot.standing)

    def hang(self, at: str) -> None:
        """Hold the robot in the air in a posture: zero, standing, or a file."""
        posture = find_held_posture(self._robot, at)
        if isinstance(self._world, World):
            posture = _hang(self._world, posture)
        self._served.hold(posture)

    def turn(self, turned: str) -> None:
        """Turn joints of a held robot by angles, such as l_knee:20,r_el:-10 [°]."""
        for joint, angle in [self._read_turn(one.strip()) for one in turned.split(",")]:
            self._served.turn(joint, angle)

    def let_go(self) -> None:
        """Let the robot go."""
        self._served.let_go()

    def lay(self, origin: str) -> None:
        """Lay the robot down: in a sampled fall of a class, or as a posture file says."""
        if isinstance(self._world, ServoBench):
            raise ValueError(f"lay {origin}: servos on a bench cannot lie, expected hold or turn")
        self._served.place(find_start(self._world, origin, self._rng, warn).posture)

    def _read_turn(self, turned: str) -> tuple[int, float]:
        """Read JOINT:DEG; return the number of the joint and the angle [rad]."""
        name, colon, degrees = turned.rpartition(":")
        names = self._robot.joint_names
        try:
            angle = float(degrees) if colon else math.nan
        except ValueError:
            angle = math.nan
        if not math.isfinite(angle):
            raise ValueError(f"turn {turned}: expected JOINT:DEG, an angle in degrees")
        if name not in names:
            raise ValueError(
                f"turn {turned}: unknown joint '{name}', expected JOINT:DEG with a joint of "
                f"{', '.join(names)}"
            )
        return names.index(name), math.radians(angle)


def _hang(world: World, posture: Posture) -> Posture:
    """Lift a posture until nothing touches the ground."""
    lowest = lowest_point(world.model, place(world.robot, world.model, posture))
    lift = np.array([0.0, 0.0, HANGING - lowest])
    return replace(posture, position=posture.position + lift)
