"""Certificates: the answers of a drive to the questions that our rulings leave open, and two drives compared by them.

Theory of operation. A question is a row of the family's table. Its lines go the way of a typed line; its answer is what
they print, or refuse. What a question changes is owed to the drive from before its first line: it is restored after the
last one, after a stop, and by the next session if this one is killed. Questions that move the motor come last, after a
person's word. A report has neither serial number nor name of a host, a port or the drive. Decision 0096.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic, DriveError, NoAnswer, Refused, Stopped, TransportLost
from multidrop.base.files import escaped_toml, text_of, toml_of
from multidrop.base.text import counted
from multidrop.dialects.certifying import BYTES, FITS, MOVES, Certifying, Occupied, Question
from multidrop.dialects.owed_settings import owed, restored
from multidrop.drives.conversations import refuse_stranger
from multidrop.drives.drive import Drive
from multidrop.drives.events import Concluded, Transaction
from multidrop.shell import travel
from multidrop.shell.channel import running
from multidrop.shell.session import Session
from multidrop.shell.waits import wait

HEAD = (
    "What a drive answers to the questions of `multidrop certify`, one text for each line that was sent.",
    "It holds no serial number, and no name of a host, a port, a person or the drive.",
)
SPACE = 64 * 1024
"""More bytes than a report has."""
WRITES = "`multidrop certify URL -o FILE` writes a report"
FACTS = ("family", "product", "version", "part", "traits")
"""What a report says of its drive."""
NO_REPLY, AS_RULED, DONE = "no reply", "as ruled", "ok"
WAIT, SLEEP = "/wait", "/sleep "
"""Lines of a question that are not sent: until the drive rests, and for a time, s."""
UNREACHED = "the questions ended before it"
NO_CONSENT = "they move the motor, and nobody agreed to that (--yes agrees beforehand)"
LONGEST_MOVE = 60.0
_VALUE = re.compile(r"\{([A-Z]\w*|\d+, \d+)([+-]\d+)?\}", re.ASCII)


@dataclass
class CertifyReport:
    """The answers of one drive, one for each line that was sent, and why other questions were not asked."""

    drive: dict[str, str]
    answers: dict[str, list[str]] = field(default_factory=dict)
    unlike: list[str] = field(default_factory=list)
    """The questions whose answer is not that of our ruling."""
    unasked: dict[str, str] = field(default_factory=dict)

    def text(self) -> str:
        import tomlkit  # takes 30 ms to import

        document = tomlkit.document()
        for line in HEAD:
            document.add(tomlkit.comment(line))
        document["drive"] = self.drive
        document["answers"] = self.answers
        document["other_than_ruled"] = {"questions": self.unlike}
        document["not_asked"] = {
            why: [name for name, reason in self.unasked.items() if reason == why] for why in self.unasked.values()
        }
        return escaped_toml(tomlkit.dumps(document))


def load(path: str) -> CertifyReport:
    """Read a report. Raises Diagnostic."""
    tables = toml_of(text_of(path), path)
    drive, answers = tables.get("drive"), tables.get("answers")
    if not (isinstance(drive, dict) and isinstance(drive.get("family"), str) and isinstance(answers, dict) and answers):
        raise Diagnostic("is not a report with answers", path, WRITES)
    _check_keys(tables, ("drive", "answers", "other_than_ruled", "not_asked"), path)
    _check_keys(drive, FACTS, f"{path}: [drive]")
    for name, text in drive.items():
        if not (isinstance(text, str) and text):
            raise Diagnostic("must be a text, as the drive printed it", f"{path}: [drive] {name}", WRITES)
    if "product" not in drive:
        raise Diagnostic("is missing", f"{path}: [drive] product", WRITES)
    for name, lines in answers.items():
        _check_texts(lines, f"{path}: [answers] {name}")
    others, unasked = tables.get("other_than_ruled", {}), tables.get("not_asked", {})
    if not (isinstance(others, dict) and isinstance(unasked, dict)):
        raise Diagnostic("other_than_ruled and not_asked must be tables", path, WRITES)
    _check_keys(others, ("questions",), f"{path}: [other_than_ruled]")
    _check_texts(unlike := others.get("questions", []), f"{path}: [other_than_ruled] questions", least=0)
    for why, names in unasked.items():
        _check_texts(names, f"{path}: [not_asked] {why}")
    for name in unlike:
        if name not in answers:
            raise Diagnostic(f"names {name}, which has no answer", f"{path}: [other_than_ruled] questions", WRITES)
    return CertifyReport(dict(drive), dict(answers), list(unlike))


def _check_keys(table: Mapping[str, Any], valid: Sequence[str], where: str) -> None:
    for key in table:
        if key not in valid:
            raise Diagnostic(f"no key {_shown([key])}", where, f"valid: {', '.join(valid)}")


def _check_texts(found: Any, where: str, least: int = 1) -> None:
    if not (isinstance(found, list) and len(found) >= least and all(isinstance(text, str) for text in found)):
        raise Diagnostic("must be a list of texts", where, WRITES)


def _check_answers(questions: Sequence[Question], theirs: CertifyReport, file: str) -> None:
    """Check that a report has one answer for each line of its questions. Raises Diagnostic."""
    for question in questions:
        their_answers = theirs.answers.get(question.name, [])
        most = 1 if question.shows == FITS and their_answers == [AS_RULED] else len(question.lines)
        if their_answers and len(their_answers) != most:
            what = f"has {counted(len(their_answers), 'text')}, and the question has {counted(most, 'line')}"
            raise Diagnostic(what, f"{file}: [answers] {question.name}", WRITES)


async def certify(session: Session, drive: Drive, file: str) -> None:
    """Ask a drive all questions, and write the report; one that ends early has what is known then."""
    new_file.check_space(file, SPACE)
    asking = Asking(session, drive)
    try:
        await asking.all()
    finally:
        if asking.report.answers:
            _write(session, asking.report, file)
    report, who = asking.report, session.display_name(drive)
    others = f"; {len(report.unlike)} not as our rulings have it: {', '.join(report.unlike)}" if report.unlike else ""
    counts = f"{counted(len(report.answers), 'question')} answered, {len(report.unasked)} not asked"
    session.notify(f"{who}: {counts}{others}{new_file.place(file)}", outcome=True)
    for reason in dict.fromkeys(report.unasked.values()):
        count = sum(each == reason for each in report.unasked.values())
        session.notify(f"{who}: {count} not asked: {reason}", warning=True)


def _write(session: Session, report: CertifyReport, file: str) -> None:
    """Write a report; onto standard output where the disk takes no file, as the drive was asked. Raises Diagnostic."""
    try:
        new_file.write(file, report.text(), session.output)
    except Diagnostic:
        new_file.write(new_file.STANDARD_OUTPUT, report.text(), session.output)
        raise


async def compare(session: Session, drive: Drive, file: str, theirs: CertifyReport) -> bool:
    """Put the questions of a report to a drive, and print where its answers differ; whether they do.

    `theirs`: the report, as it was read from the file. An answer of it that cannot be compared counts as a difference.
    """
    who = session.display_name(drive)
    if theirs.drive["family"] != drive.family.name:
        family = _shown([theirs.drive["family"]])
        raise Diagnostic(f"has answers of the family {family}; {who} is of {drive.family.name}", file)
    asking = Asking(session, drive)
    _check_answers(asking.questions, theirs, file)
    try:
        await asking.all(theirs.answers)
    finally:
        here, same = asking.report, 0
        for name, there in theirs.answers.items():
            own = here.answers.get(name)
            same += own == there
            if own is None:
                why = here.unasked.get(name, f"no question to {drive.product}")
                session.output(f"{_shown([name])}: not compared: {why}")
            elif own != there:
                session.output(f"{_shown([name])}: here {_shown(own)}; in {file} {_shown(there)}")
        session.notify(f"{who}: {same} of {len(theirs.answers)} answers of {file} are the same", outcome=True)
    return same != len(theirs.answers)


def _shown(answers: Sequence[str]) -> str:
    return " // ".join(answer.encode("unicode_escape").decode() for answer in answers)


class Asking:
    """The questions put to one drive, and its report so far."""

    def __init__(self, session: Session, drive: Drive) -> None:
        self._session, self._drive, self._who = session, drive, session.display_name(drive)
        certifying = drive.family.certifying
        if certifying is None:
            raise Diagnostic(f"no questions are known for drives of {drive.family.name}", self._who)
        state = drive.state
        if not state.product:  # what is owed to a drive is kept by what the drive is
            refuse_stranger(self._drive.state, self._who)
            raise NoAnswer(f"{self._who} was not found on this line; check its name, or give drives=NAMES in the URL")
        known = {"family": drive.family.name, "product": state.product, "version": state.version, "part": state.part}
        known["traits"] = " ".join(sorted(certifying.traits()))
        self.report = CertifyReport({key: text for key, text in known.items() if text})

    @property
    def _table(self) -> Certifying:
        certifying = self._drive.family.certifying
        assert certifying is not None
        return certifying

    @property
    def questions(self) -> list[Question]:
        """The questions to this drive."""
        return self._table.questions()

    async def all(self, wanted: Mapping[str, Any] | None = None) -> None:
        """Ask all questions, or those that are `wanted`; those that move the motor come last."""
        questions = [each for each in self.questions if wanted is None or each.name in wanted]
        moving = [each for each in questions if each.does == MOVES]
        self.report.unasked = {each.name: UNREACHED for each in questions}
        with running(self._session, f"{self._who}: certify") as progress:
            occupied = await self._occupied()
            still = [each for each in questions if each.does != MOVES]
            for number, question in enumerate(still):
                progress(number, len(questions))
                await self._unless(occupied.reason(question.does), question)
            if not moving:
                return
            reason = (await self._occupied()).reason(MOVES) or await self._consent(moving)
            reason = reason or (await self._occupied()).reason(MOVES)  # a person may have thought for a while
            for number, question in enumerate(moving, len(still)):
                progress(number, len(questions))
                await self._unless(reason, question)

    async def _occupied(self) -> Occupied:
        """Why some questions must not be asked now."""
        drive = self._drive
        if drive.programming:
            raise Refused(f"{self._who} is in program mode and would store every question; PG ends that")
        if await drive.run(drive.family.moving()):
            return Occupied("it moved")
        if await drive.busy():
            return Occupied("its program ran")
        return await drive.run(self._table.occupied())

    async def _consent(self, moving: Sequence[Question]) -> str:
        """Ask a person, unless --yes has agreed; the reason why the motor must not be moved."""
        questions, stops = self._session.questions, self._drive.stops
        names = ", ".join(each.name for each in moving)
        more = f"{counted(len(moving), 'more question')} ({names})"
        what = f"{self._who}: {more}: the motor moves by 400 steps at most, and back"
        agreed = questions.agreed or await questions.agrees(what)
        if self._drive.stops != stops:
            raise Stopped(f"{self._who}: a stop came before the answer")
        return "" if agreed else NO_CONSENT

    async def _unless(self, reason: str, question: Question) -> None:
        """Ask one question, unless there is a reason against it; restore what it changes, after a stop too."""
        if reason:
            self.report.unasked[question.name] = reason
            return
        table, state, family = self._table, self._drive.state, self._drive.family
        sent = [line for line in question.lines if not line.startswith("/")]
        if guarded := "; ".join(filter(None, (self._session.settings.guards.what(family, line) for line in sent))):
            self.report.unasked[question.name] = f"the configuration guards a line of it: {guarded}"
            return
        words = dict.fromkeys(match[1] for line in (*question.lines, question.ruled) for match in _VALUE.finditer(line))
        try:
            values = {word: await self._value(word) for word in words}
            kept = [table.writes.format(word, await self._value(word)) for word in question.keeps]
        except Refused as refusal:
            self.report.unasked[question.name] = f"a value that it needs was refused (error {refusal.code})"
            return
        if kept and state.restore is not None:
            raise Refused(f"{self._who} is still owed other settings from before; open it again")
        if kept:
            state.owes(owed(state, kept[::-1]))
        try:
            answers = [await self._answer(question, _filled(line, values)) for line in question.lines]
        finally:
            if kept:
                await self._restore(kept)
        del self.report.unasked[question.name]
        fits = re.fullmatch(_filled(question.ruled, values), " // ".join(answers), re.DOTALL) is not None
        if not fits:
            self.report.unlike.append(question.name)
        self.report.answers[question.name] = [AS_RULED] if fits and question.shows == FITS else answers

    async def _restore(self, kept: Sequence[str]) -> None:
        """Restore what a question has changed; say what a drive without a reply is still owed."""
        drive = self._drive
        try:
            await drive.run(restored(drive.state, drive.family.perform))
        except (DriveError, TransportLost):
            text = f"{', '.join(kept)}: not restored; the next session on this port does that"
            self._session.notify(f"{self._who}: {text}", warning=True)
            raise

    async def _value(self, word: str) -> str:
        """Read the value of a setting."""
        printed = await self._drive.send(self._table.reads.format(word))
        if not printed:
            raise NoAnswer(f"{self._who} printed nothing for {word}")
        return printed[0].strip()

    async def _answer(self, question: Question, line: str) -> str:
        """Send one line once, as a typed line is sent; return its answer as a text."""
        drive, session, table = self._drive, self._session, self._table
        if line == WAIT:
            await wait(
                session, session.origin, LONGEST_MOVE, idle=False, drives=[drive], ended=True
            )  # some of its moves are to fail
            return DONE
        if line.startswith(SLEEP):
            await asyncio.sleep(float(line.removeprefix(SLEEP)))
            return DONE
        if question.does == MOVES and session.scaled:
            await travel.ask(session.units, drive, line, session.origin)
        taken: list[Transaction] = []

        def note(concluded: Concluded) -> None:
            if concluded.state is drive.state:
                taken.extend(transaction for transaction in concluded.transactions if transaction.request.text == line)

        leave = session.buses[drive.link.name].witnesses.add(note)
        try:
            async with (
                session.path.starting(session.origin, drive, line) if drive.starts(line) else contextlib.nullcontext()
            ):
                text = "; ".join(await self._sent(line)) or DONE
        except Refused as refusal:
            text = table.refused.format(code=refusal.code, text=taken[-1].reply.text if taken else "")
        except NoAnswer:
            text = NO_REPLY
        finally:
            leave()
        if question.shows == BYTES:
            text = table.masked(taken[0].reply.raw) if taken else NO_REPLY
        return text.replace(drive.state.serial, "SERIAL") if drive.state.serial else text

    async def _sent(self, line: str) -> tuple[str, ...]:
        drive, (verb, *numbers) = self._drive, line.split(" ")
        registers = drive.family.registers
        if registers is not None and verb == "/register":
            address, count = (int(number, 0) for number in numbers)
            return await drive.run(registers.read(address, count))
        if registers is not None and verb == "/coil":
            return await drive.run(registers.read_coil(int(numbers[0])))
        return await drive.send(line)


def _filled(text: str, values: Mapping[str, str]) -> str:
    """Put values in place of `{WORD}`, and of `{WORD+100}` a sum."""

    def value(found: re.Match[str]) -> str:
        here = values[found[1]]
        return str(int(here) + int(found[2])) if found[2] else here

    return _VALUE.sub(value, text)
