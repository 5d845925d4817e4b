"""Readings of drives: one drive's settings, and what differs from others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from multidrop.dialects import Diagnostic, Inexpressible
from multidrop.dialects.parameters import VARIABLES, Parameters, Readings, Value, same
from multidrop.shell.channel import running, transferring
from multidrop.shell.events import SettingsRead
from multidrop.shell.params.file import SettingsFile

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.workspace import Workspace

Difference = tuple[str, Value | None, Value | None]
"""A name, the value here, and the value there; None where one side has none."""
LISTED = 8
"""The number of settings that a message names."""
OWN_NAME = frozenset({"DN"})
"""What two drives on one line never share."""


def parameters(drive: Drive) -> Parameters[Any]:
    """The parameters of a drive's family. Raises Inexpressible where the host reads none."""
    found = drive.family.parameters
    if found is None:
        raise Inexpressible(f"{drive.shown}: the host does not read the parameters of this family")
    return found


async def read(workspace: Workspace, drive: Drive, what: str) -> Readings:
    """Read every setting of a drive. Raises DriveError; nothing is changed."""
    with running(workspace, f"{workspace.display_name(drive)}: {what}") as progress:
        found = await transferring(drive, parameters(drive).read(drive.state, progress))
    workspace.publish(SettingsRead(workspace.now(), drive.link.name, drive.address, found))
    return found


def from_file(found: Readings, file: SettingsFile) -> list[Difference]:
    """What differs from a file: the names of the file, and all variables where it has their table."""
    variables = [each.name for each in found.readings if each.section == VARIABLES]
    names = [name for name in file.named if name not in not_compared(found, file)]
    names += [each for each in variables if file.has_variables and each not in file.named]
    return _differing(names, found.values, file.named)


def not_compared(found: Readings, file: SettingsFile) -> list[str]:
    """The names of a file that this drive, or this way to it, does not print."""
    return [name for name, _ in found.unread if name in file.named]


def from_defaults(found: Readings, who: str) -> list[Difference]:
    """What differs from the defaults. Raises Diagnostic where they are not known."""
    if not any(each.default is not None for each in found.readings if each.section != VARIABLES):
        raise Diagnostic(f"{who}: the defaults of its settings are not known", hint="compare with a file")
    return _differing([*found.defaults], found.values, found.defaults)


def from_drive(found: Readings, other: Readings) -> list[Difference]:
    """What differs from another drive, apart from its name."""
    names = [name for name in (found.values | other.values) if name not in OWN_NAME]
    return _differing(names, found.values, other.values)


def listed(names: Sequence[str]) -> str:
    """Names in a message, at most LISTED of them."""
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return f"{', '.join(names[:LISTED])}{more}"


def _differing(names: list[str], here: Mapping[str, Value], there: Mapping[str, Value]) -> list[Difference]:
    rows = [(name, here.get(name), there.get(name)) for name in names]
    return [each for each in rows if not same(each[1], each[2])]
