"""Steps of the first connection of loose servos, without a robot."""

from __future__ import annotations

from collections.abc import Iterator

from humanoid_getup.cli.robot.first_steps.step import FirstStep


def list_desk_steps(port: str) -> Iterator[FirstStep]:
    """List the steps in their order."""
    at = ("--port", port)
    yield FirstStep(
        name="list",
        aim="Find the servos on the port, and what they measure.",
        words=("servo", "list", *at),
        before="Supply the servos; close other programs on the port.",
    )
    yield FirstStep(
        name="id",
        aim="Give a servo that is alone on the port another id.",
        words=("servo", "id", *at),
        before="Unplug all servos but one.",
        asks="new id, or Enter to keep it, q leaves:",
        is_optional=True,
    )
    yield FirstStep(
        name="monitor",
        aim="See its angle follow your hand; torque is off.",
        words=("servo", "monitor", *at),
        before="Turn the horn by hand; q ends it.",
        at_bus="hold zero, then turn servo_1:30",
    )
    yield FirstStep(
        name="wiggle",
        aim="Swing one servo after the other by 5°: the first torque.",
        words=("servo", "wiggle", *at),
        before="Fasten each servo, its horn free; any key stops it.",
    )
    yield FirstStep(
        name="validate",
        aim="Validate range, ramp, load, speed, torque, watchdog and replies.",
        words=("servo", "validate", *at),
        before="The horns swing by 20°; any key stops it.",
        is_optional=True,
    )
