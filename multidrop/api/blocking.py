"""The blocking API, made from the awaited one: each call is awaited in a thread of the session.

So it works in a notebook, too, whose own loop runs already. There an interrupted cell stops the drives. Of notebooks
only IPython is used, which every kernel has; nothing is loaded before it is there.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import sys
from collections.abc import Callable, Coroutine
from functools import update_wrapper
from types import TracebackType
from typing import TYPE_CHECKING, Any, Concatenate, Generic, Never, ParamSpec, TypeVar, overload

from multidrop.api import endings
from multidrop.api.calls import CLOSED, StopReport
from multidrop.api.drives import AsyncDrive, DriveFacts
from multidrop.api.events import Event
from multidrop.api.fixed import Fixed
from multidrop.api.notebooks import Live, live
from multidrop.api.programs import AsyncParameters, AsyncPrograms
from multidrop.api.sessions import AsyncSession, Notice, log
from multidrop.api.streams import AsyncStream
from multidrop.api.telemetry import RATE, AsyncTelemetry, Sample
from multidrop.api.threads import LoopEnded, LoopThread, Notices
from multidrop.base.errors import Diagnostic
from multidrop.drives.telemetry import WATCH_PERIOD
from multidrop.shell.events import FAILURES

P = ParamSpec("P")
T = TypeVar("T")
Self = TypeVar("Self", bound="Stream[Any]")


def blocking(method: Callable[Concatenate[Any, P], Coroutine[Any, Any, T]]) -> Callable[Concatenate[Any, P], T]:
    """Make the blocking form of an awaited method, for an object with `awaited` and `call`."""

    def call(self: Any, /, *arguments: P.args, **named: P.kwargs) -> T:
        __tracebackhide__ = True
        result: T = self._call(lambda: method(self._awaited, *arguments, **named))
        return result

    return update_wrapper(call, method, ("__doc__", "__name__", "__annotations__"), ())


class ReadProperty(Generic[T]):
    """A property that reads now, made from an awaited method, for an object with `_awaited` and `_call`."""

    def __init__(self, method: Callable[[Any], Coroutine[Any, Any, T]]) -> None:
        self._method, self.__doc__ = method, method.__doc__

    @overload
    def __get__(self, found: None, kind: type) -> ReadProperty[T]: ...
    @overload
    def __get__(self, found: Any, kind: type) -> T: ...
    def __get__(self, found: Any, kind: type) -> T | ReadProperty[T]:
        return self if found is None else found._call(lambda: self._method(found._awaited))

    if TYPE_CHECKING:

        def __set__(self, found: Any, value: Never) -> None: ...  # at run time `Fixed` refuses it


class Session(Fixed):
    """Open connections and their drives: `with connect(URL) as session`. Any thread may use it.

    Leaving the block by an exception stops every drive that it has set in motion. So do an interruption (Ctrl+C) of a
    call, and the end of the process while it is open.
    """

    def __init__(
        self, *urls: str, yes: bool = False, beyond: bool = False, reconnect: bool = False, notice: Notice = log
    ) -> None:
        """Open the connections; see `connect`."""
        self._notices = Notices(notice)
        self._awaited = AsyncSession(urls, yes=yes, beyond=beyond, reconnect=reconnect, notice=self._notices)
        self._thread = LoopThread()
        self._leaving = contextlib.ExitStack()
        """The contexts that end after everything is closed, and before the thread does."""
        try:
            self._call(self._awaited._open)
        except BaseException:
            self._thread.end()
            self._notices.end()
            raise
        endings.opened(self, self._end_early)
        self._leave_notebook = on_interrupt(self._break_off)

    # Beginning and end

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it; after an exception stop what was started, and say what the stop did not reach."""
        self._close(stop=failure is not None)

    add = blocking(AsyncSession.add)
    wait_back = blocking(AsyncSession.wait_back)

    def close(self) -> None:
        """Close everything. Drives go on as they are. May be called again."""
        self._close(stop=False)

    def _end_early(self) -> None:
        """Stop what was started, and close."""
        self._close(stop=True)

    def _close(self, stop: bool) -> None:
        endings.closing(self)
        if self._thread.alive:
            self._leave_notebook()
            try:
                self._call(lambda: self._awaited.close(stop=stop))
            finally:
                self._leaving.close()
            self._thread.end()
            self._notices.end()
        endings.closed(self)

    def _call(self, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Await work in the session's thread. An interruption while waiting stops what the session started."""
        __tracebackhide__ = True
        if not self._thread.alive:
            raise Diagnostic(*CLOSED)
        future = None
        try:
            future = self._thread.begin(work())
            return future.result()
        except FAILURES as error:
            raise error.with_traceback(None) from None
        except (LoopEnded, concurrent.futures.CancelledError):
            if self._thread.alive:
                raise
            raise Diagnostic(*CLOSED) from None  # by another thread, meanwhile
        except (KeyboardInterrupt, SystemExit):  # of this thread: no call raises them
            if future is None or not future.done():
                self._break_off()
            raise

    def _break_off(self) -> None:
        """Stop what this session started; it stays open."""
        with contextlib.suppress(Diagnostic, LoopEnded):
            self._thread.begin(self._awaited._break_off()).result()

    def _run_there(self, function: Callable[[], T]) -> T:
        """Call a function in the session's thread."""

        async def run() -> T:
            return function()

        return self._call(run)

    # Drives

    @property
    def drives(self) -> list[Drive]:
        """Every drive that was found."""
        return [Drive(self, each) for each in self._run_there(lambda: self._awaited.drives)]

    def drive(self, address: str = "", axis: str = "") -> Drive:
        """The drive at an address: `a`, `press:a`, a name of the saved connection; without one the selected drive.

        `axis`: for a drive with several, such as `y`; by default the first. Raises Diagnostic, NoAnswer.
        """
        return Drive(self, self._run_there(lambda: self._awaited.drive(address, axis)))

    # Lines, scripts, samples

    send = blocking(AsyncSession.send)
    run = blocking(AsyncSession.run)

    def telemetry(self, *addresses: str, rate: float = RATE) -> Telemetry:
        """Read position and velocity of drives (all without an address), each `rate` times a second at most.

        A rate of `math.inf` is as fast as the line allows.
        """
        return Telemetry(self, self._run_there(lambda: self._awaited.telemetry(*addresses, rate=rate)))

    def live(self, *addresses: str, rate: float = 10.0) -> Live:
        """Show a table and plots of drives (all without an address) below the cell of a notebook, kept up to date.

        `rate`: samples of each drive a second. Raises Diagnostic outside a notebook.
        """
        return live(self.telemetry(*addresses, rate=rate))

    def events(self, *addresses: str, every: float = WATCH_PERIOD) -> Events:
        """Iterate over what happens to drives (all without an address) and their lines: see `Event`.

        `every`: seconds between two readings of a drive.
        """
        return Events(self, self._run_there(lambda: self._awaited.events(*addresses, every=every)))

    # Stop

    def stop(self) -> StopReport:
        """Stop every drive on every connection now, ahead of everything; return what is known of them then.

        It ends calls of other threads with Stopped, and refuses calls that send commands until `resume`.
        """
        shell = self._awaited._shell

        async def stop() -> StopReport:
            return await self._awaited.stop()

        shell.stop_ahead()
        try:
            return self._call(stop)
        except (KeyboardInterrupt, SystemExit):
            self._thread.soon(shell.stop)  # which must follow what was written ahead
            raise

    resume = blocking(AsyncSession.resume)

    def __repr__(self) -> str:
        """Return its lines and their drives."""
        return repr(self._awaited)

    def _repr_html_(self) -> str | None:
        """Return a table of the drives, for a notebook."""
        return self._awaited._repr_html_()


class _OfSession:
    """A part of a session, in whose thread its calls are awaited."""

    _session: Session

    def _call(self, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        __tracebackhide__ = True
        return self._session._call(work)


class Drive(_OfSession, DriveFacts):
    """A drive of a session. Steps are the drive's own units: motor steps, or counts with its encoder in use."""

    def __init__(self, session: Session, awaited: AsyncDrive) -> None:
        super().__init__(awaited._calls, awaited._drive, awaited.axis)
        self._awaited, self._session = awaited, session
        self.programs = Programs(session, awaited.programs)
        self.parameters = Parameters(session, awaited.parameters)

    send = blocking(AsyncDrive.send)
    read = blocking(AsyncDrive.read)
    write = blocking(AsyncDrive.write)
    move = blocking(AsyncDrive.move)
    move_to = blocking(AsyncDrive.move_to)
    wait = blocking(AsyncDrive.wait)
    position_in = blocking(AsyncDrive.position_in)
    velocity_in = blocking(AsyncDrive.velocity_in)
    run_at = blocking(AsyncDrive.run_at)
    wait_for = blocking(AsyncDrive.wait_for)
    home = blocking(AsyncDrive.home)
    accept = blocking(AsyncDrive.accept)
    enable = blocking(AsyncDrive.enable)
    disable = blocking(AsyncDrive.disable)
    set_output = blocking(AsyncDrive.set_output)
    read_error = blocking(AsyncDrive.read_error)

    position = ReadProperty(AsyncDrive.position)
    velocity = ReadProperty(AsyncDrive.velocity)
    moving = ReadProperty(AsyncDrive.moving)
    motion = ReadProperty(AsyncDrive.motion)
    homed = ReadProperty(AsyncDrive.homed)
    error = ReadProperty(AsyncDrive.error)
    inputs = ReadProperty(AsyncDrive.inputs)
    limits = ReadProperty(AsyncDrive.limits)

    def stop(self) -> StopReport:
        """Stop this drive now; return what is known of it then. It refuses nothing afterwards."""

        async def stop() -> StopReport:
            return await self._awaited.stop()

        return self._call(stop)

    def telemetry(self, rate: float = RATE) -> Telemetry:
        """Read position and velocity `rate` times a second at most, as an iterator of samples."""
        return self._session.telemetry(self._target, rate=rate)


class Programs(_OfSession, Fixed):
    """The program of one drive. Raises Inexpressible where its family has none."""

    def __init__(self, session: Session, awaited: AsyncPrograms) -> None:
        self._awaited, self._session = awaited, session

    list = blocking(AsyncPrograms.list)
    upload = blocking(AsyncPrograms.upload)
    download = blocking(AsyncPrograms.download)


class Parameters(_OfSession, Fixed):
    """The settings of one drive. Raises Inexpressible where the host reads none of its family."""

    def __init__(self, session: Session, awaited: AsyncParameters) -> None:
        self._awaited, self._session = awaited, session

    read = blocking(AsyncParameters.read)
    backup = blocking(AsyncParameters.backup)
    diff = blocking(AsyncParameters.diff)
    restore = blocking(AsyncParameters.restore)


class Stream(_OfSession, Generic[T]):
    """What happens from now until `close`, the end of the session, or the loss of a line: iterate over it."""

    def __init__(self, session: Session, awaited: AsyncStream[T]) -> None:
        self._stream, self._session = awaited, session

    def __enter__(self: Self) -> Self:
        """Return it; the end of the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End it. What came before can still be taken. May be called again."""
        with contextlib.suppress(Diagnostic):
            self._session._run_there(self._stream.close)

    def __iter__(self: Self) -> Self:
        return self

    def __next__(self) -> T:
        """Wait for the next one. Raises what ends it once all before are taken."""
        try:
            return self._call(self._stream.__anext__)
        except StopAsyncIteration:
            raise StopIteration from None


class Events(Stream[Event]):
    """Events of drives and lines, until `close` or the end of the session: iterate over them."""


class Telemetry(Stream[Sample]):
    """Samples from now until `close`, the end of the session, or the loss of a line: iterate over it."""

    def __init__(self, session: Session, awaited: AsyncTelemetry) -> None:
        super().__init__(session, awaited)
        self._awaited = awaited

    @property
    def missed(self) -> int:
        """The number of samples that were dropped because the program did not take them."""
        return self._awaited.missed

    samples = blocking(AsyncTelemetry.samples)


def running() -> Any:
    """The IPython that runs this program; None: none does."""
    ipython = sys.modules.get("IPython")
    return ipython.get_ipython() if ipython is not None else None


def on_interrupt(stop: Callable[[], object]) -> Callable[[], object]:
    """Call `stop` where a cell ends by an interruption, wherever the program was; return what ends that."""
    shell = running()
    if shell is None:
        return lambda: None

    def check(result: Any) -> None:
        if isinstance(result.error_in_exec, KeyboardInterrupt):
            stop()

    def leave() -> None:
        with contextlib.suppress(ValueError):  # a second time
            shell.events.unregister("post_run_cell", check)

    shell.events.register("post_run_cell", check)
    return leave


def connect(*urls: str, yes: bool = False, beyond: bool = False, reconnect: bool = False) -> Session:
    """Open connections as on the command line: ports, URLs, saved connections, `sim:`. Moves nothing.

    `yes`: questions, such as that of a restore, are answered with yes beforehand. `beyond`: moves may leave the travel
    of their axis, which `yes` does not include. `reconnect`: a lost connection is tried again until it is back; calls
    raise Lost meanwhile, and calls that move a drive raise Unreferenced after it, where the drive is not as it was.
    Raises Diagnostic for a wrong URL, Unreachable where there is no connection, NoAnswer where no drive replies.
    """
    return Session(*urls, yes=yes, beyond=beyond, reconnect=reconnect)
