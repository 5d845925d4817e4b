"""The drives that an operation works on: those of a verb's line in a session, or those of a URL that a command opens.

A function that is both a verb and a command takes one of the two. Its declaration names `of_call` and one of the
functions that open a URL.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING, Generic, TypeVar

from multidrop.shell.operations.argument_types import Address, Drives, DrivesOfFiles, Url, Yes

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.origin import Origin
    from multidrop.shell.session import Call, Session

Work = Callable[["Session", "Origin"], Awaitable["int | None"]]
"""What is done in a session for a line or a command; it returns the exit code of a good end, where that is not 0."""
R_co = TypeVar("R_co", covariant=True)
OnEach = Callable[["Session", "Origin", "Drive"], Awaitable[None]]


class OnDrives(ABC, Generic[R_co]):
    """The drives of `target`: one (empty: the selected one, or the first), several (`a,b`), or `all`."""

    def __init__(self, target: str) -> None:
        self.target = target

    @property
    def several(self) -> bool:
        from multidrop.shell.params.work import is_several

        return is_several(self.target)

    @abstractmethod
    def run(self, work: Work, *, unsolicited: bool = False) -> R_co:
        """Do the work: an awaitable in a session, else its exit code. `unsolicited`: see `batch.runner.run`."""

    def each(self, work: OnEach, having: str = "programs", *, unsolicited: bool = True) -> R_co:
        """Do the work for each drive; see `run`. `having`: what a family of one of `all` must have."""

        async def whole(session: Session, origin: Origin) -> None:
            from multidrop.shell.params.work import each, targets

            drives = targets(session, origin, self.target, having)
            await each(session, drives, lambda drive: work(session, origin, drive))

        return self.run(whole, unsolicited=unsolicited)

    @abstractmethod
    def program_text(self, file: str) -> str | None:
        """The text of a program file that a person has seen, or that was checked; None: it is still to be read.

        Raises Diagnostic.
        """

    def new_file(self, name: str) -> str:
        """The path of a file to write; of several drives the path of a folder. Raises Diagnostic."""
        from multidrop.shell.params.work import check_new

        check_new(name, self.target)
        return name


class OfCall(OnDrives[Awaitable["int | None"]]):
    """The drives of a verb's line."""

    def __init__(self, call: Call, target: str) -> None:
        super().__init__(target)
        self.call = call

    def run(self, work: Work, *, unsolicited: bool = False) -> Awaitable[int | None]:
        """Do the work in the session of the line."""
        return work(self.call.session, self.call.origin)

    def program_text(self, file: str) -> str | None:
        """The text that a person was shown; see `Call.shown`."""
        self.call.warn_of_editor(file)
        return self.call.shown if isinstance(self.call.shown, str) else None

    def new_file(self, name: str) -> str:
        """The path; a macro's is in the current folder."""
        return super().new_file(self.call.output_file(name))


class OfUrl(OnDrives[int]):
    """The drives of a URL, which is opened for the work.

    `agreed`: every question is answered with yes. `also`: other drives that the work is to find.
    """

    def __init__(self, url: str, target: str, agreed: bool = False, also: Sequence[str] = ()) -> None:
        super().__init__(target)
        self.url, self.agreed, self.also = url, agreed, also

    def run(self, work: Work, *, unsolicited: bool = False) -> int:
        """Open the URL, do the work, and return the exit code."""
        from multidrop.shell.batch import runner

        tried = [*self.target.split(","), *self.also]

        def body(session: Session) -> Awaitable[int | None]:
            return work(session, session.origin)

        return runner.run([self.url], body, agreed=self.agreed, unsolicited=unsolicited, tried=tried)

    def program_text(self, file: str) -> str:
        """The text, read once: each drive gets what was checked before anything is opened."""
        from multidrop.shell.programs.checking import correct_text_of

        return correct_text_of(file)


def given_options(call: Call) -> list[str]:
    """The options of a line as words, in the order of the usage."""
    values = call.chosen.values
    given = [(option.names[-1], values[option.name]) for option in call.chosen.form.options if values[option.name]]
    words: list[str] = []
    for name, value in given:
        words += [name] if value is True else [name, value if isinstance(value, str) else ",".join(sorted(value))]
    return words


def of_call(call: Call, addr: Address = "") -> OfCall:
    return OfCall(call, addr)


def one_of_call(call: Call, addr: Address = "") -> OfCall:
    """The drive of a verb's line whose program is meant. Raises Diagnostic for several."""
    from multidrop.shell.params.work import is_several
    from multidrop.shell.program_listing import of_one

    if is_several(addr):
        raise of_one(addr)
    return OfCall(call, addr)


Do = Callable[[OfUrl], int]


def of_url(work: Do, url: Url, *, drive: Drives = "") -> int:
    return work(OfUrl(url, drive))


def of_url_to_files(work: Do, url: Url, *, drive: DrivesOfFiles = "") -> int:
    return work(OfUrl(url, drive))


def agreed_of_url(work: Do, url: Url, *, drive: Drives = "", yes: Yes = False) -> int:
    return work(OfUrl(url, drive, yes))


def agreed_of_url_from_files(work: Do, url: Url, *, drive: DrivesOfFiles = "", yes: Yes = False) -> int:
    return work(OfUrl(url, drive, yes))
