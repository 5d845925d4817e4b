"""The page of controls: jog by steps, move, home, stop, enable. Each control shows the lines that it sends.

Everything is sent as if it were typed, so guards ask and the transcript shows it. To leave the page stops nothing: a
move ends by itself.

A jog is one bounded move a press. A terminal sends no key-up, and repeats a held key. So a press counts only while the
axis is known to rest: a reading that is newer than the last line says so, and no line runs or waits. A press right
after another one is the keyboard's repetition. What does not count is dropped and counted, and nothing of it is kept.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from string import ascii_letters, digits
from typing import ClassVar

from textual.binding import Binding, BindingType

from multidrop.base.text import counted
from multidrop.dialects.controls import (
    BY,
    DISABLE,
    ENABLE,
    HIGH,
    HOME_MINUS,
    HOME_PLUS,
    LOW,
    STOP,
    TO,
    Control,
    Controls,
)
from multidrop.tui.panels.drive import drive_rows, unit_of
from multidrop.tui.panels.view import Glance, View, name_of
from multidrop.tui.readout import READ, Readout, ReadoutState
from multidrop.tui.screens.page import PageHost, SendingPage
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row, Span, spread, width_of

REPETITION = 0.2
"""Seconds between two presses below which the second is the repetition of a held key."""
SETTLE = 0.05
"""Seconds after the end of a line before a reading shows what the line has done."""


@dataclass
class Jog:
    """The presses of one page."""

    dropped: int = 0
    """Presses that did not count since the last one that did."""
    why: str = ""
    """The reason of the last drop."""
    _pressed: float = -math.inf
    _busy: float = -math.inf
    """When a line was last seen to run or wait."""

    def look(self, now: float, *, idle: bool) -> None:
        if not idle:
            self._busy = now

    def allows(self, readout: Readout, axis: Readout, state: ReadoutState, now: float, *, idle: bool) -> bool:
        """True if a press at this time counts; one that does not is dropped."""
        self.look(now, idle=idle)
        repeated = now - self._pressed < REPETITION
        self._pressed = now
        self.why = "a key that is held repeats" if repeated else self.obstacle(readout, axis, state, now)
        if self.why:
            self.dropped += 1
            return False
        self.dropped, self._busy = 0, now
        return True

    def obstacle(self, readout: Readout, axis: Readout, state: ReadoutState, now: float) -> str:
        """The reason for which no move may start now; empty: it may."""
        if state not in READ or axis.last is None:
            return f"it is {'not read yet' if state is ReadoutState.UNKNOWN else state.word}"
        if state is ReadoutState.MOVING or axis.last.velocity != 0:
            return "it moves"
        if self._busy == now:
            return "a line is on its way"
        if axis.last.at <= max(self._busy + SETTLE, readout.touched) or readout.old(now):
            return "it has not been read at rest since the last line"
        if axis.conditions is not None and axis.conditions.disabled:
            return f"no current in the motor ({axis.conditions.disabled})"
        if axis.conditions is not None and axis.conditions.blocked:
            return axis.conditions.blocked
        return "a program runs" if readout.program.name else ""


STEPS = tuple(10**n for n in range(8))
"""The sizes of a step that keys choose."""
FIRST_STEP = 100
NUMBERED = {"m": (TO, "position"), "b": (BY, "distance"), "l": ("", "step")}
"""Keys that ask for a number: the control that takes it, and what it is. An empty name sets the step."""
SPACE = "space"
KEYED = {"-": HOME_MINUS, "+": HOME_PLUS, SPACE: STOP, "e": ENABLE, "d": DISABLE}
"""Keys of controls. Enter sends them, apart from the stop; a direction counts after `h`."""
WORDS = {
    TO: "move to",
    BY: "move by",
    HOME_MINUS: "home −",
    HOME_PLUS: "home +",
    STOP: "stop",
    ENABLE: "enable",
    DISABLE: "disable",
}
NO_CONTROLS = "this family has no controls"
WHOLE = re.compile(r"[+-]?[0-9]{1,10}")
KEY = 9
WORD = 10
LINE = 22


class ControlsPage(SendingPage):
    """Controls of the selected drive."""

    SHEET = "controls"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding(letter, "drop", show=False) for letter in ascii_letters + digits if letter not in "lmbhed"
    ]
    WANTS = frozenset({"motion", "conditions"})
    STOPS = frozenset({"space"})
    PARTS = {"heading": None, "drive": "auto", "controls": "1fr", "number": None, "said": None}
    FIELD = "number"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self.step = FIRST_STEP
        self._jog = Jog()
        self._axis = 0
        self._homing = False
        """The next key may be the direction of a homing."""
        self._place = host.session.place
        self._view: View | None = None

    def on_mount(self) -> None:
        """Hide the field until a number is asked for; what failed before is not the page's."""
        self.host.model.trouble = ""
        self.lines("drive").styles.max_height = "50%"

    # What is shown

    def show(self, view: View) -> None:
        """Paint the drive, and the controls with the lines that they send now."""
        self._view = view
        # Forget a number that was begun before a stop, or for another drive.
        place = view.session.place
        if place != self._place:
            self._place, self._axis, self._jog = place, 0, Jog()
        asked = self.asked
        if asked is not None and asked.overtaken(self.host.session):
            self._close("stopped; the number was not used" if asked.place == place else "another drive is selected")
        begun = self.begun
        if begun is not None and begun.overtaken(self.host.session):
            self.begun = None
            self.say("stopped; nothing was sent" if begun.place == place else "another drive is selected")
        if view.model.trouble:
            self.say(f"✗ {view.model.trouble}")
            view.model.trouble, self.begun = "", None
        self._jog.look(view.now, idle=self.host.outbox.idle)
        glance, width = view.chosen, self.size.width
        bus = view.session.selected_bus
        name = f"{bus}:{name_of(glance)}" if glance is not None else "no drive selected"
        right: Row = (("each key press is one move; ^X stops all ", "dim"),)
        self.lines("heading").put([spread([(" CONTROLS   ", "strong"), (name, "accent")], right, width)])
        self.lines("drive").put_all(drive_rows(view, width, max(3, self.size.height - 19)))
        self.lines("controls").put(self._rows(view, glance, width))
        self.lines("said").put([((" ", "text"), (fit(self.said[0], width - 2), self.said[1]))])
        self.painted = self.begun is not None and (self.painted or self.host.keyboard.idle)

    def _rows(self, view: View, glance: Glance | None, width: int) -> list[Row]:
        controls = self._controls()
        if glance is None or not controls:
            return [((" ^O chooses a drive" if glance is None else f" {NO_CONTROLS}", "dim"),)]
        axes = glance.readout.axes
        axis = axes[min(self._axis, len(axes) - 1)]
        other = "   Tab chooses the axis" if len(axes) > 1 else ""
        unit = unit_of(axis, glance.unit)
        head: list[Span] = [
            ("─ ", "rule"),
            (f"jog {axis.axis}".rstrip() + "  ", "dim"),
            (f"{self.step} {unit}", "strong"),
        ]
        jog = controls[BY]
        minus, plus = (self._shown(jog, axis, sign * self.step) for sign in (-1, 1))
        ready = self._jog.obstacle(glance.readout, axis, glance.state(), view.now)
        head.append((f"   ↑↓ choose the step, l types it{other} ", "dim"))
        rows: list[Row] = [
            (*head, ("─" * max(0, width - width_of(head)), "rule")),
            ((f" {fit('←', KEY)}", "key"), (fit(minus, WORD + LINE), "text"), (f"→  {plus}", "text")),
            ((f" {fit('', KEY)}", "text"), self._readiness(ready)),
            (("─ ", "rule"), ("move ", "dim"), ("─" * max(0, width - 7), "rule")),
        ]
        for key, name in ((key, name) for key, (name, _) in NUMBERED.items() if name):
            rows.append(_control_row(key, name, controls[name], "…", width))
        for key, name in KEYED.items():
            rows.append(_control_row(key, name, controls[name], "", width))
        return rows

    def _readiness(self, why: str) -> Span:
        """True if the next press moves, or why not; with the presses that were dropped."""
        count = self._jog.dropped
        presses = counted(count, "press", "presses")
        dropped = f"; {presses} dropped ({'last: ' * (count > 1)}{self._jog.why})" if count else ""
        if not why:
            return f"ready{dropped}", "text" if dropped else "dim"
        return f"a press is dropped now: {why}{dropped}", "motion" if why == "it moves" else "strong"

    @staticmethod
    def _shown(control: Control, axis: Readout, by: int) -> str:
        to = axis.last.position + by if axis.last is not None else None
        return control.shown(by=str(by), to="…" if to is None else str(to))

    # Keys

    def _chosen(self) -> tuple[Glance, Readout] | None:
        """The selected drive and its chosen axis, as they are now."""
        glance = self._view.chosen if self._view is not None else None
        if glance is None or self._place != self.host.session.place:
            return None
        axes = glance.readout.axes
        return glance, axes[min(self._axis, len(axes) - 1)]

    def _controls(self) -> Controls:
        """The controls of the chosen axis. A drive that is not shown yet has its first axis: its stop does not wait."""
        session = self.host.session
        drive = session.selected
        if drive is None:
            return {}
        chosen = self._chosen()
        first = self.host.model.bus(session.selected_bus).readout(drive.address).axes[0]
        return drive.family.values.controls(first.axis if chosen is None else chosen[1].axis)

    def _nothing(self) -> str:
        """Why a key other than the stop does nothing: there is no drive, or the person has not seen it yet."""
        if self.host.session.selected is None:
            return "no drive is selected"
        return (
            "" if self._chosen() is not None else "nothing was sent: the drive was not shown yet; press the key again"
        )

    def action_step(self, by: int) -> None:
        self.begun = None
        larger = [step for step in STEPS if step > self.step]
        smaller = [step for step in STEPS if step < self.step]
        steps = larger[:1] if by > 0 else smaller[-1:]
        self.step = steps[0] if steps else self.step

    def action_axis(self) -> None:
        self.begun = None
        chosen = self._chosen()
        if chosen is not None:
            self._axis = (self._axis + 1) % len(chosen[0].readout.axes)
            self._jog = Jog()

    def action_jog(self, sign: int) -> None:
        """Move by one step, if the drive is known to rest; else drop the press."""
        self.begun = None
        self._move(BY, sign * self.step)

    def action_do(self, key: str) -> None:
        """Stop at once; every other control waits for Enter, as a letter alone neither moves nor lets go."""
        name = KEYED[key]
        control = self._controls().get(name)
        self.begun, self._homing = None, False
        if name == STOP and control is not None and not control.absent:
            self.host.outbox.at_once(control.filled())
            self.say(f"sent: {', '.join(control.filled())}", "dim")
        elif nothing := self._nothing():
            self.say(nothing)
        elif control is None or control.absent:
            self.say(f"no {WORDS[name]}: {control.absent}" if control is not None else NO_CONTROLS)
        else:
            self.offer(key, control.filled())
            about = f" - {control.about}" if control.about else ""
            self.say(f"Enter sends {', '.join(control.filled())}{about}   Esc: nothing")

    def action_go(self) -> None:
        """Send the control that was begun, unless a stop or another drive came in between."""
        if self.begun is None and self._homing:
            self.action_drop()
        elif (begun := self.accepted()) is not None:
            name = KEYED[begun.kind]
            if name in (HOME_MINUS, HOME_PLUS):
                self._move(name, 0)
            elif (control := self._controls().get(name)) is not None:
                self.send(control.filled())

    def action_home(self) -> None:
        """Ask for the direction of a homing: one letter begins none."""
        self.action_drop()
        self._homing = not self._nothing()
        self.say(self._nothing() or "home: - or + is the direction   Esc: nothing")

    def action_toward(self, sign: str) -> None:
        if self._homing:
            self.action_do(sign)

    def action_drop(self) -> None:
        """Drop the control that waits for Enter: a key that means nothing here is part of a word, such as `halt`."""
        if self.begun is not None or self._homing:
            self.begun, self._homing = None, False
            self.say("nothing was sent")

    def action_ask(self, key: str) -> None:
        self.begun = None
        if not self._controls() or self._nothing():
            self.say(self._nothing() or NO_CONTROLS)
            return
        self.ask_for(key, "", f"{NUMBERED[key][1]}: a whole number, then Enter; Esc: none; Space: stop")

    def edited(self, text: str) -> None:
        """Take a blank, which no number has, as the key of the stop."""
        if " " in text:
            self.field.value = text.replace(" ", "")
            self.action_do(SPACE)

    def typed(self, text: str) -> None:
        asked = self.asked
        if asked is None or asked.overtaken(self.host.session):
            self._close("the number was not used")
            return
        name, what = NUMBERED[asked.kind]
        if not WHOLE.fullmatch(text):
            wrong = f"no {what} {text[:20]}; " if text else ""
            self.say(f"nothing was sent: {wrong}type a whole number such as -1500")
            return
        number = int(text)
        if not LOW <= number <= HIGH or (not name and number <= 0):
            low = LOW if name else 1
            self.say(f"nothing was sent: {what} {number} is out of range; valid: {low} to {HIGH}")
            return
        self._close("")
        if name:
            self._move(name, number)
        else:
            self.step = number

    def _move(self, name: str, number: int) -> None:
        """Start a move, if the drive is known to rest."""
        chosen, control = self._chosen(), self._controls().get(name)
        if chosen is None or control is None:
            self.say(self._nothing() or NO_CONTROLS)
            return
        glance, axis = chosen
        host, state = self.host, glance.state()
        if state in READ and axis.last is not None:
            state = axis.own_state
        to = number if name == TO or axis.last is None else axis.last.position + number
        if not LOW <= to <= HIGH:
            self.say(f"not sent: the end of the move, {to}, is out of range")
            return
        if not self._jog.allows(glance.readout, axis, state, host.session.now(), idle=host.outbox.idle):
            self.say(f"not sent: {self._jog.why}")
            return
        self.send(control.filled(by=number, to=to))

    def action_leave(self) -> None:
        """Leave the number or the control that waits for Enter, then the page."""
        if self.begun is not None or self._homing:
            self.action_drop()
        elif self.asked is not None:
            self._close("")
        else:
            super().action_leave()

    def _close(self, said: str) -> None:
        self.end_asking()
        if said:
            self.say(said)


def _control_row(key: str, name: str, control: Control, number: str, width: int) -> Row:
    """Key, word, lines and meaning of a control; an absent one has its reason."""
    shown = "Space" if key == SPACE else key if number else f"{'h' if key in '+-' else ''}{key} Enter"
    if control.absent:
        text = fit(f"not here: {control.absent}", max(0, width - KEY - WORD - 3))
        return ((f" {fit('', KEY)}", "dim"), (f"{fit(WORDS[name], WORD)} ", "dim"), (text, "dim"))
    row: list[Span] = [
        (f" {fit(shown, KEY)}", "key"),
        (f"{fit(WORDS[name], WORD)} ", "text"),
        (fit(control.shown(by=number, to=number), LINE), "strong"),
    ]
    return (*row, (fit(control.about, max(0, width - KEY - WORD - LINE - 3)), "dim"))
