"""The blocking drive, with its program and its settings."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Protocol

from multidrop.api.blocking_telemetry import Caller, Telemetry
from multidrop.api.drives import AsyncDrive
from multidrop.api.stopping import StopReport
from multidrop.shell import waits

if TYPE_CHECKING:
    from multidrop.api.parameters import AsyncParameters
    from multidrop.api.programs import AsyncPrograms
    from multidrop.dialects import Motion
    from multidrop.dialects.parameters import Readings
    from multidrop.shell.params.readings import Difference
    from multidrop.shell.scripts.expression import Value

Lines = list[str]


class Owner(Caller, Protocol):
    """The session of a drive, with its telemetry."""

    def telemetry(self, *addresses: str, rate: float = ...) -> Telemetry:
        """Read drives."""


class Drive:
    """A drive of a session. Steps are the drive's own units: motor steps, or counts with its encoder in use."""

    def __init__(self, session: Owner, drive: AsyncDrive) -> None:
        self._session, self._drive = session, drive
        self.programs = Programs(session, drive.programs)
        self.parameters = Parameters(session, drive.parameters)

    # What it is

    @property
    def name(self) -> str:
        """Its address, with the bus where several are open."""
        return self._drive.name

    @property
    def address(self) -> str:
        """Its address on the wire; empty where it needs none."""
        return self._drive.address

    @property
    def axis(self) -> str:
        """The axis that it moves and reads; empty: the first."""
        return self._drive.axis

    @property
    def product(self) -> str:
        """The short name of the product, such as LMDCM; empty if unknown."""
        return self._drive.product

    @property
    def referenced(self) -> bool:
        """False after a restart that was seen, until a homing has ended or the position was set."""
        return self._drive.referenced

    @property
    def version(self) -> str:
        """The version that it reports."""
        return self._drive.version

    # Lines

    def send(self, line: str) -> Lines:
        """Send a line in the drive's own language; return the lines that it prints. Raises Refused, NoAnswer."""
        return self._session.call(lambda: self._drive.send(line))

    def read(self, name: str) -> Value:
        """Read the value of a word of the drive, such as `VM`; `[LINE]` asks with a line that prints one value."""
        return self._session.call(lambda: self._drive.read(name))

    def write(self, name: str, value: Value) -> None:
        """Give a word of the drive a value. Raises Refused; Diagnostic where its language has no such form."""
        self._session.call(lambda: self._drive.write(name, value))

    # Motion

    def move(self, steps: int) -> None:
        """Begin to move by a distance. Raises Refused."""
        self._session.call(lambda: self._drive.move(steps))

    def move_to(self, position: int) -> None:
        """Begin to move to a position. Raises Refused."""
        self._session.call(lambda: self._drive.move_to(position))

    def wait(self, timeout: float = waits.LIMIT, *, idle: bool = False) -> None:
        """Wait until two readings show it at rest; with `idle` also until no program runs.

        Raises DriveError after `timeout` seconds.
        """
        self._session.call(lambda: self._drive.wait(timeout, idle=idle))

    @property
    def position(self) -> int:
        """The position, read now."""
        return self._session.call(self._drive.position)

    @property
    def velocity(self) -> int:
        """The velocity, signed, per second, read now."""
        return self._session.call(self._drive.velocity)

    @property
    def moving(self) -> bool:
        """Whether it moves, read now."""
        return self._session.call(self._drive.moving)

    @property
    def motion(self) -> Motion:
        """Position and velocity of its axis at one time, read now."""
        return self._session.call(self._drive.motion)

    # Stop, samples

    def stop(self) -> StopReport:
        """Stop this drive now; return what is known of it then. It refuses nothing afterwards."""

        async def stop() -> StopReport:
            return await self._drive.stop()

        return self._session.call(stop)

    def telemetry(self, rate: float = 50.0) -> Telemetry:
        """Read position and velocity `rate` times a second at most, as an iterator of samples."""
        return self._session.telemetry(self._drive.target, rate=rate)

    def __repr__(self) -> str:
        """Return its name and product."""
        return repr(self._drive)

    def _repr_html_(self) -> str:
        """Return what is known of it, for a notebook."""
        return self._drive._repr_html_()


class Programs:
    """The program of one drive. Raises Inexpressible where its family has none."""

    def __init__(self, session: Caller, programs: AsyncPrograms) -> None:
        self._session, self._programs = session, programs

    def list(self) -> Lines:
        """Read the program as a listing, with the remarks of its file where those are known."""
        return self._session.call(self._programs.list)

    def upload(self, file: str = "", *, raw: bool = False) -> Lines:
        """Read the program as the lines of a file; write them to a new `file` if one is named.

        `raw`: as they are stored. Raises Diagnostic for a file that exists.
        """
        return self._session.call(lambda: self._programs.upload(file, raw=raw))

    def download(
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
        self._session.call(
            lambda: self._programs.download(file, text, save=save, verify=verify, only_changed=only_changed, run=run)
        )


class Parameters:
    """The settings of one drive. Raises Inexpressible where the host reads none of its family."""

    def __init__(self, session: Caller, parameters: AsyncParameters) -> None:
        self._session, self._parameters = session, parameters

    def read(self) -> Readings:
        """Read every setting: `.values` by name, `.defaults`, and each with its unit in `.readings`."""
        return self._session.call(self._parameters.read)

    def backup(self, file: str) -> Readings:
        """Read every setting, and write them to a new file. Raises Diagnostic for a file that exists."""
        return self._session.call(lambda: self._parameters.backup(file))

    def diff(self, file: str = "") -> list[Difference]:
        """Compare with a file, or without one with the defaults: (name, value here, value there)."""
        return self._session.call(lambda: self._parameters.diff(file))

    def restore(
        self,
        file: str,
        *,
        save: bool = False,
        named: Collection[str] = (),
        communication: bool = False,
        other_product: bool = False,
        dry_run: bool = False,
    ) -> Lines:
        """Send what differs from a file; return the steps. It needs `connect(URL, yes=True)`, or `dry_run`.

        `named`: settings that are only written when named, since they can move the motor or lock the drive.
        """
        return self._session.call(
            lambda: self._parameters.restore(
                file,
                save=save,
                named=named,
                communication=communication,
                other_product=other_product,
                dry_run=dry_run,
            )
        )
