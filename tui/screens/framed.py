"""The frame of the main screen and of pages: top line, banner, footer, and parts that are rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual.screen import Screen

from multidrop.tui.widgets.compositor import FrontCompositor
from multidrop.tui.widgets.footer import Footer
from multidrop.tui.widgets.lines import Lines
from multidrop.tui.widgets.topline import TopLine


class Framed(Screen[None]):
    """A screen with a top line and a footer, which the presenter paints."""

    PLAYS: ClassVar[bool] = False
    """True if function keys play macros on this screen."""
    FOOTER: ClassVar[Sequence[tuple[str, str]]] = ()
    """Names of functions in `tui.keymap`, or keys as shown, with a word on each, the most useful ones first."""

    def __init__(self) -> None:
        super().__init__()
        self._compositor = FrontCompositor()
        # Stored, not looked up: they are painted thirty times a second, and also while the app ends.
        self._parts: dict[str, Lines] = {"top": TopLine(id="top"), "footer": Footer(id="footer")}

    def lines(self, name: str) -> Lines:
        """The part with a name."""
        return self._parts[name]
