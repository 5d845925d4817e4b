"""The program and the settings of one drive, awaited."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING

from multidrop.api.calls import Calls
from multidrop.api.fixed import Fixed
from multidrop.base import new_file
from multidrop.shell import program_listing
from multidrop.shell.events import By
from multidrop.shell.operations.argument_types import Downloading, Restoring
from multidrop.shell.origin import Origin
from multidrop.shell.params import file as files
from multidrop.shell.params.work import Difference, backup_text, differences, restore
from multidrop.shell.programs import transfers

if TYPE_CHECKING:
    from multidrop.dialects.values import Readings
    from multidrop.drives.drive import Drive

Lines = list[str]


class AsyncPrograms(Fixed):
    """The program of one drive. Raises Inexpressible where its family has none."""

    def __init__(self, calls: Calls, drive: Drive) -> None:
        self._calls, self._drive = calls, drive

    async def list(self) -> Lines:
        """Read the program as a listing, with the remarks of its file where those are known."""
        shell = self._calls.shell
        return await self._calls.run(lambda origin: program_listing.readable(shell, self._drive))

    async def upload(self, file: str = "", *, raw: bool = False) -> Lines:
        """Read the program as the lines of a file; write them to a new `file` if one is named.

        `raw`: as they are stored. Raises Diagnostic for a file that exists.
        """
        if file:
            new_file.check(file)
        shell = self._calls.shell
        lines = await self._calls.run(lambda origin: program_listing.upload(shell, self._drive, raw))
        if file:
            new_file.write(file, "".join(f"{line}\n" for line in lines))
        return lines

    async def download(
        self,
        file: str,
        text: str | None = None,
        *,
        save: bool = False,
        verify: bool = True,
        only_changed: bool = False,
        run: str = "",
    ) -> None:
        """Check a program file, back up what the drive holds, send the file, and compare.

        `text`: what a file of that name would hold. `save`: keep it over power-off. `run`: the label to execute then.
        Raises Diagnostic for the file, Refused, NoAnswer, Differs.
        """
        shell = self._calls.shell
        wanted = Downloading(save=save, run=run, only_changed=only_changed, no_verify=not verify)

        async def send(origin: Origin) -> None:
            person = replace(origin, by=By.OPERATOR)  # a question is answered by what `connect` was given
            await transfers.download(shell, person, self._drive, file, wanted, text)

        await self._calls.run(send)


class AsyncParameters(Fixed):
    """The settings of one drive. Raises Inexpressible where the host reads none of its family."""

    def __init__(self, calls: Calls, drive: Drive) -> None:
        self._calls, self._drive = calls, drive

    async def read(self) -> Readings:
        """Read every setting: `.values` by name, `.defaults`, and each with its unit in `.readings`."""
        shell = self._calls.shell
        return await self._calls.run(lambda origin: files.read(shell, self._drive, "reading"))

    async def backup(self, file: str) -> Readings:
        """Read every setting, and write them to a new file. Raises Diagnostic for a file that exists."""
        new_file.check(file)
        readings = await self.read()
        new_file.write(file, backup_text(self._drive, readings))
        return readings

    async def diff(self, file: str = "") -> list[Difference]:
        """Compare with a file, or without one with the defaults: (name, value here, value there)."""
        there = files.load(file) if file else None
        readings = await self.read()
        return differences(readings, there, self._calls.shell.display_name(self._drive))

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
        shell, printed = self._calls.shell, list[str]()
        options = Restoring(
            dry_run=dry_run,
            save=save,
            communication=communication,
            named=frozenset(named),
            other_product=other_product,
        )
        loaded = files.load(file)
        await self._calls.run(lambda origin: restore(shell, origin, self._drive, loaded, options), printed)
        return printed
