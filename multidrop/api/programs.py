"""The program in a drive, and its way to files and back."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.shell import listings, transfers
from multidrop.shell.transfers import Wanted

if TYPE_CHECKING:
    from multidrop.api.owner import Owner
    from multidrop.drives.drive import Drive


Lines = list[str]


class AsyncPrograms:
    """The program of one drive. Raises Inexpressible where its family has none."""

    def __init__(self, owner: Owner, drive: Drive) -> None:
        self._owner, self._drive = owner, drive

    async def list(self) -> Lines:
        """Read the program as a listing, with the remarks of its file where those are known."""
        shell = self._owner.shell
        return await self._owner.call(lambda: listings.readable(shell, self._drive))

    async def upload(self, file: str = "", *, raw: bool = False) -> Lines:
        """Read the program as the lines of a file; write them to a new `file` if one is named.

        `raw`: as they are stored. Raises Diagnostic for a file that exists.
        """
        from multidrop.shell import new_file

        if file:
            new_file.check(file)
        shell = self._owner.shell
        lines = await self._owner.call(lambda: listings.upload(shell, self._drive, raw))
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
        shell, wanted = self._owner.shell, Wanted(verify, save, only_changed, run)
        await self._owner.call(lambda: transfers.download(shell, self._drive, file, wanted, text))
