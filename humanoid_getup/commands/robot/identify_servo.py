"""`getup identify servo`: motor and friction of a servo type, from logs of one on a lever."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import make_table
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, BadInputError
from humanoid_getup.commands.files import (
    FOLDER,
    READ,
    Written,
    check_different,
    find_new_folder_problems,
    staging,
)
from humanoid_getup.commands.options import CommandRequest
from humanoid_getup.progress.callback import ProgressMonitor
from robots.description.servo_catalog import (
    SERVOS_FILE,
    read_servo_models,
    servo_models,
    write_servo_model,
)
from robots.servo import ServoModel
from robots.storage.validation import between

if TYPE_CHECKING:
    from sim2real.identification.servo_fit import ServoFit

MARGIN = 0.98  # of the catalog's error, below which figures are better
TOO_FAR = 0.1  # rad of error, beyond which the logs are not of such a servo
TORQUE_SHARES = 0.6, 1.7  # of the catalog's stall torque, friction not taken off
OUT = Path("out/servo")
LEAST_LOGS = 3  # for intervals, of refits without some of them


@dataclass(frozen=True, kw_only=True)
class FitServoRequest(CommandRequest):
    """Identify motor and friction of a servo type from logs of one that moves a mass on a lever.

    With --port, logs are recorded first: in two minutes the servo moves the mass by up to 80° to
    each side of where it hangs, guarded; a key stops it. Nested models of friction are fitted; the
    one with the smallest error on held-out logs is chosen. Figures are written only if they are
    better there than those of the catalog.
    """

    logs: Annotated[Positional[tuple[Path, ...]], READ, arg(metavar="LOG...")] = ()
    """Flight logs of such recordings, or logs in the JSON format of BAM."""
    port: Annotated[str | None, arg(metavar="PATH")] = None
    """Serial port of a servo to record."""
    id: Annotated[int | None, between(0, 253), arg(metavar="ID")] = None
    """Id of the servo."""
    load: Annotated[str | None, arg(metavar="KG:M")] = None
    """Mass on its lever, and its distance from the horn."""
    out: Annotated[Path | None, FOLDER, arg(metavar="DIR")] = None
    """New folder for the recorded logs; default: out/servo."""
    yes: bool = False
    """Write what the servo keeps without power and the recording needs."""
    hold_out: Annotated[tuple[Path, ...], READ, arg(metavar="LOG,...")] = ()
    """Logs that are not fitted; default: each trajectory in turn."""
    servo: Annotated[str | None, arg(metavar="TYPE")] = None
    """Servo type, e.g. XL330-M288; default: that of the logs, if only one has their name."""
    write: Annotated[Path | None, Written((SERVOS_FILE,)), arg(metavar="DIR")] = None
    """Folder of the robot whose servos.toml gets the figures."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        given = {"--port": self.port, "--id": self.id, "--load": self.load}
        missing = [name for name, value in given.items() if value is None]
        if 0 < len(missing) < len(given):
            yield f"{' and '.join(missing)} is missing, expected {', '.join(given)} together"
        if self.load is not None:
            from robots.bench import Load  # loads MuJoCo, which --help does without

            try:
                Load.parse(self.load)
            except ValueError as error:
                yield str(error)
        if self.port is not None:
            yield from find_new_folder_problems(self.out or OUT, "--out")
        elif len(self.logs) < LEAST_LOGS:
            expected = f"expected {LEAST_LOGS} or more, or --port of a servo to record"
            yield f"logs to fit are {len(self.logs)}, {expected}"
        if self.write is not None and not (self.write / "robot.toml").exists():
            yield f"--write is {self.write}, expected the folder of a robot, with a robot.toml"


@dataclass(frozen=True, kw_only=True)
class IdentifiedServo:
    """Identified figures of a servo type, and errors along the logs."""

    servo: str
    model: str
    """Model of friction."""
    parameters: dict[str, float]
    """By the keys of servos.toml; motor constant [N·m/A], resistance [Ω] and encoder offset [rad]
    beside them."""
    intervals: dict[str, tuple[float, float]]
    """95 % intervals, of refits without parts of the logs."""
    not_identified: tuple[str, ...]
    """Parameters that the logs leave open."""
    mae_mrad: float
    """Mean absolute error of the angle along the fitted logs."""
    log_mae_mrad: dict[str, float]
    """That along each of them."""
    held_out_mae_mrad: float
    catalog_mae_mrad: float
    """That of the catalog's figures, along the held-out logs or, without any, all."""
    warnings: tuple[str, ...]
    logs: dict[str, str]
    """SHA-256 of each log."""
    doubt: str
    """Why the figures are not to be used; empty if they may be."""
    written: bool


@command("identify servo", json=True)
def identify_servo(request: FitServoRequest, monitor: ProgressMonitor) -> IdentifiedServo:
    """Identify a servo type from logs, which are recorded first if there is a port."""
    from sim2real.identification.servo_fit import ServoFitter
    from sim2real.identification.servo_log import check_servo, find_warnings, load_servo_log

    recorded = [] if request.port is None else _record(request, request.port, monitor)
    monitor.begin("reading")
    logs = [load_servo_log(path) for path in (*request.logs, *recorded)]
    held_out = [load_servo_log(path) for path in request.hold_out]
    every = [*logs, *held_out]
    check_different([(log.name, log.checksum) for log in every])
    model = _choose_model(request, every[0].servo)
    check_servo(every, model)
    fitter = ServoFitter(model)
    fit = fitter.identify(logs, held_out, monitor.begin)
    values = {name: one.value for name, one in fit.parameters.items()}
    catalog = fitter.measure_catalog(held_out or logs, values["offset"])
    identified = fit.apply(model)
    doubt = _find_doubt(identified, model, fit, catalog)
    if request.write is not None and not doubt:
        about = ["Identified by `getup identify servo` from logs (SHA-256):"]
        about += [f"{log.name}: {log.checksum}" for log in every]
        if fit.not_identified:
            about.append(f"Not identified one by one: {', '.join(fit.not_identified)}")
        write_servo_model(request.write, identified, about)
    return IdentifiedServo(
        servo=model.name,
        model=fit.model,
        parameters=values,
        intervals={name: (one.lower, one.upper) for name, one in fit.parameters.items()},
        not_identified=fit.not_identified,
        mae_mrad=1e3 * float(fit.errors.mean()),
        log_mae_mrad=dict(
            zip((log.name for log in logs), (1e3 * fit.errors).tolist(), strict=True)
        ),
        held_out_mae_mrad=1e3 * fit.held_out_error,
        catalog_mae_mrad=1e3 * catalog,
        warnings=tuple(find_warnings(every, model)),
        logs={log.name: log.checksum for log in every},
        doubt=doubt,
        written=request.write is not None and not doubt,
    )


def _record(request: FitServoRequest, port: str, monitor: ProgressMonitor) -> list[Path]:
    """Record the logs of a servo; return their paths."""
    from drivers.dynamixel.clock import CycleClock
    from drivers.safety_limits import GuardLimits
    from drivers.service.moved_servo import find_bench, make_driver
    from drivers.service.recorded_servo import ServoRecorder, check_recordable, list_recordings
    from drivers.terminal_keys import StopKey
    from humanoid_getup.commands.backends import CancellableGuard
    from robots.bench import Load
    from robots.bus_settings import MAIN_PORT

    monitor.begin("searching")
    load = Load.parse(request.load or "")
    bench, kept = find_bench(port, request.id, None, None, limit_by="pwm")
    name = bench.joints[0].servo.model.name
    if request.servo not in (None, name):
        raise BadInputError(f"--servo is {request.servo}, expected {name}, that on the port")
    check_recordable(bench, load)
    if kept and not request.yes:
        listed = ", ".join(f"{register} = {value}" for register, value in kept.items())
        raise BadInputError(f"the servo has to keep {listed} without power: --yes writes that")
    driver = make_driver(bench, {MAIN_PORT: port})
    with driver:
        waits = driver.waits_for_commands()
    for warning in driver.diagnostics.warnings:
        monitor.tell(str(warning))
    if waits:  # as a virtual bus in lock-step does
        driver = make_driver(bench, {MAIN_PORT: port}, CycleClock())
    guard = CancellableGuard(driver, GuardLimits.of(bench), monitor.check)
    recorder = ServoRecorder(guard=guard, load=load, realtime=not waits, tell=monitor.tell)
    names, out = tuple(list_recordings(bench)), request.out or OUT
    with StopKey(guard.stop), staging(out, names) as folder:
        recorder.record(folder, monitor.count("recording", len(names)))
    return [out / name for name in names]


def _find_doubt(identified: ServoModel, known: ServoModel, fit: ServoFit, catalog: float) -> str:
    """Find why figures are not to be used, by their fit and the catalog's error [rad]."""
    error, ends = fit.held_out_error, ", ".join(fit.at_bounds)
    share, (least, most) = identified.stall_torque / known.stall_torque, TORQUE_SHARES
    if error > TOO_FAR:
        return (
            f"{1e3 * error:.0f} mrad along held-out logs: no servo like this one moves so; check "
            "sign, zero and unit of the angles"
        )
    if error >= MARGIN * catalog:
        return (
            f"{1e3 * error:.1f} mrad along held-out logs, {1e3 * catalog:.1f} mrad with the "
            "catalog's figures: keep those, or record more trajectories, loads and P gains"
        )
    if ends:
        return f"the logs ask for more or less {ends} than any such servo has: check load and clock"
    if not least <= share <= most:
        return (
            f"stall torque is {share:.2f} of the catalog's, expected {least:g} to {most:g}: check "
            "mass and length of the lever, and the supply"
        )
    return "" if identified.top_speed > 0.0 else "friction takes all of the motor's torque"


@identify_servo.show
def _print(found: IdentifiedServo, request: FitServoRequest, console: Console) -> int:
    table = make_table((found.servo, "value", "95 %"), left=(found.servo,))
    for name, value in found.parameters.items():
        lower, upper = found.intervals[name]
        reach = "not identified" if name in found.not_identified else f"{lower:.3g} to {upper:.3g}"
        table.add_row(escape(name), f"{value:.4g}", reach)
    console.print(table)
    console.print(
        f"{found.model}: {found.mae_mrad:.1f} mrad along the logs, {found.held_out_mae_mrad:.1f} "
        f"held out; catalog {found.catalog_mae_mrad:.1f}"
    )
    for warning in found.warnings:
        console.print(f"[yellow]![/] {escape(warning)}")
    if found.doubt:
        console.print(f"not to be used: {found.doubt}", markup=False, soft_wrap=True)
        return DID_NOT_STAND
    if request.write is not None:
        console.print(f"written to {request.write / SERVOS_FILE}", markup=False, soft_wrap=True)
    return DID_IT


def _choose_model(request: FitServoRequest, name: str) -> ServoModel:
    """Choose the servo type that is named, or the only one that the logs can mean."""
    from sim2real.identification.servo_log import is_of

    models, problems = read_servo_models(request.write) if request.write else (servo_models(), [])
    if problems:
        raise BadInputError(*problems)
    if request.servo is not None:
        if request.servo not in models:
            raise BadInputError(f"--servo is {request.servo}, expected one of {', '.join(models)}")
        return models[request.servo]
    fitting = [each for each, model in models.items() if is_of(name, model)]
    if len(fitting) != 1:
        known = ", ".join(fitting or models)
        raise BadInputError(f"the logs are of a servo '{name}': choose --servo among {known}")
    return models[fitting[0]]
