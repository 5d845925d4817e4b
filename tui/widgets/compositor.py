"""The composition of a screen without the work for covered widgets.

Textual's compositor cuts every row of every widget into pieces, then takes the front one of each place. A transcript
lies in five containers of its own size. So most of the pieces are made in vain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import cast

from textual._compositor import Compositor
from textual.geometry import Region
from textual.strip import Strip

Row = dict[int, Strip | None]
"""The pieces of a row by the column at which each begins; None: nothing there yet."""


class FrontCompositor(Compositor):
    """A compositor that renders only the visible places of a widget."""

    def _render_chops(self, crop: Region, is_rendered_line: Callable[[int], bool]) -> Sequence[Mapping[int, Strip]]:
        """Render the rows of a region, from front to back."""
        rows: list[Row] = [dict.fromkeys(cuts[:-1]) for cuts in self.cuts]
        for widget, (region, clip) in self.visible_widgets.items():
            shown = region.intersection(clip)
            if not crop.overlaps(clip) or not shown:
                continue
            open_ = {y: free for y in shown.line_range if is_rendered_line(y) and (free := _free(rows, y, shown))}
            if open_:
                strips = widget.render_lines(shown.translate(-region.offset))
                for y, strip in zip(shown.line_range, strips, strict=False):
                    if y in open_:
                        _fill(rows[y], strip, shown, self.cuts[y], open_[y])
        return cast("Sequence[Mapping[int, Strip]]", rows)


def _free(rows: Sequence[Row], y: int, shown: Region) -> list[int]:
    """The places of a row in which a widget is visible."""
    return [x for x, strip in rows[y].items() if strip is None and shown.x <= x < shown.right]


def _fill(row: Row, strip: Strip, shown: Region, cuts: Sequence[int], free: Sequence[int]) -> None:
    """Put the pieces of a widget's row into its visible places; a strip may be too short for some."""
    ends = [cut for cut in cuts if shown.x < cut <= shown.right]
    pieces = strip.divide([end - shown.x for end in ends])
    for place, piece in zip([shown.x, *ends], pieces, strict=False):
        if place in free:
            row[place] = piece
