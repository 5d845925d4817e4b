"""An executed script: the result of each of its lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from multidrop.api.pictures import table

if TYPE_CHECKING:
    from multidrop.api.owner import Owner
    from multidrop.shell.scripts.model import Result


@dataclass(frozen=True)
class Run:
    """A script that was executed to its end."""

    file: str
    results: tuple[Result, ...]
    """What each line sent and printed; lines that only steer have none."""

    @property
    def printed(self) -> list[str]:
        """All lines that it printed."""
        return [text for result in self.results for text in result.printed]

    def _repr_html_(self) -> str:
        """Return a table of the lines, for a notebook."""
        rows = [
            (f"{result.line.number}", result.sent, "\n".join(result.printed) or result.error, f"{result.seconds:.3f}")
            for result in self.results
        ]
        return table(self.file, ("line", "sent", "printed", "s"), rows)


async def run_file(owner: Owner, file: str, values: Mapping[str, str]) -> Run:
    """Check a script whole, then execute it. Raises WrongScript, or the failure that ended it."""
    from multidrop.shell.scripts.executor import run_script
    from multidrop.shell.scripts.reading import read_script  # with all verbs, which few programs need

    shell = owner.shell
    script = read_script(file, values, shell.macros)
    results: list[Result] = []
    await owner.call(lambda: run_script(shell, script, results.append))
    return Run(file, tuple(results))
