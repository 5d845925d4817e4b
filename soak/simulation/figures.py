"""The sums of a run, and the table of the host's words by language and checksum, which docs/safety.md has."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterator

from soak.simulation.records.climate import FAULTS
from soak.simulation.records.commands import Outcome
from soak.simulation.runs import WORD, Result

BUT_FOR = ", but for "
"""What the count of a grant has between its rule and its name."""
SHOWN = {
    Outcome.OK: "done",
    Outcome.REFUSED: "refused",
    Outcome.NOT_SENT: "not sent",
    Outcome.UNKNOWN: "not known",
    Outcome.OPEN: "no word: what was to send it ended before",
}


class Figures:
    """The sums of a run."""

    def __init__(self) -> None:
        self.broken = 0
        self.counts: Counter[str] = Counter()
        self.findings: Counter[str] = Counter()
        """By rule, the seeds that broke it."""
        self._rows: list[tuple[int, int, float, float]] = []

    def add(self, each: Result) -> None:
        """Add a result."""
        self.broken += bool(each.breaches)
        self.counts.update(each.counts)
        self.findings.update({name for name, _ in each.breaches})
        self._rows.append((each.commands, each.exchanges, each.virtual, each.took))

    def rows(self) -> Iterator[str]:
        """The figures, a row each, and the table."""
        if not self._rows:
            return
        commands, exchanges, virtual, took = (list(each) for each in zip(*self._rows, strict=True))
        yield (
            f"{len(took)} seeds, {self.broken} broke a rule; {sum(commands)} commands, {sum(exchanges)} exchanges, "
            f"{sum(virtual) / 3600:.1f} virtual hours"
        )
        yield "broken rules: " + (
            ", ".join(f"{number} {name}" for name, number in sorted(self.findings.items())) or "none"
        )
        faults = {name for name in FAULTS if name in self.counts}
        granted = {name for name in self.counts if BUT_FOR in name}
        others = {name for name in self.counts if WORD not in name} - faults - granted
        for what, found in (("faults", faults), ("acts and events", others), ("exceptions", granted)):
            text = ", ".join(f"{self.counts[name]} {name}" for name in sorted(found))
            yield f"{sum(self.counts[name] for name in found)} {what}: {text}"
        yield (
            f"{sum(exchanges) / sum(took):.0f} exchanges a second of one core; "
            f"a median seed has {statistics.median(commands):.0f} commands and takes {statistics.median(took):.3f} s"
        )
        yield ""
        yield from self.table()

    def table(self) -> Iterator[str]:
        """The host's words by language and checksum, as docs/safety.md shows them."""
        lines = sorted({name.partition(WORD)[0] for name in self.counts if WORD in name})
        yield f"| | {' | '.join(lines)} |"
        yield "|---" * (len(lines) + 1) + "|"
        sums = [sum(number for name, number in self.counts.items() if name.startswith(each + WORD)) for each in lines]
        yield f"| commands | {' | '.join(map(str, sums))} |"
        for outcome, shown in SHOWN.items():
            numbers = (str(self.counts[f"{each}{WORD}{outcome.value}"]) for each in lines)
            yield f"| {shown} | {' | '.join(numbers)} |"
