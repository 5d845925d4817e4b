"""The other half of a split screen: a second transcript, of one drive or of a line. One types into the first one."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from textual.app import ComposeResult
from textual.containers import Vertical

from multidrop.shell.transcripts import Filter
from multidrop.tui.screen_model import Record
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Lines, Row
from multidrop.tui.widgets.transcript import Transcript


class Half(Transcript):
    """A transcript without a foot: its filter is not the person's, and `/filter` is for the other half."""

    def _foot(self, width: int) -> list[Row]:
        return []


class Beside(Vertical):
    """A heading and a transcript that copies what another one takes in. Hidden while it shows nothing."""

    def __init__(self, clock: Callable[[float], str]) -> None:
        super().__init__(id="beside")
        self.display = False
        self.bus, self.address = "", ""
        """What it shows: a line, and the one drive on it; an empty address is all of the line."""
        self._heading = Lines(id="beside-head")
        self.transcript = Half(clock)

    def compose(self) -> ComposeResult:
        """Make the heading and the transcript."""
        yield self._heading
        yield self.transcript

    def show(self, bus: str, address: str, of: Transcript) -> None:
        """Show a line, or one drive of it; `of` has its records so far."""
        self.bus, self.address = bus, address
        self.display = True
        self.transcript.clear()
        self.transcript.set_times(of.clocks.form)
        self.transcript.choose(Filter(address=address))
        self.transcript.extend(of.records)

    def hide(self) -> None:
        """Show nothing."""
        self.bus = self.address = ""
        self.display = False
        self.transcript.clear()

    def take(self, bus: str, records: Iterable[Record]) -> None:
        """Take in what the transcript of a line takes in."""
        if self.display and bus == self.bus:
            self.transcript.take(records)

    def name_it(self, key: str) -> None:
        """Write the heading: what is shown, and the key that lets one type to it."""
        width = self.size.width
        if width:
            name = f" {':'.join(filter(None, (self.bus, self.address)))} "
            hint = f" {key} types here " if key and len(name) + len(key) + 16 < width else ""
            rule = "─" * max(0, width - len(name) - len(hint) - 2)
            row = (("─", "rule"), (fit(name, min(len(name), width - 1)), "accent"), (hint, "dim"), (f"{rule}─", "rule"))
            self._heading.put([row])
