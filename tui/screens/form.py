"""A form: a few values with their defaults and limits, such as those of a macro that is to be played."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.widgets import Static

from multidrop.dialects.text import visible
from multidrop.shell.channel import Field as Wanted
from multidrop.tui.screens.dialogs import Dialog, Field

NEEDED = "a value is needed"


class Form(Dialog[dict[str, str]]):
    """Asks for values; returns them by name. Enter takes a value and goes to the next, at the end it takes all."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,tab", "step(1)", show=False, priority=True),
        Binding("up,shift+tab", "step(-1)", show=False, priority=True),
        Binding(",".join(f"f{number}" for number in range(2, 13)), "refuse", show=False, priority=True),
    ]

    def __init__(self, title: str, wanted: Sequence[Wanted]) -> None:
        super().__init__()
        self.heading, self.wanted = title, list(wanted)
        self._at = 0

    def compose(self) -> ComposeResult:
        """Make a line for each value, with what is valid, and a line for what is wrong."""
        with Vertical(classes="box wide"):
            yield Static(visible(self.heading), classes="title", markup=False)
            with VerticalScroll(classes="form", can_focus=False):
                for number, each in enumerate(self.wanted):
                    yield Static(f"{each.name}: {visible(each.valid)}", classes="about", markup=False)
                    yield Field(self._entered, each.default or "", id=f"value-{number}")
            yield Static("", id="wrong", markup=False)
            yield Static("Enter next, at the end go on   ↑↓ another value   Esc play nothing", classes="keys")

    def on_mount(self) -> None:
        """Begin with the first value that has no default."""
        super().on_mount()
        needed = [number for number, each in enumerate(self.wanted) if each.default is None]
        self._go(needed[0] if needed else 0)

    def _field(self, number: int) -> Field:
        return self.query_one(f"#value-{number}", Field)

    def _go(self, number: int) -> None:
        self._at = number
        self.set_focus(self._field(number))

    def action_step(self, by: int) -> None:
        """Go to another value."""
        self._go((self._at + by) % len(self.wanted))

    def action_refuse(self) -> None:
        """Play no macro."""
        self.notify("Fill in the form first, or close it with Esc", timeout=4)

    def _entered(self, text: str) -> None:
        if self._is_wrong(self._at):
            return
        if self._at + 1 < len(self.wanted):
            self._go(self._at + 1)
            return
        for number in range(len(self.wanted)):
            if self._is_wrong(number):
                self._go(number)
                return
        self.dismiss({each.name: self._text(number) for number, each in enumerate(self.wanted)})

    def _text(self, number: int) -> str:
        """The value as typed, else the default."""
        return self._field(number).value.strip() or self.wanted[number].default or ""

    def _is_wrong(self, number: int) -> bool:
        """Show what is wrong with a value; whether anything is."""
        each, text = self.wanted[number], self._text(number)
        problem = NEEDED if not text and each.default is None else each.problem(text)
        self.query_one("#wrong", Static).update(f"{each.name}: {problem}" if problem == NEEDED else problem)
        return bool(problem)
