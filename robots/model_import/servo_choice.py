"""Choice of servo types for a model: by the limits that it states, else by its weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np

from robots.description.servo_catalog import servo_models
from robots.model_import.source import ActuatorFigures, ModelImportError
from robots.servo import TICKS_PER_TURN, ServoModel
from robots.storage.validation import shown

SUPPLIES = (12.0, 14.8, 11.1)  # V, of batteries with three and four cells
CLOSE = np.log(1.25)  # ratio of torques up to which a known type matches the stated limit
SPEED_WEIGHT = 0.5
SQUAT_SHARE = 0.25  # of weight times leg length: about the knee's torque in a deep squat
RESERVE = 2.0  # times that torque a servo should have at standstill
HEAVY = 0.75  # share of the robot's mass that its servos may weigh; OP3's are 0.53 of it
WILD = 20.0  # times that torque: a limit of a simulation, not of a motor
ENDLESS = 1000.0  # N·m; models state it for unknown motors
FASTEST = 50.0  # rad/s, above the speeds of geared motors; models state more for unknown ones
GRAVITY = 9.81
OWN_P_GAIN = 1600  # twice a Dynamixel's: the stiffness that keeps a robot up grows with its height
OWN_SPEED = 8.0  # rad/s, of a motor without a stated speed
OWN_VOLTAGE, HIGH_VOLTAGE = 24.0, 48.0  # V
HIGH_TORQUE = 100.0  # N·m from which the currents of a motor require the higher one
MOST_TORQUE = 200.0  # N·m that a servo type may have
MOST_STEP = 0.1  # A, of the current that it measures


@dataclass(frozen=True, eq=False, kw_only=True)
class ServoChoice:
    """Servo types of a robot's joints."""

    types: tuple[str, ...]
    """One for each joint."""
    supply: float
    """[V]"""
    own: dict[str, dict[str, float]] = field(default_factory=dict)
    """Figures of types that the package does not know, for the folder's servos.toml."""
    guesses: tuple[str, ...] = ()
    """What was guessed, and how to confirm it."""


def list_guessed() -> dict[str, ServoModel]:
    """List the types that are guessed, by name: those of the X and MX(2.0) series."""
    return {
        name: model
        for name, model in servo_models().items()
        if model.protocol == "dynamixel" and model.ticks_per_turn == TICKS_PER_TURN
    }


def choose_servos(
    joints: Sequence[str],
    actuators: Mapping[str, ActuatorFigures],
    asked: Sequence[str],
    *,
    weight: float,
    leg_length: float,
) -> ServoChoice:
    """Choose a servo type for each joint, by what the model states, the user says, or the weight.

    The user says ``TYPE`` for all joints, or ``TYPE=PATTERN`` for those whose names match; the last
    that matches counts. The robot's mass is in kg, its legs' length in m.
    """
    named = _read_wishes(joints, asked)
    need = SQUAT_SHARE * weight * GRAVITY * leg_length
    stated = {
        name: replace(figures, speed=None) if _is_wild(figures) else figures
        for name, figures in actuators.items()
        if figures.effort is not None and figures.effort < min(WILD * need, ENDLESS)
    }
    _check_torques(joints, stated, named)
    guesses: list[str] = []
    supply = _choose_supply(joints, stated, named, RESERVE * need)
    types, own = [], {}
    most_mass = HEAVY * weight / len(joints)
    by_weight = _choose_by_weight(need, supply, most_mass)
    for joint in joints:
        if joint in named:
            types.append(named[joint])
        elif joint in stated:
            types.append(_match(stated[joint], supply, most_mass, own))
        else:
            types.append(by_weight)
            if by_weight not in servo_models():
                torque = _round(RESERVE * need)
                own[by_weight] = describe_motor(torque, OWN_SPEED, supply, most_mass)
    silent = [joint for joint in joints if joint not in stated and joint not in named]
    if silent:
        guesses.append(
            f"servo {by_weight} for {_few(silent)}: the model states no torque limit, and the "
            f"robot's weight asks for {RESERVE * need:.1f} N·m; set the types with --servo "
            "TYPE=PATTERN"
        )
    read = [joint for joint in joints if joint in stated and joint not in named]
    kinds = dict.fromkeys(t for t, j in zip(types, joints, strict=True) if j in read)
    if known := ", ".join(kind for kind in kinds if kind not in own):
        guesses.append(
            f"servos {known} at {supply:g} V: the types nearest to the model's limits of torque "
            "and speed; set others with --servo TYPE=PATTERN"
        )
    if made := ", ".join(kind for kind in kinds if kind in own):
        guesses.append(
            f"servos {made} at {supply:g} V: made up from the model's limits of torque and speed, "
            "which no known type has; set their figures in servos.toml"
        )
    if wild := [joint for joint in read if _is_wild(actuators[joint])]:
        guesses.append(
            f"speeds of {_few(wild)}: the model's limit of {actuators[wild[0]].speed:g} rad/s is "
            f"no motor's, expected at most {FASTEST:g} rad/s; set the types with "
            "--servo TYPE=PATTERN"
        )
    mass = sum(own[kind]["mass"] if kind in own else servo_models()[kind].mass for kind in types)
    if guesses and mass > HEAVY * weight:
        guesses.append(
            f"its {len(types)} servos weigh {mass:.1f} kg, and it weighs {weight:.1f} kg with "
            "them: check its masses, or set lighter types with --servo TYPE=PATTERN"
        )
    return ServoChoice(types=tuple(types), supply=supply, own=own, guesses=tuple(guesses))


def _is_wild(figures: ActuatorFigures) -> bool:
    return figures.speed is not None and figures.speed > FASTEST


def _check_torques(
    joints: Sequence[str], stated: Mapping[str, ActuatorFigures], named: Mapping[str, str]
) -> None:
    strong = [j for j in joints if j in stated and j not in named]
    problems = [
        f"joint {shown(joint)} has a torque limit of {effort:g} N·m, expected at most "
        f"{MOST_TORQUE:g} N·m, of servos: set its type with --servo TYPE={joint}"
        for joint in strong
        if (effort := stated[joint].effort or 0.0) > MOST_TORQUE
    ]
    if problems:
        raise ModelImportError(*problems)


def _read_wishes(joints: Sequence[str], asked: Sequence[str]) -> dict[str, str]:
    named: dict[str, str] = {}
    problems = []
    for wish in asked:
        kind, _, pattern = wish.partition("=")
        matching = [joint for joint in joints if fnmatchcase(joint, pattern or "*")]
        if kind not in servo_models():
            similar = [name for name in servo_models() if kind and name.startswith(kind)]
            problems.append(
                f"--servo is {shown(wish)}: unknown type {shown(kind)}, expected "
                f"{', '.join(similar or servo_models())}"
            )
        elif not matching:
            problems.append(
                f"--servo is {shown(wish)}: no joint matches {shown(pattern)}, expected some of "
                f"{', '.join(joints)}"
            )
        named |= dict.fromkeys(matching, kind)
    if problems:
        raise ModelImportError(*problems)
    return named


def _choose_supply(
    joints: Sequence[str],
    stated: Mapping[str, ActuatorFigures],
    named: Mapping[str, str],
    needed: float,
) -> float:
    """Choose the supply at which types fit the limits best; other motors have a higher one."""
    read = [stated[joint] for joint in joints if joint in stated and joint not in named]
    usable = [
        supply
        for supply in SUPPLIES
        if all(servo_models()[kind].accepts_supply(supply) for kind in set(named.values()))
    ]
    usable = usable or [servo_models()[next(iter(named.values()))].nominal_voltage]
    strongest = max([figures.effort or 0.0 for figures in read] or [needed])
    own = HIGH_VOLTAGE if strongest > HIGH_TORQUE else OWN_VOLTAGE
    if not read:
        is_known = any(m.stall_torque >= needed for m in list_guessed().values())
        return usable[0] if is_known or named else own
    cost = {
        supply: sum(min(_distance(f, m, supply) for m in list_guessed().values()) for f in read)
        for supply in usable
    }
    best = min(usable, key=lambda supply: cost[supply])
    is_known = sum(_nearest(figures, best)[1] <= CLOSE for figures in read) >= len(read) / 2
    return best if is_known or named else own


def _distance(figures: ActuatorFigures, model: ServoModel, supply: float) -> float:
    """Measure the distance of a type at a supply from the stated limits, in logarithms."""
    if not model.accepts_supply(supply) or figures.effort is None:
        return np.inf
    share = supply / model.nominal_voltage
    torque = abs(np.log(figures.effort / (model.stall_torque * share)))
    if figures.speed is None:
        return float(torque)
    speed = abs(np.log(figures.speed / (model.top_speed * share)))
    return float(torque + SPEED_WEIGHT * speed)


def _nearest(figures: ActuatorFigures, supply: float) -> tuple[str, float]:
    distances = {name: _distance(figures, m, supply) for name, m in list_guessed().items()}
    best = min(distances, key=lambda name: distances[name])
    return best, distances[best]


def _match(
    figures: ActuatorFigures, supply: float, most_mass: float, own: dict[str, dict[str, float]]
) -> str:
    name, distance = _nearest(figures, supply)
    if distance <= CLOSE:
        return name
    effort = float(figures.effort or 0.0)
    speed = OWN_SPEED if figures.speed is None else figures.speed
    title = _name_motor(effort)
    own[title] = describe_motor(effort, speed, supply, most_mass)
    return title


def describe_motor(
    effort: float, speed: float, supply: float, most_mass: float
) -> dict[str, float]:
    """Derive the figures of a motor other than Dynamixel from torque [N·m] and speed [rad/s].

    Rotor, friction and mass scale with the torque as those of the XM540-W270 do, current with
    torque over voltage; a motor weighs no more than its share of the robot [kg].
    """
    like = servo_models()["XM540-W270"]
    scale = effort / like.stall_torque
    return {
        "nominal_voltage": supply,
        "stall_torque": effort,
        "stall_current": round(like.stall_current * scale * like.nominal_voltage / supply, 3),
        "no_load_speed": speed,
        "armature": round(like.armature * scale, 6),
        "friction": round(like.friction * scale, 4),
        "current_step": round(min(like.current_step * max(scale, 1.0), MOST_STEP), 5),
        "max_voltage": round(1.25 * supply, 1),
        "min_voltage": round(0.75 * supply, 1),
        "mass": round(min(like.mass * scale, most_mass), 3),
        "temperature_limit": like.temperature_limit,
        "p_gain": OWN_P_GAIN,
    }


def _choose_by_weight(need: float, supply: float, most_mass: float) -> str:
    """Choose the weakest type with enough torque, or such a motor, if others are not too heavy."""
    usable = {n: m for n, m in list_guessed().items() if m.accepts_supply(supply)}
    torque = {n: m.stall_torque * supply / m.nominal_voltage for n, m in usable.items()}
    enough = [name for name in torque if torque[name] >= RESERVE * need]
    if not enough:
        return _name_motor(_round(RESERVE * need))
    light = [name for name in torque if usable[name].mass <= most_mass and torque[name] >= need]
    if light and not set(light) & set(enough):
        return max(light, key=lambda name: torque[name])
    return min(set(light) & set(enough) or enough, key=lambda name: torque[name])


def _round(torque: float) -> float:
    return float(f"{min(torque, MOST_TORQUE):.2g}")


def _name_motor(effort: float) -> str:
    return f"motor-{effort:g}-Nm"


def _few(names: Sequence[str]) -> str:
    if len(names) <= 4:
        return ", ".join(names)
    return f"{', '.join(names[:3])} and {len(names) - 3} more"
