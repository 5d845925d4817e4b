"""Notebooks: sessions, drives and scripts as tables below a cell, samples as plots, and a picture of now."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from multidrop.api.notebooks import Live, Pictures
from multidrop.base.feature import Feature
from multidrop.base.on_demand import imported

if TYPE_CHECKING:
    from multidrop.api.blocking import Telemetry

PICTURES = "multidrop.features.notebook.pictures"


def _drawn(function: str) -> Callable[[Any], str]:
    """A function of `pictures`, which is imported when the first one is drawn."""

    def draw(found: Any) -> str:
        html: str = imported(f"{PICTURES}:{function}")(found)
        return html

    return draw


def _live(readings: Telemetry) -> Live:
    from multidrop.features.notebook.live import LivePicture

    return LivePicture(readings)


FEATURE = Feature(
    "notebook",
    "tables and plots in notebooks",
    adds=(
        Pictures(
            html={
                "Session": _drawn("of_session"),
                "Drive": _drawn("of_drive"),
                "Run": _drawn("of_run"),
                "Samples": _drawn("of_samples"),
            },
            live=_live,
        ),
    ),
    extras={"notebook": "ipykernel"},
)
