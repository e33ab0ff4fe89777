"""Loading a robot from its folder: its robot.toml, its model, and its computed stance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robots import quaternion
from robots.arguments import expect
from robots.body.limbs import ARMS, Limbs
from robots.body.shapes import sample_shapes
from robots.description.bench_table import BENCH, load_bench
from robots.description.calibration import CALIBRATION_FILE, Calibration, CalibrationError
from robots.description.model_checks import find_model_problems
from robots.description.schema import JointRow, RobotTable, read_description
from robots.description.servo_catalog import read_servo_models
from robots.individual import IDENTIFIED_FILE, HeldMass, Individual, IndividualError
from robots.kinematics import rest_passive_joints
from robots.posture import Posture
from robots.proportions import ORIGINAL, Body, BodyError
from robots.quaternion import Array
from robots.reshaping.reshape_model import ReshapedRobot
from robots.robot import ROBOTS_FOLDER, Joint, Robot, RobotError, list_robots
from robots.servo import LimitMode, Servo, ServoModel
from robots.storage.files import describe
from robots.storage.model_files import MODEL_ERRORS, find_file_problems
from robots.storage.validation import load_toml, shown
from robots.transmission import Coupling

MOST_HELD = 100.0  # kg


def load_robot(
    name_or_folder: str | Path,
    body: Body = ORIGINAL,
    individual: Individual | None = None,
    load: Mapping[str, float] | None = None,
) -> Robot:
    """Load a robot by name, or from a user's own folder that holds a robot.toml.

    A name of the package's own robots means them, whatever the present folder holds: ``./op3`` is
    a folder.

    A calibration.toml in the folder replaces what the description says of zeros and signs; an
    identified.toml says what sets the robot apart, unless an individual is given. Another body than
    that of the model is made as `reshape` says. The load is held as `hold` says.

    Raises:
        RobotError: if there is no such robot, or naming all that is wrong in its description.
        BodyError: if the robot cannot have that body.
        ValueError: if an argument is of another type.
    """
    expect("robot", name_or_folder, str | Path, "a name or a folder")
    expect("body", body, Body, "a Body, e.g. Body(arms=1.6)")
    robot = _load_original(name_or_folder, individual)
    robot = robot if body.is_original else reshape(robot, body)
    return hold(robot, load) if load else robot


def _load_original(name_or_folder: str | Path, individual: Individual | None) -> Robot:
    folder = _find_folder(name_or_folder)
    file = folder / "robot.toml"
    servos, wrong_servos = read_servo_models(folder)
    try:
        toml = load_toml(file)
        load = load_bench if BENCH in toml else _load_body
        robot, problems = load(folder, toml, servos, wrong_servos)
        if problems or robot is None:
            raise RobotError(
                f"{file}: {'; '.join(problems)}", [f"{file}: {problem}" for problem in problems]
            )
        robot.spec().compile()
        calibration = folder / CALIBRATION_FILE
        if calibration.exists():
            robot = Calibration.load(calibration, robot).apply(robot)
        identified = folder / IDENTIFIED_FILE
        if individual is None and identified.exists():
            individual = Individual.load(identified, robot.name)
        return robot if individual is None else robot.with_individual(individual)
    except (CalibrationError, IndividualError) as error:
        raise RobotError(str(error)) from error
    except RobotError:
        raise
    except MODEL_ERRORS as error:
        raise RobotError(f"{file}: {describe(error)}") from error


def _load_body(
    folder: Path, toml: dict[str, Any], servos: Mapping[str, ServoModel], wrong_servos: list[str]
) -> tuple[Robot | None, list[str]]:
    """Load the robot of a robot.toml that names a model; return it, or None and all problems."""
    table, problems = read_description(toml, servos)
    problems += wrong_servos
    model = None
    if table.model:
        try:
            model = _load_model(folder / table.model)
            problems += find_model_problems(table, model)
        except RobotError as error:
            problems.append(f"model {error}")
    if problems or model is None:
        return None, problems
    try:
        return _build_robot(folder, table, model, servos), []
    except RobotError as error:
        return None, [str(error)]


def reshape(robot: Robot, body: Body) -> Robot:
    """Give a robot another body: link lengths, masses and inertias; servos and joints stay.

    It stands with the same joint angles. The factors are on the lengths of the model, not on
    those of a body that it was given before.
    """
    values: dict[str, Any] = {field.name: getattr(robot, field.name) for field in fields(robot)}
    values["body"] = body
    reshaped = Robot(**values) if body.is_original else ReshapedRobot(**values)
    try:
        model = reshaped.spec().compile()
    except BodyError:
        raise
    except MODEL_ERRORS as error:
        raise BodyError(f"body '{body}' of '{robot.name}': {describe(error)}") from error
    standing, neck_height = _compute_stance(
        model,
        robot.torso,
        robot.neck_site,
        robot.sole_sites,
        robot.passive_joints,
        dict(zip(robot.joint_names, robot.standing.joint_pos.tolist(), strict=True)),
    )
    return replace(reshaped, standing=standing, standing_neck_height=neck_height)


def hold(robot: Robot, load: Mapping[str, float]) -> Robot:
    """Give a robot masses [kg] to hold, by names, instead of those that it held.

    A name is ``left_hand`` or ``right_hand``, the end of an arm; or that of a body, which holds the
    mass in the middle of its shapes; or of a site. Masses touch nothing.

    Raises:
        ValueError: if there is no such place, or a mass is not above 0 and up to the robot's own.
    """
    expect("load", load, Mapping, "masses [kg] by names, e.g. {'left_hand': 0.2}")
    limbs, held = Limbs(replace(robot, held=())), list[HeldMass]()
    limbs.look(robot.standing.joint_pos)
    most = min(MOST_HELD, limbs.mass)
    for name, mass in load.items():
        expect(f"load {name}", mass, int | float, "a mass [kg]")
        if not 0.0 < mass <= most:
            given = f"load {name} is {mass:g} kg"
            raise RobotError(f"{given}, expected above 0 and up to {most:.3g} kg for {robot.name}")
        held.append(HeldMass(name, float(mass), *_find_place(limbs, name)))
    return replace(robot, held=tuple(held))


def _find_place(limbs: Limbs, name: str) -> tuple[str, Array]:
    """Find the body that holds a load, and the load's place in its frame [m], (3,)."""
    model, data = limbs.model, limbs.data
    last = {arm[:-3] + "hand": limbs.all[arm].joints[-1] for arm in ARMS if arm in limbs.all}
    ends = {hand: data.body(model.jnt_bodyid[limbs.ids[joint]]) for hand, joint in last.items()}
    if end := ends.get(name):
        return end.name, end.xmat.reshape(3, 3).T @ (limbs.end(last[name]) - end.xpos)
    if (body := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)) > 0:
        points = sample_shapes(model, body)
        return name, points.mean(axis=0) if len(points) else model.body_ipos[body]
    if (site := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)) >= 0:
        return model.body(model.site_bodyid[site]).name, model.site_pos[site]
    known = dict.fromkeys([*ends, *(end.name for end in ends.values()), limbs.robot.torso])
    owner = f"body or site of {limbs.robot.name}"
    raise RobotError(f"load on unknown '{name}', expected a {owner}, such as {', '.join(known)}")


def _find_folder(name_or_folder: str | Path) -> Path:
    if isinstance(name_or_folder, str) and name_or_folder in list_robots():
        return ROBOTS_FOLDER / name_or_folder
    folder = Path(name_or_folder)
    try:
        if (folder / "robot.toml").is_file():
            return folder
    except OSError as error:  # a name too long, or a folder that may not be read
        raise RobotError(f"robot folder {shown(str(folder))}: {error.strerror}") from error
    raise RobotError(
        f"unknown robot {shown(str(name_or_folder))}: expected {', '.join(list_robots())}, "
        "or a folder that holds a robot.toml"
    )


def _load_model(file: Path) -> mujoco.MjModel:
    if not file.is_file():
        raise RobotError(f"{file}: no such file, expected an MJCF file in the robot's folder")
    if problems := find_file_problems(file):
        raise RobotError(f"{file}: {'; '.join(problems)}")
    try:
        return mujoco.MjModel.from_xml_path(str(file))
    except MODEL_ERRORS as error:
        raise RobotError(f"{file}: {describe(error)}") from error


def _build_robot(
    folder: Path, table: RobotTable, model: mujoco.MjModel, servos: Mapping[str, ServoModel]
) -> Robot:
    rows, names = table.joints, [row.name for row in table.joints]
    angles = {name: table.standing.get(name, 0.0) for name in names}
    standing, neck_height = _compute_stance(
        model, table.torso, table.neck_site, table.sole_sites, table.passive_joints, angles
    )
    return Robot(
        name=table.name,
        folder=folder,
        joints=tuple(_build_joint(row, model, servos[row.servo]) for row in rows),
        torso=table.torso,
        neck_site=table.neck_site,
        imu_site=table.imu_site,
        sole_sites=table.sole_sites,
        control_period=table.control_period,
        supply_voltage=table.supply_voltage,
        supply_resistance=table.supply_resistance,
        standing=standing,
        standing_neck_height=neck_height,
        mirror_index=np.array([names.index(row.mirror) for row in rows]),
        mirror_sign=np.array([float(row.mirror_sign) for row in rows]),
        model_file=folder / table.model,
        bus=table.bus,
        imu=table.imu,
        rising_joints=table.rising_joints or (),
        spreading_joints=table.spreading_joints,
        passive_joints=table.passive_joints,
        limp_joints=table.limp_joints,
        couplings=tuple(
            Coupling(
                joints=(names.index(row.joints[0]), names.index(row.joints[1])),
                matrix=np.array(row.matrix),
            )
            for row in table.couplings
        ),
        limit_by=table.limit_by or choose_limit_mode(servos[row.servo] for row in rows),
    )


def choose_limit_mode(motors: Iterable[ServoModel]) -> LimitMode:
    """Limit torque by current where every servo senses it."""
    all_sense = all(motor.has_current_mode for motor in motors)
    return "current" if all_sense else "pwm"


def _build_joint(row: JointRow, model: mujoco.MjModel, motor: ServoModel) -> Joint:
    lower, upper = model.joint(row.name).range
    return Joint(
        name=row.name,
        lower=float(lower),
        upper=float(upper),
        servo=Servo(
            id=row.id,
            model=motor,
            sign=row.sign,
            zero_ticks=row.zero_ticks,
            own_p_gain=row.p_gain,
            gear=row.gear,
        ),
        segment=row.segment,
    )


def _compute_stance(
    model: mujoco.MjModel,
    torso: str,
    neck_site: str,
    sole_sites: Sequence[str],
    passive_joints: Sequence[str],
    angles: Mapping[str, float],
) -> tuple[Posture, float]:
    """Place the soles flat on the ground; return the posture and the height of the neck [m]."""
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        data.joint(name).qpos[0] = angle
    rest_passive_joints(model, passive_joints, data.qpos)
    mujoco.mj_kinematics(model, data)
    torso_from_sole = np.mean([data.site(sole).xmat.reshape(3, 3) for sole in sole_sites], axis=0)
    u, _, v = np.linalg.svd(torso_from_sole)
    orientation = quaternion.from_matrix((u @ v).T)
    root = int(model.jnt_qposadr[model.body(torso).jntadr[0]])
    data.qpos[root : root + 3] = 0.0
    data.qpos[root + 3 : root + 7] = orientation
    mujoco.mj_kinematics(model, data)
    sole_height = min(data.site(sole).xpos[2] for sole in sole_sites)
    neck_height = float(data.site(neck_site).xpos[2] - sole_height)
    if neck_height <= 0.0:
        raise RobotError(
            f"standing: neck_site {shown(neck_site)} is {neck_height:+.3f} m over "
            "the soles, expected above 0 m"
        )
    posture = Posture(
        position=np.array([0.0, 0.0, -sole_height]),
        orientation=orientation,
        joint_pos=np.array(list(angles.values())),
    )
    return posture, neck_height
