"""`getup first-steps`: the commands from a port to the first rise, one after the other."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

from rich.markup import escape
from tyro.conf import arg

from humanoid_getup.commands.command import program
from humanoid_getup.commands.console import console_for
from humanoid_getup.commands.errors import DID_IT, INTERRUPTED
from humanoid_getup.commands.files import FOLDER
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.options import ServiceOptions
from humanoid_getup.commands.prompt import open_prompt
from humanoid_getup.motions.motion_database import list_lying_down, list_motions, load_database
from robots import Robot
from robots.imu import IMU_PORT
from robots.storage.files import write_atomically
from robots.storage.validation import between


@dataclass(frozen=True, kw_only=True)
class FirstSteps(ServiceOptions):
    """Lead from a port to the first rise: each step is a command, shown, and run after Enter.

    What is done is kept, so that the next start goes on where this one ended.
    """

    desk: bool = False
    """Loose servos on a desk instead of a robot."""
    torque_limit: Annotated[float | None, between(0.001, 1000.0, "N·m"), arg(metavar="N·m")] = None
    """Torque limit per servo of the first rise [N·m]; default: 60 % of the stall torque of the
    strongest."""
    out: Annotated[Path | None, FOLDER, arg(metavar="DIR")] = None
    """Folder for what is done, reports and flight logs; default: out/first-steps/ROBOT."""


class Task(NamedTuple):
    """A command of `getup`, what it is for, and what a person does before it."""

    name: str
    aim: str
    command: str
    before: str = ""
    asks: str = ""
    """What a person adds as the last word of the command."""

    def fill(self, known: dict[str, str]) -> Task:
        """Fill in what is known of the robot and its port."""
        return Task(*(text.format_map(known) for text in self))


LITTLE, GENTLE = 0.3, 0.6  # shares of the strongest servo's stall torque: in the air, and to rise
# fmt: off
LIST = Task("list", "Find the servos, and what they measure: one line for each.",
            "servo list --port {port}", "Supply them; close other programs on the port.")
DESK = (
    LIST,
    Task("id", "Give a servo that is alone on the port another id.", "servo id --port {port}",
         "Unplug all servos but one.", "new id"),
    Task("read", "Read its supply and its temperature.",
         "servo read present_input_voltage present_temperature --port {port}"),
    Task("monitor", "See its angle follow your hand.", "servo monitor --port {port}",
         "Turn the horn where its torque is off; q ends it."),
    Task("move", "Move it by 10°: the first torque.", "servo move --by 10 --port {port}",
         "Fasten it, its horn free; any key stops it."),
)
ROBOT = (
    LIST,
    Task("ids", "Give each servo its id and baud rate, one at a time.", "servo setup {on}",
         "Skip it unless the list lacks an id, or shows one twice."),
    Task("doctor", "Check every servo, the IMU and the timing; nothing moves.",
         "doctor {on}"),
    Task("signs", "Measure which way each servo turns.", "calibrate {on} --signs",
         "Hang the robot up, or lay it down; then turn one joint after the other."),
    Task("zeros", "Measure the zeros of the servos.", "calibrate {on} --at {posture}",
         "Hold the robot in this posture: {posture}."),
    Task("watch", "Compare angles and IMU with the robot.", "watch --backend dynamixel {on}",
         "Turn joints by hand and lay the robot on each side; q ends it."),
    Task("move", "Move a joint by 5°: the first torque, and little of it.",
         "servo move {on} --torque-limit {little} --by 5 --joint",
         "Hang the robot up with its limbs free; any key stops it.", "joint"),
)
DISCOVER = Task("motions", "Find motions for this body in physics; it takes a while.",
                "motions discover --robot {robot}")
PREFLIGHT = Task("preflight", "Check in simulation that {motion} works with little torque.",
                 "preflight {motion} --robot {robot} --torque-limit {limit}",
                 "Where it does not stand, leave, and begin again with more --torque-limit.")
RISE = Task("rise", "Get up once, gently; then {then}.",
            "{way} --backend dynamixel {on} --torque-limit {limit} --then {end} --out {out}/rise",
            "Lay the robot on its back, a meter free on all sides; any key stops it.")
# fmt: on


@program("first-steps")
def first_steps(command: FirstSteps) -> int:
    """Lead a person through the steps; 0 once all are done, else the code of the last command."""
    console = console_for(command)
    prompt = open_prompt(console, "the input ended before the last step")
    if prompt is None:
        raise ValueError("standard input is not a terminal: first-steps needs a person")
    robot = None if command.desk else load_robot(command)
    folder = command.out or Path("out") / "first-steps" / (robot.name if robot else "desk")
    file, code = folder / "first_steps.json", DID_IT
    try:
        kept = dict(json.loads(file.read_text("utf-8"))) if file.exists() else {}
    except (ValueError, TypeError) as error:
        raise ValueError(f"{file} is damaged ({error}): remove it to start over") from error
    while step := next((s for s in list_steps(command, robot, folder) if s.name not in kept), None):
        console.print(f"\n[bold]step {len(kept) + 1}, {step.name}[/]: {escape(step.aim)}")
        if step.before:
            console.print(f"  {escape(step.before)}")
        console.print(f"  [dim]{escape(f'getup {step.command}')}")
        question = f"  {step.asks or 'Enter runs it'}, s skips it, q leaves:"
        if (answer := prompt.ask(question).strip()) == "q":
            return code
        if answer != "s":
            if bool(answer) != bool(step.asks):
                continue
            if code := run_getup(*shlex.split(f"{step.command} {answer}")):
                console.print(f"[bold red]{step.name} is not done[/]: exit code {code}, see above")
                if code == INTERRUPTED:
                    return code
                continue
        kept[step.name], code = "skipped" if answer == "s" else "done", DID_IT
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(file, json.dumps(kept, indent=2))
    console.print(f"[bold green]all steps are done[/]: {escape(str(file))}")
    return DID_IT


def run_getup(*words: str) -> int:
    """Run a command line at this terminal; an interrupt waits until it has switched torque off."""
    with subprocess.Popen(
        [sys.executable, "-m", "humanoid_getup.commands.main", *words]
    ) as program:
        try:
            return program.wait()
        except KeyboardInterrupt:
            program.terminate()
            program.wait()
            raise


def list_steps(command: FirstSteps, robot: Robot | None, folder: Path) -> list[Task]:
    """List the steps of a robot, as far as they are known, or those of servos on a desk."""
    first = next((word for word in command.port if not word.startswith(f"{IMU_PORT}=")), "")
    known = {"port": shlex.quote(first.rpartition("=")[2])}
    if robot is None:
        return [step.fill(known) for step in DESK]
    name, most = shlex.quote(command.robot), float(robot.max_torque.max())
    rising = load_database(robot).motions if list_motions(robot) else ()
    motion = next((m.name for m in rising if m.start_class == "supine" and m.rises), "")
    has_zero = bool(((robot.lower <= 0.0) & (robot.upper >= 0.0)).all())
    has_imu = robot.imu_kind is not None
    sits = bool(motion and has_imu and list_lying_down(robot))
    known |= {
        "robot": name,
        "on": f"--robot {name} --port {shlex.quote(','.join(command.port))}",
        "out": shlex.quote(str(folder)),
        "posture": "zero" if has_zero else "standing",
        "little": f"{LITTLE * most:.2g}",
        "limit": f"{command.torque_limit or float(f'{GENTLE * most:.2g}'):g}",
        "motion": motion,
        "way": "rise --attempts 1" if has_imu else f"play {motion} --without-imu",
        "end": "hold" if sits else "limp",
        "then": "a key lets it sit and lie down" if sits else "torque goes off: hold it then",
    }
    return [step.fill(known) for step in (*ROBOT, *((PREFLIGHT, RISE) if motion else (DISCOVER,)))]
