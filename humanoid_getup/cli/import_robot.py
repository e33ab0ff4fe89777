"""`getup robots import`: a robot folder from a model file."""

from __future__ import annotations

from typing import Any

import numpy as np

from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options.robots import ImportRobot
from humanoid_getup.cli.output import console_for, phase, to_json, write_json
from robots import RobotError, load_robot
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model
from robots.model_import.robot_folder import write_robot
from robots.model_import.source import ModelImportError


def import_robot(command: ImportRobot) -> int:
    """Import the model, write the folder, and report what was found and guessed."""
    options = ImportOptions(
        name=command.name or command.out.resolve().name,
        servos=command.servo,
        keep_hulls=command.meshes,
        fixed=command.fix,
    )
    try:
        with phase("reading the model"):
            robot = import_model(command.model, options)
            write_robot(robot, command.out)
            load_robot(command.out)
    except ModelImportError as error:
        raise BadInputError(*error.problems) from error
    except RobotError as error:
        raise BadInputError(*error.problems) from error
    found = _describe(robot)
    write_json(
        to_json(found | {"notes": list(robot.notes), "guesses": list(robot.guesses)}), command.json
    )
    console = console_for(command.json)
    console.print(
        f"{found['name']}: {found['dof']} joints, {found['mass_kg']:.2f} kg, torso "
        f"'{found['torso']}', servos {', '.join(found['servos'])} at "
        f"{found['supply_voltage']:g} V",
        markup=False,
    )
    for title, lines in (("note", robot.notes), ("guessed", robot.guesses)):
        for line in lines:
            console.print(f"{title}: {line}", markup=False)
    console.print(f"written to {command.out}; next: getup robots check {command.out}", markup=False)
    return DID_IT


def _describe(robot: ImportedRobot) -> dict[str, Any]:
    model = robot.spec.compile()
    return {
        "name": robot.options.name,
        "dof": len(robot.joints),
        "mass_kg": float(np.sum(model.body_mass)),
        "torso": robot.torso,
        "pairs": sum(k != mirror for k, mirror in enumerate(robot.mirror)) // 2,
        "servos": list(dict.fromkeys(robot.servos.types)),
        "supply_voltage": robot.servos.supply,
        "stance_error": robot.stance.error,
        "rising_joints": list(robot.rising_joints),
    }
