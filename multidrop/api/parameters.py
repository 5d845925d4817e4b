"""The settings of a drive, and their way to files and back."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from multidrop.shell import new_file
from multidrop.shell.params import file as files
from multidrop.shell.params import readings
from multidrop.shell.params.readings import Difference
from multidrop.shell.params.restore import Options, restore

if TYPE_CHECKING:
    from multidrop.api.owner import Owner
    from multidrop.dialects.parameters import Readings
    from multidrop.drives.drive import Drive


class AsyncParameters:
    """The settings of one drive. Raises Inexpressible where the host reads none of its family."""

    def __init__(self, owner: Owner, drive: Drive) -> None:
        self._owner, self._drive = owner, drive

    async def read(self) -> Readings:
        """Read every setting: `.values` by name, `.defaults`, and each with its unit in `.readings`."""
        shell = self._owner.shell
        return await self._owner.call(lambda: readings.read(shell, self._drive, "reading"))

    async def backup(self, file: str) -> Readings:
        """Read every setting, and write them to a new file. Raises Diagnostic for a file that exists."""
        new_file.check(file)
        found = await self.read()
        identity = files.identity(self._drive.state, readings.parameters(self._drive).language)
        new_file.write(file, files.formatted(identity, found))
        return found

    async def diff(self, file: str = "") -> list[Difference]:
        """Compare with a file, or without one with the defaults: (name, value here, value there)."""
        there = files.load(file) if file else None
        found = await self.read()
        if there is None:
            return readings.from_defaults(found, self._owner.shell.display_name(self._drive))
        return readings.from_file(found, there)

    async def restore(
        self,
        file: str,
        *,
        save: bool = False,
        named: Collection[str] = (),
        communication: bool = False,
        other_product: bool = False,
        dry_run: bool = False,
    ) -> list[str]:
        """Send what differs from a file; return the steps. It needs `connect(URL, yes=True)`, or `dry_run`.

        `named`: settings that are only written when named, since they can move the motor or lock the drive.
        """
        shell, printed = self._owner.shell, list[str]()
        options = Options(frozenset(named), communication, save, dry_run, other_product)
        loaded = files.load(file)
        await self._owner.call(lambda: restore(shell, self._drive, loaded, options), printed)
        return printed
