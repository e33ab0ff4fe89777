"""A robot with servos of another type."""

from __future__ import annotations

from dataclasses import replace

from robots import Robot, RobotError
from robots.description.loading import choose_limit_mode
from robots.description.servo_catalog import servo_models


def use_servos(robot: Robot, name: str) -> Robot:
    """Give every joint of a robot a servo of another type; gears, gains and masses stay.

    The supply becomes the type's nominal one if the robot's own is none for it.
    """
    models = servo_models()
    if name not in models:
        raise RobotError(f"unknown servo {name!r}, expected {', '.join(models)}")
    model = models[name]
    fits = model.min_voltage <= robot.supply_voltage <= model.max_voltage
    return replace(
        robot,
        joints=tuple(replace(j, servo=replace(j.servo, model=model)) for j in robot.joints),
        supply_voltage=robot.supply_voltage if fits else model.nominal_voltage,
        limit_by=choose_limit_mode([model]),
    )
