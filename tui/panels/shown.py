"""Which panels are shown: on a wide screen several, on a narrow one a single one below the transcript."""

from __future__ import annotations

from multidrop.tui.panels.table import PANELS, Panel


class Shown:
    """The panels that a person shows and hides."""

    def __init__(self) -> None:
        self._by_hand: dict[str, bool] = {}
        self._alone = ""
        """The panel of a narrow screen."""

    def panels(self, wide: bool) -> list[Panel]:
        """The panels to show, from top to bottom."""
        if not wide:
            return [panel for panel in PANELS if panel.name == self._alone]
        return [panel for panel in PANELS if self._by_hand.get(panel.name, panel.first)]

    def toggle(self, name: str, wide: bool) -> bool:
        """Show a panel, or hide it; return whether it is shown now."""
        on = name not in [panel.name for panel in self.panels(wide)]
        if wide:
            self._by_hand[name] = on
        if not wide or on:
            self._alone = name if on else ""
        return on

    def wants(self, wide: bool) -> frozenset[str]:
        """The readings that the shown panels want."""
        return frozenset().union(*(panel.wants for panel in self.panels(wide)))
