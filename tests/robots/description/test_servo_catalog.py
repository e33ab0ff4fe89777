"""Servo types: the package's own, and those of a robot's folder."""

from pathlib import Path

import pytest
from nonempty import nonempty
from spoiling import complaint, spoil

from drivers.dynamixel.control_table import OperatingMode, known_models, table_named, types_of
from robots import load_robot
from robots.description.servo_catalog import read_servo_models, servo_models
from robots.model_import.servo_choice import list_guessed

OWN = """
["XM430-W350"]
nominal_voltage = 14.8
stall_torque = 4.8
no_load_speed = 5.97

[home-made]
nominal_voltage = 12.0
stall_torque = 2.0
stall_current = 1.0
no_load_speed = 6.0
armature = 0.001
friction = 0.0
current_step = 0
min_voltage = 10
max_voltage = 13.0
mass = 0.05
temperature_limit = 70
p_gain = 640
"""


def test_a_folders_types_add_to_and_override_the_packages(own_robot):
    (own_robot / "servos.toml").write_text(OWN)
    spoil(own_robot, 'id = 2, servo = "XM430-W350"', 'id = 2, servo = "home-made"')
    left, right = (joint.servo.model for joint in load_robot(own_robot).joints)
    package = servo_models()["XM430-W350"]
    assert (left.stall_torque, left.no_load_speed, left.nominal_voltage) == (4.8, 5.97, 14.8)
    assert (left.stall_current, left.armature) == (package.stall_current, package.armature)
    assert (right.name, right.stall_torque, right.friction) == ("home-made", 2.0, 0.0)
    assert (right.p_gain, right.gain_divisor) == (640, 128)
    assert package.stall_torque == 4.1, "the package's types stay as they are"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("torque = 4.8", "torque = 0", "servos.toml: 'XM430-W350': stall_torque is 0 N·m, exp"),
        ("friction = 0.0", "friction = -0.1", "'home-made': friction is -0.1 N·m, expected 0 to"),
        ("stall_current = 1.0\n", "", "'home-made': stall_current is missing, expected above 0 A"),
        ("friction = 0.0", "fricton = 0.0", "'home-made': unknown key 'fricton', expected nomin"),
        ("limit = 70", "limit = 343", "temperature_limit is 343 °C, expected 40 to 150 °C"),
        ("max_voltage = 13.0", "max_voltage = 9", "min_voltage is 10 V, expected at most max_vol"),
        ('["XM4', 'x = 3\n["XM4', "servos.toml: 'x' is 3, expected a table of figures"),
    ],
)
def test_a_wrong_type_is_reported_with_what_is_expected(own_robot, old, new, words):
    assert old in OWN
    (own_robot / "servos.toml").write_text(OWN.replace(old, new))
    assert words in complaint(own_robot)


def test_figures_of_the_packages_types_make_sense():
    for name, model in nonempty(servo_models().items()):
        assert model.min_voltage <= model.nominal_voltage <= model.max_voltage, name
        # An ideal motor has V / speed N·m/A; a servo loses some to friction, none gains a fifth.
        # The STS3215 for 12 V loses most, of what its data sheet says.
        assert 0.4 < model.torque_per_ampere / model.motor_constant < 1.2, name
        assert 0.005 < model.friction / model.stall_torque < 0.1, name


def test_figures_that_a_control_table_has_too_are_the_same():
    """Its registers as they leave the factory are the other source of these figures."""
    assert {n for n in known_models() if table_named(n).has_watchdog} == list_guessed().keys()
    for name, model in nonempty(servo_models().items()):
        table = table_named(name)
        assert table["present_position"].scale == pytest.approx(model.rad_per_tick), name
        assert table["max_position_limit"].upper == model.last_tick, name
        assert table.wire.max_id == model.max_id, name
        assert name in types_of(table)
    for name, model in nonempty(list_guessed().items()):
        table = table_named(name)
        assert model.p_gain == table["position_p_gain"].default, name
        assert model.temperature_limit == table["temperature_limit"].default, name
        has_current = OperatingMode.CURRENT_BASED_POSITION in table.modes
        assert model.has_current_mode == has_current, name
        if has_current:
            assert model.current_step == table["present_current"].scale, name
        upper = table["max_voltage_limit"].upper
        assert upper is not None and 10.0 * model.max_voltage <= upper, name


def test_friction_that_takes_all_torque_is_refused(tmp_path: Path):
    (tmp_path / "servos.toml").write_text("[XM430-W350]\nload_friction = 1.0\n")
    _, problems = read_servo_models(tmp_path)
    wrong = "friction takes all of the motor's torque, 4.1 N·m: expected less"
    assert problems == [f"servos.toml: 'XM430-W350': {wrong}"]
