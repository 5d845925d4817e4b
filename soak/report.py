"""The report of a soak run: text for a person, JSON for a program."""

from __future__ import annotations

import json
import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from soak.judge import MISDEEDS, Ledger, Word

COLUMNS = (*(word.value for word in Word), "executed", *MISDEEDS, "undetected")


def counts(ledger: Ledger) -> dict[str, int]:
    """The columns of a row."""
    words = {word.value: ledger.words[word.value] for word in Word}
    misdeeds = {kind: ledger.counts[kind] for kind in MISDEEDS}
    undetected = len(ledger.undetected)
    return {"commands": ledger.commands, **words, "executed": ledger.executed, **misdeeds, "undetected": undetected}


@dataclass
class Report:
    """The findings of a run. `failures`: misdeeds and leaks, in words."""

    length: str
    sections: dict[str, Any] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    def noise(self, groups: dict[str, dict[str, Ledger]]) -> None:
        """Add the judged lines."""
        section: dict[str, Any] = {}
        for group, rows in groups.items():
            total = Ledger()
            for ledger in rows.values():
                total.add(ledger)
            section[group] = {
                "total": counts(total),
                "resets": total.resets,
                "hangups": total.hangups,
                "undetected": total.undetected,
                "rows": {name: counts(ledger) for name, ledger in rows.items()},
            }
            self.failures += total.misdeeds
            self._table(group, {**rows, "total": total})
        self.sections["noise"] = section

    def _table(self, group: str, rows: dict[str, Ledger]) -> None:
        self.lines.append(f"noise, {group}")
        for name, ledger in rows.items():
            shown = ", ".join(f"{number} {kind}" for kind, number in counts(ledger).items() if number)
            self.lines.append(f"  {name:<44} {shown}")
        self.lines.append("")

    def add(self, name: str, figures: dict[str, Any], failures: list[str]) -> None:
        """Add the figures of another part."""
        self.sections[name] = {**figures, "failures": failures}
        self.failures += failures
        shown = ", ".join(f"{key} {value}" for key, value in figures.items())
        self.lines += [f"{name}: {shown}", *(f"  FAILED {each}" for each in failures), ""]

    def write(self, folder: Path) -> str:
        """Write both forms to the folder; return the text."""
        verdict = f"{len(self.failures)} failures" if self.failures else "no failure"
        system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
        text = "\n".join(
            [f"soak, {self.length}, {system}", "", *self.lines, f"verdict: {verdict}", *self.failures[:20]]
        )
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{self.length}.txt").write_text(f"{text}\n")
        whole = {"length": self.length, "system": system, **self.sections, "failures": self.failures}
        (folder / f"{self.length}.json").write_text(json.dumps(whole, indent=1))
        return text
