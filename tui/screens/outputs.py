"""The page of outputs: a key for each, which shows the line; Enter sends it, as an output may move something."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.by_hand import ByHand, Output
from multidrop.dialects.values import Conditions, Lamp
from multidrop.tui.screens.lines_page import LineRow, LinesPage
from multidrop.tui.screens.page import PageHost

MOST = 9
"""The highest number that has a key of its own."""


class OutputsPage(LinesPage):
    """The outputs of the selected drive. The number of an output is its key; the same key again turns it."""

    SHEET = "outputs"
    TITLE = "OUTPUTS"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._turned: set[int] = set()
        """The outputs whose other line is offered."""

    def made(self, by_hand: ByHand, conditions: Conditions | None) -> Sequence[LineRow]:
        lamps = {lamp.name: lamp for lamp in conditions.lamps if lamp.output} if conditions is not None else {}
        return [self._row(each, lamps.get(str(each.number)), bool(lamps)) for each in by_hand.outputs()]

    def missing(self, by_hand: ByHand) -> str:
        return by_hand.no_outputs

    def _row(self, output: Output, lamp: Lamp | None, known: bool) -> LineRow:
        key = str(output.number) if output.number <= MOST else "–"
        label = f"{key}   output {output.number}"
        if lamp is not None and lamp.function:
            return LineRow(label, absent=f"the drive switches it: {lamp.function}")
        if lamp is None and known and self.by_type:
            return LineRow(label, absent="it is set up as an input")
        on = lamp.on if lamp is not None else None
        to_on = (on is not True) != (output.number in self._turned)
        state = "· not reported" if on is None else "● on" if on else "○ off"
        return LineRow(label, output.on if to_on else output.off, state, "on" if to_on else "off", live=bool(on))

    @property
    def by_type(self) -> bool:
        """Whether a point of the drive is an output only where it is set up as one."""
        drive = self.host.session.selected
        return drive is not None and drive.family.values.by_hand.outputs_by_type

    # Keys

    def action_switch(self, number: int) -> None:
        """Show the line of an output; the same key again shows that of the other state."""
        outputs = self._outputs()
        at = next((at for at, each in enumerate(outputs) if each.number == number), None)
        if at is None:
            self.say(f"no output {number}" if outputs else "no drive with outputs is selected")
            return
        again = self.begun is not None and self._at == at
        self.begun, self._at = None, at
        self._turned ^= {number} if again else set()
        if not again:
            self._turned.discard(number)
        self.offer_row(self.rows()[at])

    def action_other(self) -> None:
        """Change the chosen output between the lines for on and off; nothing is sent."""
        outputs = self._outputs()
        if outputs:
            self.begun = None
            self._turned ^= {outputs[min(self._at, len(outputs) - 1)].number}
            self.say("")

    def _outputs(self) -> Sequence[Output]:
        drive = self.host.session.selected
        return drive.family.values.by_hand.outputs() if drive is not None else ()

    def action_enter(self) -> None:
        sent = self.begun
        super().action_enter()
        if sent is not None and self.begun is None:
            self._turned.clear()
