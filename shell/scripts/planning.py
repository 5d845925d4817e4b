"""The plan of a checked macro before its first line: the buses of its roles, and the drives that it moves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from multidrop.base.errors import Diagnostic, Inexpressible, NoAnswer
from multidrop.drives.drive import Drive
from multidrop.macros import Macro, fill, value_names
from multidrop.shell.automation import only_ends
from multidrop.shell.automation_record import Claim
from multidrop.shell.line_syntax import DriveLine, parse
from multidrop.shell.macro_arguments import check_bus, only_bus, unbound
from multidrop.shell.origin import NO_ROLES, Origin
from multidrop.shell.scripts.model import CallFile, CallMacro, If, MacroScript, Node, Repeat, Script, ScriptLine
from multidrop.shell.scripts.reading import UNKNOWN
from multidrop.shell.scripts.words import macro_call
from multidrop.shell.workspace import Workspace

OPENING = ("/open", "/close")
SELECTING = (*OPENING, "/use")
RAW = {"": True, "on": True, "open": True, "off": False}
"""The words of `/raw` that begin or end raw mode."""


class KnownValues(dict[str, str]):
    """Values of names; a name that is not known yet is 0."""

    def __missing__(self, name: str) -> str:
        return UNKNOWN

    def __contains__(self, name: object) -> bool:
        return True


def bind(workspace: Workspace, origin: Origin, macro: Macro, given: Mapping[str, str]) -> dict[str, str]:
    """The bus of each role: the given one, that of the macro that plays this one, or one that needs no question.

    `origin`: that of the line that plays it. Raises Diagnostic where a role has none.
    """
    bound = {}
    for role in macro.roles:
        outer = origin.bus_of_role(role)
        bus = given.get(role) or (outer if outer in workspace.buses else only_bus(workspace, macro, role))
        if not bus:
            raise unbound(workspace, macro, role)
        check_bus(workspace, macro, role, bus)
        bound[role] = bus
    return bound


def macro_claims(workspace: Workspace, origin: Origin, played: MacroScript, roles: Mapping[str, str]) -> set[Claim]:
    """The drives that a macro moves, as far as its lines show it.

    Raises Diagnostic for a line of a bus that is not open, for a role without a bus in what it calls, and for an
    `on_early_end` line that may not move.
    """
    planning = _Planning(workspace)
    return {(drive.link, drive.address) for _, drive in planning.macro(played, origin.cast(roles))}


def script_claims(workspace: Workspace, origin: Origin, script: Script) -> set[Claim]:
    """The drives that a script moves, as far as its lines show it. Raises Diagnostic as `macro_claims` does."""
    planning = _Planning(workspace)
    return {(drive.link, drive.address) for _, drive in planning.block(script.body, KnownValues(script.values), origin)}


class _Planning:
    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._selected = True
        """No line so far selects another drive."""
        self._opens = False
        """A line so far opens or closes a bus."""
        self._raw = False
        """The lines so far leave raw mode on: it takes any text."""

    def macro(self, played: MacroScript, origin: Origin) -> Iterator[tuple[ScriptLine, Drive]]:
        """The lines of a macro that can start a drive, each with that drive; then those of its end."""
        values = KnownValues(played.values)
        yield from self.block(played.body, values, origin)
        for line, drive in self.block(played.on_early_end, values, origin):
            if not (played.macro.on_early_end_moves or only_ends(drive, _text_of(line, values))):
                hint = "on_early_end_moves = true in its file lets it"
                raise Diagnostic(f"{drive.shown}: {line.text} can start motion", line.where, hint)
            yield line, drive

    def block(self, body: Sequence[Node], values: KnownValues, origin: Origin) -> Iterator[tuple[ScriptLine, Drive]]:
        """The lines of a block that can start a drive, each with that drive."""
        for node in body:
            if isinstance(node, If | Repeat):
                yield from self.block(node.body, values, origin)
                yield from self.block(node.otherwise if isinstance(node, If) else (), values, origin)
            elif isinstance(node, CallFile):
                yield from self.block(node.script.body, KnownValues(node.script.values), origin)
            elif isinstance(node, CallMacro):
                given = macro_call(fill(node.line.text, values)).divided(node.played.macro)[1]
                yield from self.macro(node.played, origin.cast(self._bound(origin, node, given)))
            elif (drive := self._started(origin, node.line, values)) is not None:
                yield node.line, drive

    def _bound(self, origin: Origin, node: CallMacro, given: Mapping[str, str]) -> Mapping[str, str]:
        """The roles of a called macro; a bus that a line opens is bound later."""
        try:
            return bind(self._workspace, origin, node.played.macro, given)
        except Diagnostic as problem:
            if self._opens:
                return NO_ROLES
            raise Diagnostic(str(problem), node.line.where) from None

    def _started(self, origin: Origin, line: ScriptLine, values: KnownValues) -> Drive | None:
        """The drive that a line can start; None: it starts none, or it is not known yet.

        Raises Diagnostic for a line that its drive never gets.
        """
        self._opens = self._opens or line.word in OPENING
        self._selected = self._selected and line.word not in SELECTING
        if line.word == "/raw" and (wanted := RAW.get(" ".join(line.text.split()[1:2]))) is not None:
            self._raw = wanted
        if line.text.startswith("/") or self._raw:
            return None
        parsed = parse(fill(line.text, values))
        if not isinstance(parsed, DriveLine) or not (parsed.bus or parsed.address or self._selected):
            return None
        try:
            drive = self._workspace.drive(origin.bus_of_role(parsed.bus), parsed.address)
        except NoAnswer:
            return None
        except Diagnostic as problem:
            if self._opens:
                return None
            raise Diagnostic(problem.message, line.where, problem.hint) from None
        if drive.link.name in self._workspace.raw:
            return None
        text = parsed.text
        if "{" in text:
            from multidrop.dialects.units import with_numbers

            text = with_numbers(text)
        if value_names(line.text) <= dict.keys(values):
            try:
                drive.check_address(text)
                drive.family.check_line(text)
            except Inexpressible as problem:
                raise Diagnostic(str(problem), line.where) from None
        return drive if drive.starts(text) else None


def _text_of(line: ScriptLine, values: KnownValues) -> str:
    """The text for the drive, with values."""
    parsed = parse(fill(line.text, values))
    return parsed.text if isinstance(parsed, DriveLine) else ""
