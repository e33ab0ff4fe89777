"""The table of commands: sections, summaries, and the module of each command."""

from __future__ import annotations

from typing import NamedTuple

SECTIONS = {
    "get up": ("rise", "play", "run", "sit", "hold", "fall"),
    "plan and check": ("plan", "preflight", "motions", "mocap", "scenes", "style"),
    "learn": ("train", "eval", "export", "policy", "prior"),
    "robot": ("robots", "first-steps", "servo", "identify", "doctor", "calibrate", "watch", "bus"),
    "look": ("studio", "replay", "log", "bench"),
}
"""Commands and groups in the order of `getup --help`."""
DEFAULTS = {"robots": "robots list"}
"""Default commands of groups."""


class Entry(NamedTuple):
    """A command, or a group of commands, which has no module."""

    summary: str
    module: str = ""
    """Module that registers it, below ``commands``."""


COMMANDS = {
    "rise": Entry("Get up from a fall by a planned motion or a policy.", "get_up.rise"),
    "play": Entry("Play a rising motion and judge how it ends.", "get_up.play"),
    "run": Entry("Run a policy once and judge how it ends.", "get_up.run"),
    "sit": Entry("Sit and lie down from a stand.", "get_up.stand"),
    "hold": Entry("Hold a robot in its stand until a key is pressed.", "get_up.stand"),
    "fall": Entry("Drop a limp robot, and write how it lies as a posture file.", "get_up.fall"),
    "plan": Entry("Plan a path only, without physics.", "plan.plan_path"),
    "preflight": Entry("Check whether a motion may be played.", "plan.preflight"),
    "motions": Entry(
        "List, build, retarget, discover, import, record, preview, show or export motions."
    ),
    "motions list": Entry("List a robot's motions.", "motions.show_motions"),
    "motions build": Entry("Build motions from keyframes.", "motions.build_motions"),
    "motions import": Entry("Add keys from another program's file.", "motions.import_keys"),
    "motions record": Entry("Record keys from a robot moved by hand.", "motions.record_motion"),
    "motions preview": Entry(
        "Draw the keys of a motion and play them once.", "motions.preview_motion"
    ),
    "motions retarget": Entry("Transfer the keyframes of another robot.", "motions.build_motions"),
    "motions discover": Entry(
        "Find motions by a search in physics, or in a policy's rises.", "motions.discover_motions"
    ),
    "motions show": Entry("Draw a motion as a film strip.", "motions.show_motions"),
    "motions export": Entry(
        "Write a motion as CSV, or as a JointTrajectory of ROS.", "motions.export_motion"
    ),
    "mocap": Entry("Import clips of motion capture."),
    "mocap import": Entry("Make a motion of a robot from a clip.", "motions.import_clip"),
    "scenes": Entry("List or draw the scenes.", "plan.scenes"),
    "style": Entry("List, show or extract styles of rising."),
    "style list": Entry("List the named styles.", "plan.styles"),
    "style show": Entry("Print and draw the curves of styles.", "plan.styles"),
    "style extract": Entry(
        "Extract a style from a motion, a flight log or a clip.", "plan.extract_style"
    ),
    "train": Entry("Train a policy, or continue a training.", "learn.train"),
    "eval": Entry("Evaluate a policy on settled falls.", "learn.evaluate"),
    "export": Entry("Export the policy of a training.", "learn.train"),
    "policy": Entry("Import and check policies of other projects."),
    "policy import": Entry(
        "Make a policy that was trained elsewhere run here.", "learn.foreign_policy"
    ),
    "policy check": Entry(
        "Compare an imported policy with a trace from where it was trained.", "learn.foreign_policy"
    ),
    "prior": Entry("Make the pose prior of styled policies.", "learn.make_prior"),
    "robots": Entry("List the robots, import one from a model file, check one."),
    "robots list": Entry("List the installed robots.", "robot.list_robots"),
    "robots import": Entry("Make a robot folder from an MJCF or URDF file.", "robot.import_robot"),
    "robots check": Entry(
        "Check a robot's description, and what its body can do.", "robot.check_robot"
    ),
    "first-steps": Entry("Lead from a port to the first rise, step by step.", "robot.first_steps"),
    "servo": Entry("Set up, read and move single servos on a port."),
    "servo list": Entry(
        "List serial ports, the devices on them, and what they measure.", "servo.devices"
    ),
    "servo setup": Entry("Give the servos of a robot their ids, one at a time.", "servo.address"),
    "servo id": Entry("Give a servo another id.", "servo.address"),
    "servo baud": Entry("Give a servo another baud rate.", "servo.address"),
    "servo table": Entry("Print all registers of a servo.", "servo.registers"),
    "servo read": Entry("Read registers of a servo.", "servo.registers"),
    "servo write": Entry("Write registers of a servo.", "servo.registers"),
    "servo move": Entry("Move a servo slowly.", "servo.move"),
    "servo monitor": Entry("Show what servos measure, and their ranges.", "servo.devices"),
    "servo reboot": Entry("Restart a servo.", "servo.address"),
    "servo reset": Entry("Set a servo to the values as shipped.", "servo.address"),
    "identify": Entry("Identify the physics of servos and robots from logs."),
    "identify servo": Entry("Identify motor and friction of a servo type.", "robot.identify_servo"),
    "identify robot": Entry(
        "Identify one robot from the flight logs of its own rises.", "robot.identify_robot"
    ),
    "doctor": Entry("Check a robot on its bus; moves nothing.", "robot.doctor"),
    "calibrate": Entry("Measure the zeros and signs of the servos.", "robot.calibrate"),
    "watch": Entry("Show a limp robot while a person turns it by hand.", "robot.watch"),
    "bus": Entry("Serve a virtual Dynamixel bus until stopped.", "robot.bus"),
    "studio": Entry("Pose, plan and look in the browser.", "look.studio"),
    "replay": Entry("Replay a flight log and compare.", "look.replay"),
    "log": Entry("Export flight logs for other programs."),
    "log export": Entry("Write a flight log as a ROS 2 bag.", "look.export_log"),
    "bench": Entry("Run a benchmark on the twin or on the virtual bus."),
    "bench all": Entry("Measure a robot as one page that others can repeat.", "look.bench_all"),
    "bench rise": Entry("Rise from many settled falls.", "look.bench_rise"),
}
