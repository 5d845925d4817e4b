"""The drive that a macro means where a line names none: the one that was selected when it began."""

from __future__ import annotations

from multidrop.shell.lines import join_target, pinned, split_target
from multidrop.shell.playing import played_by
from multidrop.shell.workspace import Workspace


class Place:
    """The selection of one macro, which no other selection changes."""

    def __init__(self, workspace: Workspace, caller: Place | None = None) -> None:
        """Take the selection of the macro that calls this one, else the present one."""
        self._workspace = workspace
        self._at: tuple[str, str] = workspace.place if caller is None else caller._at

    def pinned(self, line: str) -> str:
        """The line, with an address where another drive is selected now."""
        if self._workspace.place == self._at:
            return line
        words = line.split()
        if words[:1] == ["/use"] and len(words) == 2 and self._is_address(words[1]):
            return f"/use {join_target(self._at[0], words[1])}"
        return pinned(line, *self._at)

    def _is_address(self, word: str) -> bool:
        """Whether a word is the address of a drive on the macro's bus, and neither a bus nor a role."""
        return ":" not in word and played_by(word) not in self._workspace.buses

    def target(self, target: str) -> str:
        """The target of a question, with what the macro's selection adds."""
        bus, address = split_target(target)
        if bus or self._workspace.place == self._at:
            return target
        return join_target(self._at[0], address or self._at[1])

    def passed(self, line: str) -> None:
        """Take the selection over after a `/use` of the macro."""
        if line.split()[:1] == ["/use"]:
            self._at = self._workspace.place
