"""The page of controls: jog by steps, move, home, stop, enable. Each control shows the lines that it sends.

Everything is sent as if it were typed, so guards ask and the transcript shows it. To leave the page stops nothing: a
move ends by itself.

A jog is one bounded move a press. A terminal sends no key-up, and repeats a held key. So a press counts only while the
axis is known to rest: a reading that is newer than the last line says so, and no line runs or waits. A press right
after another one is the keyboard's repetition. What does not count is dropped and counted, and nothing of it is kept.
"""

from __future__ import annotations

import math
from string import ascii_letters, digits, punctuation
from typing import ClassVar

from textual.binding import Binding, BindingType

from multidrop.base.errors import Diagnostic
from multidrop.dialects.controls import BY, HIGH, LOW, SET, STOP, TARGET, TO, Control
from multidrop.dialects.units import Takes
from multidrop.shell.amounts import Amount, AmountReader
from multidrop.tui.key_table import SHEETS, shown_key
from multidrop.tui.panels.drive import drive_rows
from multidrop.tui.panels.view import View, name_of
from multidrop.tui.readout import READ
from multidrop.tui.screens.chosen_axis import ChosenAxis
from multidrop.tui.screens.control_entries import ENTRIES, ON_THE_FLY, asked_rows, moving_lines, read
from multidrop.tui.screens.control_rows import (
    KEYED,
    NO_CONTROLS,
    SPACE,
    WORDS,
    control_rows,
    homing_rows,
    jog_rows,
    readiness,
)
from multidrop.tui.screens.jogging import REPETITION, Jog
from multidrop.tui.screens.page import PageHost, SendingPage, note_painted, show_rows
from multidrop.tui.text import at_words
from multidrop.tui.widgets.lines import Row, spread

FIRST_STEP = "100"
"""The length of a step until a person chooses one, in the drive's own counts."""


HOMING = "homing"
"""The kind of an offer that is one of the list of homings."""
SECOND_STOP = 3.0
"""Seconds after a stop by Space within which another Space is the hard stop of the drive or axis."""
SECOND = "Space again: /halt"
LEFT = "nothing was sent: the entry was left without Enter"
KEYS = "; ".join(
    f"{key.shown} {key.word or key.about.split(':')[0]}" for key in SHEETS["controls"].keys if key.word or key.name
)
"""The keys that work, for a person who pressed another one."""
PRINTED = [*ascii_letters, *digits, *(each for each in punctuation if each != ","), "comma"]
"""Every key that prints something."""


class ControlsPage(SendingPage):
    """Controls of the selected drive."""

    SHEET = "controls"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding(key, f"unknown({key!r})", show=False)
        for key in PRINTED
        if shown_key(key) not in {shown_key(own) for each in SHEETS["controls"].keys for own, _, _ in each.single}
    ]
    WANTS = frozenset({"motion", "conditions"})
    STOPS = frozenset({"space"})
    PARTS = {"heading": None, "drive": "auto", "controls": "1fr", "asked": 1, "number": None, "said": None}
    FIELD = "number"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self.step = FIRST_STEP
        self._jog = Jog()
        self._axis = ChosenAxis(host)
        self._homing: int | None = None
        """The place of the homing that is chosen in the list; -1: none is yet. None: the list is not shown."""
        self._stopped = "", -math.inf, False
        """What Space has stopped last, when, and whether by the hard stop."""
        self._before = ""
        """What the entry held before the last key."""
        self._void = False
        """The entry is not used any more: Space stopped the axis while it was open."""

    def on_mount(self) -> None:
        """Hide the field until a number is asked for; what failed before is not the page's."""
        self.host.model.trouble = ""
        self.lines("drive").styles.max_height = "50%"

    # What is shown

    def show(self, view: View) -> None:
        """Paint the drive, and the controls with the lines that they send now."""
        # Forget what was begun before a stop, or for another drive.
        place = view.session.place
        if self._axis.shown(view):
            self._jog, self._homing = Jog(), None
        asked = self.asked
        if asked is not None and asked.overtaken(self.host.session):
            self._close("stopped; the entry was not used" if asked.place == place else "another drive is selected")
        begun = self.begun
        if begun is not None and begun.overtaken(self.host.session):
            self.begun = self._homing = None
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
        self._paint_controls(view, width)
        said: list[Row] = [((f" {row}", self.said[1]),) for row in at_words(self.said[0], width - 2)]
        show_rows(self.lines("said"), said or [((" ", "text"),)])
        note_painted(self)

    def _paint_controls(self, view: View, width: int) -> None:
        controls, chosen, asked = self._axis.controls(), self._axis.now(), self.asked
        if chosen is None or not controls:
            nothing = "^O chooses a drive" if chosen is None else NO_CONTROLS
            self.lines("controls").put([((f" {nothing}", "dim"),)])
            show_rows(self.lines("asked"), [])
            return
        glance, axis = chosen
        reader = self._axis.reader()
        why = readiness(self._jog, self._jog.obstacle(glance.readout, axis, glance.state(), view.now))
        several = len(glance.readout.axes) > 1
        rows = jog_rows(controls[BY], axis, reader, self._step(reader), several, why, width)
        homings, at = self._axis.homings(), self._homing
        height = self.lines("controls").size.height - len(rows) - 1  # the row below may take two
        more = control_rows(controls, homings, width) if at is None else homing_rows(homings, at, width, height)
        self.lines("controls").put([*rows, *more])
        entry = ENTRIES[asked.kind] if asked is not None else None
        asks = asked_rows(entry, self.field.value, reader, controls.get(entry.control), axis, width) if entry else []
        show_rows(self.lines("asked"), asks)

    def _step(self, reader: AmountReader) -> Amount:
        """The length of a step for an axis. One that the axis cannot have becomes the first one again."""
        try:
            return reader.read(self.step, Takes.DISTANCE)
        except Diagnostic as problem:
            self.say(f"the step is {FIRST_STEP} again: {problem.message}")
            self.step = FIRST_STEP
            return reader.read(FIRST_STEP, Takes.DISTANCE)

    # Keys

    def action_step(self, by: int) -> None:
        if self._left() or self._choose_homing(-by):
            return
        self.begun, chosen = None, self._axis.now()
        if chosen is None:
            self.say(self._axis.nothing())
            return
        reader = self._axis.reader()
        before = self._step(reader)
        try:
            after = reader.read(before.level(by), Takes.DISTANCE)
        except Diagnostic as problem:
            self.say(f"the step stays {before.typed}: {problem.message}")
        else:
            ends = f"the step stays {before.typed}: there is no {'longer' if by > 0 else 'shorter'} one"
            self.say(ends if after == before else "", "strong" if after == before else "dim")
            self.step = after.typed

    def _left(self) -> bool:
        """Leave the entry, if one is open; return whether it was."""
        if self.asked is None:
            return False
        self._close(LEFT)
        return True

    def action_axis(self) -> None:
        if self._left():
            return
        self.action_drop()
        self.begun, chosen = None, self._axis.now()
        if chosen is None:
            self.say(self._axis.nothing())
        elif len(chosen[0].readout.axes) == 1:
            self.say("it has one axis")
        else:
            self._jog = Jog()
            self.say(f"axis {self._axis.next().axis} is chosen", "dim")

    def action_jog(self, sign: int) -> None:
        """Move by one step, if the drive is known to rest; else drop the press."""
        if self._homing is not None:
            self.action_drop()
            return
        self.begun, chosen = None, self._axis.now()
        if chosen is None:
            self.say(self._axis.nothing())
        else:
            self._move(BY, self._step(self._axis.reader()).times(sign))

    def action_do(self, key: str) -> None:
        """Stop at once; every other control waits for Enter, as a letter alone neither moves nor lets go."""
        name = KEYED[key]
        control = self._axis.controls().get(name)
        self.begun, self._homing = None, None
        if name == STOP and control is not None and not control.absent:
            lines = self._stop_lines(control)
            if lines:
                self.host.outbox.at_once(lines)
            more = "" if self._stopped[2] else f"   {SECOND}"
            self.say(f"sent: {', '.join(lines)}{more}" if lines else "the stop was sent", "dim")
        elif nothing := self._axis.nothing():
            self.say(nothing)
        elif control is None or control.absent:
            self.say(f"no {WORDS[name]}: {control.absent}" if control is not None else NO_CONTROLS)
        else:
            self.offer(key, control.filled())
            about = f" - {control.about}" if control.about else ""
            self.say(f"Enter sends {', '.join(control.filled())}{about}   Esc: nothing")

    def _stop_lines(self, control: Control) -> tuple[str, ...]:
        """The soft stop; soon after it the hard one, once while the key repeats."""
        session = self.host.session
        drive, axis = session.selected, self._axis.axis
        assert drive is not None
        target, now = f"{session.qualified_address(drive)}{f'.{axis}' if axis else ''}", session.now()
        before, at, hard = self._stopped
        soon = before == target and now - at < SECOND_STOP
        self._stopped = target, now, soon
        if not soon:
            return control.filled()
        return () if hard and now - at < REPETITION else (f"/halt {target}",)

    def action_go(self) -> None:
        """Send the control that was begun, unless a stop or another drive came in between."""
        if self.begun is None:
            self.action_drop()
            self.say(f"nothing was sent: Enter sends a line that is shown; {KEYS}")
        elif (begun := self.accepted()) is not None:
            self._homing = None
            if begun.kind == HOMING and (why := self._obstacle(0)):
                self.say(f"not sent: {why}")
            else:
                self.send(begun.lines)

    def action_home(self) -> None:
        """List the ways to home: one letter begins none."""
        if self._homing is not None:
            self._choose_homing(1)
            return
        self.action_drop()
        if nothing := self._axis.nothing():
            self.say(nothing)
        elif not self._axis.homings():
            self.say("no homing: such drives have no line for it")
        else:
            self._homing = -1
            self.say("choose a homing: ↑↓, or - and + for its direction   Esc: nothing")

    def action_toward(self, sign: str) -> None:
        """Choose the next homing in a direction."""
        if not self._choose_homing(1, sign):
            self.say("nothing was sent: h lists the homings, and + or - chooses one by its direction then")

    def _choose_homing(self, by: int, sign: str = "") -> bool:
        """Choose the next homing of the list, of a direction if one is given; return whether the list is shown."""
        homings, at = self._axis.homings(), self._homing
        if at is None or self._axis.nothing() or not homings:
            return False
        start = at if at >= 0 or by > 0 else 0
        order = [(start + by * n) % len(homings) for n in range(1, len(homings) + 1)]
        found = [number for number in order if homings[number].sign in ("", sign) or not sign]
        self._homing = found[0] if found else at
        if found:
            homing = homings[found[0]]
            self.offer(HOMING, homing.lines)
            self.say(f"Enter sends {', '.join(homing.lines)} - {homing.about}   Esc: nothing")
        return True

    def action_drop(self) -> None:
        """Drop the control that waits for Enter: a key that means nothing here is part of a word, such as `halt`."""
        if self.begun is not None or self._homing is not None:
            self.begun, self._homing = None, None
            self.say("nothing was sent")

    def action_unknown(self, key: str) -> None:
        """Name the keys that work, and drop what waits for Enter."""
        self.begun, self._homing = None, None
        self.say(f"nothing was sent: {shown_key(key)} does nothing here; {KEYS}")

    def action_ask(self, key: str) -> None:
        self.begun, self._homing = None, None
        if not self._axis.controls() or self._axis.nothing():
            self.say(self._axis.nothing() or NO_CONTROLS)
            return
        kind = ON_THE_FLY if key == "m" and self._axis.moves else key
        control = self._axis.controls().get(ENTRIES[kind].control)
        if control is not None and control.absent:
            moves = "it moves, and " if kind == ON_THE_FLY else ""
            self.say(f"nothing was sent: {moves}no {WORDS[ENTRIES[kind].control]} here: {control.absent}")
            return
        self._before, self._void = "", False
        self.ask_for(kind, "", "")

    def edited(self, text: str) -> None:
        """Take a blank as the key of the stop, unless it divides a number from its unit while the axis rests."""
        before, self._before = self._before, text
        if len(text) != len(before) + 1 or text.count(" ") <= before.count(" "):
            return  # pasted, or no blank
        if before.strip()[-1:].isdigit() and " " not in before and self._axis.rests(self._jog):
            return
        self._before, self._void = before, True
        self.field.value = before
        self.action_do(SPACE)

    def typed(self, text: str) -> None:
        asked, chosen = self.asked, self._axis.now()
        if asked is None or chosen is None or asked.overtaken(self.host.session):
            self._close("the entry was not used")
            return
        if self._void:
            self._close("nothing was sent: Space has stopped the axis; type it again")
            return
        entry = ENTRIES[asked.kind]
        try:
            amount = read(entry, text, self._axis.reader())
        except Diagnostic as problem:
            self.say(f"nothing was sent: {problem.message}; {problem.hint}".removesuffix("; "))
            return
        self._close("")
        if entry.control:
            self._move(entry.control, amount)
        else:
            self.step = amount.typed
            self.say(f"the step is {amount.typed}", "dim")

    def _move(self, name: str, amount: Amount) -> None:
        """Send the lines of an entry, if the axis is in the state for which it was opened."""
        chosen, control = self._axis.now(), self._axis.controls().get(name)
        if chosen is None or control is None:
            self.say(self._axis.nothing() or NO_CONTROLS)
            return
        axis = chosen[1]
        by = amount.number if name == BY else 0
        if name == TO and axis.last is not None:
            by = amount.number - axis.last.position
        if why := self._obstacle(by) if name in (BY, TO) else self._unfit(name):
            self.say(f"not sent: {why}")
        else:
            entry = next(each for each in ENTRIES.values() if each.control == name)
            self.send(moving_lines(entry, control, axis, amount))

    def _unfit(self, name: str) -> str:
        """What keeps an entry that begins no move from being sent; empty: nothing."""
        if name == SET and not self._axis.rests(self._jog):
            return "whether the axis rests is unknown"
        return "it does not move any more; m asks again" if name == TARGET and not self._axis.moves else ""

    def _obstacle(self, by: int) -> str:
        """Why a move by so much may not start now; empty: it may, and is taken to start."""
        chosen = self._axis.now()
        if chosen is None:
            return self._axis.nothing()
        (glance, axis), host = chosen, self.host
        state = glance.state()
        if state in READ and axis.last is not None:
            state = axis.own_state
        to = by + (axis.last.position if axis.last is not None else 0)
        if not LOW <= to <= HIGH:
            return f"the end of the move, {to}, is out of range"
        if self._jog.allows(glance.readout, axis, state, host.session.now(), idle=host.outbox.idle):
            return ""
        return self._jog.why

    def action_leave(self) -> None:
        """Leave the number or the control that waits for Enter, then the page."""
        if self.begun is not None or self._homing is not None:
            self.action_drop()
        elif self.asked is not None:
            self._close("")
        else:
            super().action_leave()

    def _close(self, said: str) -> None:
        self.end_asking()
        if said:
            self.say(said)
