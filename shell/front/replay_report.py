"""The reports of a replay: text for people, or JSON objects, one a line."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

from multidrop.shell.log.steps import Step
from multidrop.shell.output import write

if TYPE_CHECKING:
    from multidrop.shell.channel import Channel
    from multidrop.shell.twins.after import Divergence, Positions


class ReplayReport:
    """Writes what differs to standard output as it is found. `as_json`: as objects, and the summary too."""

    def __init__(self, as_json: bool = False) -> None:
        self._json = as_json

    def differs(self, step: Step, text: str, difference: str) -> None:
        """Report another answer."""
        place = {"bus": step.bus, "drive": step.drive, "line": step.text}
        self._put(text, {"where": step.where, **place, "differs": difference})

    def diverged(self, found: Divergence) -> None:
        """Report the first divergence of an axis."""
        fact = {
            "drive": found.drive,
            "time": found.at.isoformat(timespec="microseconds"),
            "difference": found.difference,
            "limit": found.limit,
            "causes": found.causes,
        }
        self._put(found.text, {"diverged": fact})

    def summary(
        self, channel: Channel, lines: int, differences: int, uncompared: int, positions: Positions | None
    ) -> None:
        """Report the counts, and the largest difference of each axis."""
        moved = f"; {uncompared} in motion printed another number" if uncompared else ""
        channel.notify(f"{lines} lines replayed, {differences} differ{moved}", outcome=True)
        fact: dict[str, object] = {"lines": lines, "differ": differences}
        if positions is not None:
            largest, compared = positions.largest, positions.compared
            for name, number in compared.items():
                noun = "position" if number == 1 else "positions"
                text = f"{name}: {number} {noun} compared, largest difference {largest[name]} steps"
                channel.notify(text, outcome=True)
            fact |= {"compared": sum(compared.values()), "diverged": len(positions.diverged), "largest": largest}
        if self._json:
            write(sys.stdout, json.dumps({"summary": fact}))

    @staticmethod
    def words(lines: int, differences: int, positions: Positions | None) -> str:
        """The differences in words; empty: none."""
        said = [f"{differences} of {lines} lines gave another answer than in the log"] if differences else []
        if positions is not None and positions.diverged:
            axes = f"{len(positions.diverged)} of {len(positions.compared)} axes"
            said.append(f"{axes} were not where the log has them")
        return "; ".join(said)

    def _put(self, text: str, fact: dict[str, object]) -> None:
        write(sys.stdout, json.dumps(fact) if self._json else text)
