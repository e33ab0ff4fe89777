"""Style tab: curves that a policy follows, edited in the scene and rolled out at once."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from pathlib import Path

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import shorten_path
from humanoid_getup.commands.get_up.run import RunRequest
from humanoid_getup.commands.options import write_command
from humanoid_getup.commands.plan.extract_style import ExtractRequest, extract_style
from humanoid_getup.commands.policies import list_styled_policies
from humanoid_getup.experiments.falls import sample_fall
from humanoid_getup.motions.motion_database import list_motions
from humanoid_getup.studio.curve_board import CurveBoard, PointDrag
from humanoid_getup.studio.folders import containing
from humanoid_getup.studio.follow_style import (
    STANDS,
    RolloutRequest,
    StyledRollout,
    StyledTwin,
    measure_start,
)
from humanoid_getup.studio.form import Form
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.plain_text import escape, make_block
from humanoid_getup.studio.takes import IN_DEGREES, make_rollout_take
from humanoid_getup.style.curves import LONGEST, POINTS, SHORTEST, is_stand
from humanoid_getup.style.features import mirror_features
from humanoid_getup.style.style import SUFFIX, Style, load_named, load_style, rank_styles
from humanoid_getup.style.style_editor import StyleEditor, rise_time
from robots import Posture
from robots.description.posture_file import format_posture
from robots.storage.files import write_atomically

POLICY = "styled"
"""Name of the policy that is chosen first, if there is one."""
FEATURES = ("Neck height", "Side angle", "Front angle")
SOURCES = (".npz", ".mcap", ".bvh", ".amc")
STEP, FACTOR = 0.2, 1.25  # s; of one press of a button
OFTEN = 0.5  # s between two rollouts while a point is dragged
START = "-start.json"
FIRST = ("supine",)  # ways of lying from which a style is tried that was not measured
STYLES = "A named style, or a style file below --folder."
CURVES = "Those of one way of lying, which are edited."
BY_STEP = "Time by which Sooner and Later move the rise, and for which Hold holds."
HELD = "Time from which Hold holds what the robot does."
STYLE_KEY = re.compile(b"neck_height")  # in every style file


class StyleTab:
    """Elements that edit a style, and the board of its curves."""

    def __init__(self, page: Page) -> None:
        self._page = page
        policies = [] if page.request.body else list_styled_policies(page.world.robot)
        if not policies:
            page.gui.add_markdown(_explain_lack(page))
            return
        self.board = CurveBoard(
            page.server, page.world.robot.standing_neck_height, self._drag, page.answer
        )
        """Where its curves are dragged."""
        self._twin = StyledTwin(page.world)
        self.rollouts = page.add_job(self._twin.roll_out, self._show_rollout, apart=False)
        """Rises that follow it."""
        self._extractions = page.add_job(
            lambda request, cancel: extract_style(request, cancel=cancel),
            self._show_extracted,
            apart=False,
        )
        self._asked_at = -math.inf
        self._features = measure_start(page.world, page.start)
        self._named = load_named(page.world.robot)
        self._is_offered = True  # whether no one has chosen or changed the style
        self.editor = StyleEditor(page.world.robot, self._rank()[0])
        """The style that is edited."""
        self._add_elements(policies)
        page.when_posed.append(self._note_start)
        self._show()

    # Elements ----------------------------------------------------------------------------------

    def _add_elements(self, policies: list[str]) -> None:
        gui, first = self._page.gui, POLICY if POLICY in policies else policies[0]
        self._state = gui.add_markdown("")
        self._policy = gui.add_dropdown("Policy", policies, initial_value=first)
        self._style = gui.add_dropdown("Preset", self._list_styles(), hint=STYLES)
        self._curves = gui.add_dropdown("Curves", self._name_curves(), hint=CURVES)
        self._shown = gui.add_checkbox("Show curves", False)
        self._page.add_button("Run", self._run, main=True)
        self._page.on_change(self._shown, self._switch_board)
        self._page.on_change(self._policy, self._run_if_lying)
        self._page.on_change(self._style, lambda: self._begin(self._load(self._style.value)))
        self._page.on_change(self._curves, self._choose_curves)
        with gui.add_folder("Time"):
            self._add_times()
        with gui.add_folder("Point"):
            self._add_point()
        with gui.add_folder("Curves from"):
            self._source = gui.add_dropdown("Source", self._list_sources())
            self._form = Form(gui, ExtractRequest, {"finish": "End in a stand"})
            self._page.add_button("Take curves", self._extract)
        with gui.add_folder("Style file"):
            self._file = gui.add_text("File", f"style{SUFFIX}")
            self._page.add_button("Save style", self._save)
            self._page.add_button("Copy as command", self._copy)
            self._command = gui.add_markdown("")

    def _add_times(self) -> None:
        gui = self._page.gui
        self._duration = gui.add_slider("Duration [s]", SHORTEST, 10.0, 0.05, 3.0)
        self._page.on_change(
            self._duration, lambda: self._edit(lambda: self.editor.last(self._duration.value))
        )
        self._step = gui.add_number(
            "Step [s]", STEP, min=0.01, max=LONGEST, step=0.01, hint=BY_STEP
        )
        self._add_group(
            "Rise",
            {
                "Sooner": lambda: self.editor.shift(-self._step.value),
                "Later": lambda: self.editor.shift(self._step.value),
            },
        )
        self._add_group(
            "Pace",
            {
                "Slower": lambda: self.editor.last(self.editor.curves.duration * FACTOR),
                "Faster": lambda: self.editor.last(self.editor.curves.duration / FACTOR),
            },
        )
        self._hold_at = gui.add_number(
            "Hold at [s]", 1.0, min=0.0, max=LONGEST, step=0.01, hint=HELD
        )
        self._add_group(
            "Shape",
            {
                "Hold": lambda: self.editor.hold(self._hold_at.value, self._step.value),
                "Mirror": lambda: self.editor.mirror(),
                "Undo": lambda: self.editor.undo(),
            },
        )

    def _add_group(self, label: str, works: dict[str, Callable[[], None]]) -> None:
        group = self._page.gui.add_button_group(label, tuple(works))
        group.on_click(self._page.answer(lambda: self._edit(works[group.value])))

    def _add_point(self) -> None:
        gui = self._page.gui
        self._feature = gui.add_dropdown("Curve", FEATURES)
        self._point = gui.add_slider("Point", 1, POINTS, 1, 1)
        self.value = gui.add_number("Value", 0.0, step=0.001)
        """Value of the chosen control point, as a share of standing or in degrees."""
        self._page.on_change(self._feature, self._show)
        self._page.on_change(self._point, self._show)
        self._page.add_button("Set", self._set_point)

    # Styles ------------------------------------------------------------------------------------

    def _list_styles(self) -> list[str]:
        named = [style.name for style in self._rank()]
        return [*named, *self._page.folders.list_files(SUFFIX, containing(STYLE_KEY))]

    def _rank(self) -> list[Style]:
        """Order the named styles, those first that suit the start."""
        return rank_styles(self._named, self._features)

    def _list_sources(self) -> list[str]:
        files = [name for kind in SOURCES for name in self._page.folders.list_files(kind)]
        return [*list_motions(self._page.world.robot), *files] or ["none"]

    def _load(self, name: str) -> Style:
        path = self._page.folders.resolve(name) if name.endswith(SUFFIX) else name
        return load_style(path, self._page.world.robot)

    def _begin(self, style: Style) -> None:
        """Edit another style, from the curves that the start follows."""
        self._is_offered = False
        self.editor = StyleEditor(self._page.world.robot, style)
        self.editor.chosen = style.find(self._features)[0]
        self._refresh()

    def _choose_curves(self) -> None:
        self.editor.chosen = self._curves.options.index(self._curves.value)
        self._show()

    def _extract(self) -> None:
        name = self._source.value
        is_file = name.lower().endswith(SOURCES)
        if name not in self._source.options:
            raise BadInputError(f"source {name}: expected one of the list")
        source = str(self._page.folders.resolve(name)) if is_file else name
        request = ExtractRequest(
            robot=self._page.request.robot,
            source=source,
            out=self._page.scratch / f"{Path(name).stem}{SUFFIX}",
            **self._form.read(),
        )
        self._page.say(f"Curves of {name} are extracted …")
        self._extractions.ask(request)

    def _show_extracted(self, _: ExtractRequest, style: Style) -> None:
        self._begin(style)
        self._page.say(f"Curves {style.about}.")

    def _save(self) -> None:
        self._page.say(f"Saved {self._page.folders.name(self._write_style())}.")

    def _write_style(self) -> Path:
        path = self._page.folders.resolve_new("style file", self._file.value, SUFFIX)
        self.editor.save(path)
        name, styles = self._page.folders.name(path), self._list_styles()
        self._style.options = styles
        if name in styles:
            self._style.value = name
        self._show()
        return path

    def _copy(self) -> None:
        """Save style and start, and show the command that has the same joint path."""
        style = self._write_style()
        start = self._page.folders.resolve(str(style.with_name(style.stem + START)))
        write_atomically(start, format_posture(self._page.start, self._page.world.robot))
        given = self._page.request
        request = RunRequest(
            policy=self._policy.value,
            robot=given.robot,
            scene=given.scene,
            seed=0 if self._page.world.scene.is_flat else given.seed,
            style=str(shorten_path(style)),
            origin=str(shorten_path(start)),
        )
        self._command.content = make_block(write_command("run", request))
        self._page.say(f"Saved {style.name} and {start.name}; the command is below.")

    # Edits -------------------------------------------------------------------------------------

    def _edit(self, change: Callable[[], None]) -> None:
        """Change the style; one that is refused is shown as it was."""
        self._is_offered = False
        try:
            change()
        except ValueError:
            self._show()
            raise
        self._refresh()

    def _refresh(self) -> None:
        self._show()
        self._run_if_lying()

    def _set_point(self) -> None:
        feature = FEATURES.index(self._feature.value)
        value = self.value.value / IN_DEGREES[feature]
        self._move(feature, int(self._point.value) - 1, value)

    def _move(self, feature: int, point: int, value: float) -> None:
        self._edit(lambda: self.editor.change(self.editor.move_point(feature, point, value)))

    def _drag(self, drag: PointDrag) -> None:
        """Let the curves follow a control point that is dragged."""
        self._feature.value, self._point.value = FEATURES[drag.feature], drag.point + 1
        if drag.released:
            return self._release(drag)
        try:
            curves = self.editor.move_point(drag.feature, drag.point, drag.value)
        except ValueError:  # told once it is released: it may be dragged on to where it is possible
            return None
        self.board.show(curves, (drag.feature, drag.point))
        self._show_value(curves.points[drag.point, drag.feature])
        if time.monotonic() - self._asked_at >= OFTEN:
            self._ask(self.editor.preview(curves), at_once=False)
        return None

    def _release(self, drag: PointDrag) -> None:
        """Move a point to where it was released; a drag that is refused is rolled out no more."""
        try:
            self._move(drag.feature, drag.point, drag.value)
        except ValueError:
            self._run_if_lying()
            raise

    # Rollouts ----------------------------------------------------------------------------------

    def _note_start(self, posture: Posture) -> None:
        """Offer the style that suits a new start, and choose the curves that it follows."""
        self._features = measure_start(self._page.world, posture)
        styles, chosen = self._list_styles(), self._style.value
        if self._is_offered:
            self.editor, chosen = StyleEditor(self._page.world.robot, self._rank()[0]), styles[0]
        self._style.options = styles
        if chosen in styles:
            self._style.value = chosen
        self.editor.chosen = self.editor.style.find(self._features)[0]
        self.board.place(posture.position)
        self.board.hide_followed()
        self._show()

    @property
    def _stands(self) -> bool:
        return bool(is_stand(self._features))

    def _run(self) -> None:
        """Roll out a rise; a robot that stands is posed in a fall that suits the style first."""
        if self._stands:
            lying = (self.editor.style.followed_from or FIRST)[0]
            world, seed = self._page.world, self._page.request.seed
            self._page.pose(sample_fall(world, lying, seed).posture)
        self._ask(self.editor.style)

    def _run_if_lying(self) -> None:
        if self._stands:
            return self._page.say(f"Nothing is rolled out: {STANDS} (Pose tab).")
        return self._run()

    def _ask(self, style: Style, *, at_once: bool = True) -> None:
        """Request a rollout, in place of those that were requested before."""
        if self._stands:
            raise BadInputError(f"{STANDS}: sample a fall on the Pose tab")
        self._asked_at = time.monotonic()
        if self._policy.value not in self._policy.options:
            raise BadInputError(f"policy {self._policy.value}: expected one of the list")
        request = RolloutRequest(policy=self._policy.value, start=self._page.start, style=style)
        self.rollouts.ask(request, at_once=at_once)

    def _show_rollout(self, _: RolloutRequest, rollout: StyledRollout) -> None:
        """Play a rollout, and draw what it followed over the curves that are edited."""
        take = make_rollout_take(rollout)
        self._page.timeline.load(take)
        is_mirrored = self.editor.style.find(rollout.measured[0])[1]
        self.board.show_followed(
            rollout.time,
            mirror_features(rollout.measured) if is_mirrored else rollout.measured,
            rollout.curves.duration,
        )
        self._page.say(take.facts[0])

    # Display -----------------------------------------------------------------------------------

    def _switch_board(self) -> None:
        """Show the curves behind the posture of the page, or hide them."""
        if self._shown.value:
            self.board.put_up(self._page.start.position)
        else:
            self.board.hide()

    def _show(self) -> None:
        """Show the style, its curves, and the chosen point."""
        editor, curves = self.editor, self.editor.curves
        self._curves.options = self._name_curves()
        self._curves.value = self._curves.options[editor.chosen]
        self._duration.max = max(10.0, math.ceil(curves.duration))
        self._duration.value = curves.duration
        feature, point = FEATURES.index(self._feature.value), int(self._point.value) - 1
        self._show_value(curves.points[point, feature])
        self.board.show(curves, (feature, point))
        self._state.content = self._describe()

    def _name_curves(self) -> list[str]:
        return [_name(k, curves.start) for k, curves in enumerate(self.editor.style.curves)]

    def _show_value(self, value: float) -> None:
        feature = FEATURES.index(self._feature.value)
        self.value.value = round(value * IN_DEGREES[feature], 3)

    def _describe(self) -> str:
        """Describe the style, and which of its curves the start follows."""
        editor, curves = self.editor, self.editor.curves
        times = f"{rise_time(curves):.2f} of {curves.duration:.2f} s"
        text = f"**{escape(editor.style.name)}**: rises at {times}"
        if (starts := editor.style.followed_from) is not None:
            text += f", followed from {', '.join(starts) or 'nowhere yet'}"
        if self._stands:
            return f"{text}. {STANDS.capitalize()} (Pose tab)."
        followed, is_mirrored = editor.style.find(self._features)
        mirrored = ", mirrored" if is_mirrored else ""
        if len(editor.style.curves) == 1 and not is_mirrored:
            return f"{text}."
        name = _name(followed, editor.style.curves[followed].start)
        these = "these" if followed == editor.chosen else f"'{escape(name)}'"
        return f"{text}. From this start it follows {these}{mirrored}."


def _name(number: int, start: str) -> str:
    """Name the curves of a style in a list."""
    return f"{number + 1} {start}".strip()


def _explain_lack(page: Page) -> str:
    robot = page.world.robot
    if page.request.body:
        return (
            "Policies follow styles with the original body alone: open the studio without --body."
        )
    return (
        f"No policy of robot '{robot.name}' follows styles. `getup train --recipe styled` and "
        f"`getup export` make one; put it into {robot.folder / 'policies'}."
    )
