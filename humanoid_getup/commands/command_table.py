"""The table of commands: section, summary, options and function of each."""

from __future__ import annotations

from typing import NamedTuple

SECTIONS = {
    "get up": ("rise", "play", "run", "sit", "hold", "fall"),
    "plan and check": ("plan", "preflight", "motions", "mocap", "scenes", "style"),
    "learn": ("train", "eval", "export", "policy", "prior"),
    "robot": (
        "robots",
        "first-steps",
        "servo",
        "doctor",
        "calibrate",
        "watch",
        "bus",
    ),
    "look": ("studio", "replay", "log", "bench"),
}
"""Commands in the order of `getup --help`; each section has a folder of its own in ``cli``."""
DEFAULTS = {"robots": "robots list"}
"""Default commands of groups."""


class TableEntry(NamedTuple):
    """A command, or a group of commands, which has a summary only."""

    summary: str
    options: str = ""
    """Class of its options, below ``jobs.requests``; with ``options.`` before it, below ``cli``."""
    work: str = ""
    """Function that runs it, below the folder of its section."""
    json: bool = False
    """Whether its results can be written as JSON."""
    module: str = ""
    """Module of a command, below ``commands``."""


COMMANDS = {
    "rise": TableEntry("Get up from a fall by a planned motion or a policy.", module="get_up.rise"),
    "play": TableEntry("Play a rising motion and judge how it ends.", module="get_up.play"),
    "run": TableEntry("Run a policy once and judge how it ends.", module="get_up.run"),
    "plan": TableEntry("Plan a path only, without physics.", module="plan.plan_path"),
    "sit": TableEntry("Sit and lie down from a stand.", module="get_up.stand"),
    "hold": TableEntry("Hold a robot in its stand until a key is pressed.", module="get_up.stand"),
    "fall": TableEntry(
        "Drop a limp robot, and write how it lies as a posture file.", module="get_up.fall"
    ),
    "prior": TableEntry("Make the pose prior of styled policies.", module="learn.make_prior"),
    "train": TableEntry("Train a policy, or continue a training.", module="learn.train"),
    "eval": TableEntry("Evaluate a policy on settled falls.", module="learn.evaluate"),
    "export": TableEntry("Export the policy of a training.", module="learn.export"),
    "policy": TableEntry("Import and check policies of other projects."),
    "policy import": TableEntry(
        "Make a policy that was trained elsewhere run here.", module="learn.foreign_policy"
    ),
    "policy check": TableEntry(
        "Compare an imported policy with a trace from where it was trained.",
        module="learn.foreign_policy",
    ),
    "motions": TableEntry(
        "List, build, retarget, discover, import, record, preview, show or export motions."
    ),
    "motions list": TableEntry("List a robot's motions.", module="motions.show_motions"),
    "motions build": TableEntry("Build motions from keyframes.", module="motions.build_motions"),
    "motions import": TableEntry(
        "Add keys from another program's file.", module="motions.import_keys"
    ),
    "motions record": TableEntry(
        "Record keys from a robot moved by hand.", module="motions.record_motion"
    ),
    "motions preview": TableEntry(
        "Draw the keys of a motion and play them once.", module="motions.preview_motion"
    ),
    "motions retarget": TableEntry(
        "Transfer the keyframes of another robot.", module="motions.retarget_motions"
    ),
    "motions discover": TableEntry(
        "Find motions by a search in physics, or in a policy's rises.",
        module="motions.discover_motions",
    ),
    "motions show": TableEntry("Draw a motion as a film strip.", module="motions.show_motions"),
    "motions export": TableEntry(
        "Write a motion as CSV, or as a JointTrajectory of ROS.", module="motions.export_motion"
    ),
    "bench": TableEntry("Run a benchmark on the twin or on the virtual bus."),
    "bench all": TableEntry(
        "Measure a robot as one page that others can repeat.", module="look.bench_all"
    ),
    "bench rise": TableEntry("Rise from many settled falls.", module="look.bench_rise"),
    "bus": TableEntry("Serve a virtual Dynamixel bus until stopped.", module="robot.bus"),
    "first-steps": TableEntry(
        "Lead from a port to the first rise, step by step.", module="robot.first_steps"
    ),
    "doctor": TableEntry("Check a robot on its bus; moves nothing.", module="robot.doctor"),
    "calibrate": TableEntry("Measure the zeros and signs of the servos.", module="robot.calibrate"),
    "servo": TableEntry("Set up, read and move single servos on a port."),
    "servo list": TableEntry(
        "List serial ports, the devices on them, and what they measure.", module="servo.devices"
    ),
    "servo setup": TableEntry(
        "Give the servos of a robot their ids, one at a time.", module="servo.address"
    ),
    "servo id": TableEntry("Give a servo another id.", module="servo.address"),
    "servo baud": TableEntry("Give a servo another baud rate.", module="servo.address"),
    "servo table": TableEntry("Print all registers of a servo.", module="servo.registers"),
    "servo read": TableEntry("Read registers of a servo.", module="servo.registers"),
    "servo write": TableEntry("Write registers of a servo.", module="servo.registers"),
    "servo move": TableEntry("Move a servo slowly.", module="servo.move"),
    "servo monitor": TableEntry(
        "Show what servos measure, and their ranges.", module="servo.devices"
    ),
    "servo reboot": TableEntry("Restart a servo.", module="servo.address"),
    "servo reset": TableEntry("Set a servo to the values as shipped.", module="servo.address"),
    "watch": TableEntry("Show a limp robot while a person turns it by hand.", module="robot.watch"),
    "preflight": TableEntry("Check whether a motion may be played.", module="plan.preflight"),
    "studio": TableEntry("Pose, plan and look in the browser.", module="look.studio"),
    "replay": TableEntry("Replay a flight log and compare.", module="look.replay"),
    "log": TableEntry("Export flight logs for other programs."),
    "log export": TableEntry("Write a flight log as a ROS 2 bag.", module="look.export_log"),
    "style": TableEntry("List, show, edit or extract styles of rising."),
    "style list": TableEntry("List the named styles.", module="plan.styles"),
    "style show": TableEntry("Print and draw the curves of styles.", module="plan.styles"),
    "style edit": TableEntry("Raise sooner or later, slower, faster, hold.", module="plan.styles"),
    "style extract": TableEntry(
        "Extract a style from a motion, a flight log or a clip.", module="plan.extract_style"
    ),
    "mocap": TableEntry("Import clips of motion capture."),
    "mocap import": TableEntry(
        "Make a motion of a robot from a clip.", module="motions.import_clip"
    ),
    "scenes": TableEntry("List or draw the scenes.", module="plan.scenes"),
    "robots": TableEntry("List the robots, import one from a model file, check one, export one."),
    "robots list": TableEntry("List the installed robots.", module="robot.list_robots"),
    "robots import": TableEntry(
        "Make a robot folder from an MJCF or URDF file.", module="robot.import_robot"
    ),
    "robots check": TableEntry(
        "Check a robot's description, and what its body can do.", module="robot.check_robot"
    ),
    "robots export": TableEntry(
        "Write a robot's servos and controllers for ros2_control.", module="robot.export_robot"
    ),
}
