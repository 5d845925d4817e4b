"""Certificates on simulated drives: what is asked, what is restored, what a report has, and what a comparison finds."""

from __future__ import annotations

import asyncio
import contextlib
import json
from contextlib import AsyncExitStack
from dataclasses import replace
from unittest import mock

import pytest

from multidrop.base.errors import Diagnostic, NoAnswer, Refused, Stopped, TransportLost
from multidrop.dialects.certifying import BYTES, ERROR, FITS, MODE, MOVES, NOTHING
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.owed_settings import owed
from multidrop.families.lexium.simulator.device import PrintedAnswer
from multidrop.families.lexium.simulator.ports import replies
from multidrop.families.lexium.simulator.ports.modbus import ModbusPort
from multidrop.families.tmcl.manual import commands
from multidrop.families.tmcl.manual.commands import Status
from multidrop.families.tmcl.simulator.module import ModuleReply
from multidrop.features.certify.certificate import SLEEP, WAIT, Asking, certify, compare, load
from multidrop.shell.channel import Front
from multidrop.shell.configuration import Guarding, Settings
from multidrop.shell.session import Session
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from tests.support.cell_session import CellSession, bus, drive, party, pmx

ROUTINE = 'program_text = """\nPG 1\nLB Ga\nMR 5000\nRT\nPG\nOE Ga\n"""'
DRIVES = {
    "lexium": bus("w", drive("LMDCM", EM=0)),
    "ethernet": bus("w", drive("LMDCE")),
    "mdrive": bus("w", drive("MDI")),
    "pmx": bus("w", pmx("00")),
    "tmcl": bus("w", drive("TMCM", "1")),
}


def table_of(family):
    found = FAMILIES[family]
    return found(found.new_state(found.codec, "")).certifying.table()


def rows(family, *traits):
    return [each for each in table_of(family) if each.asks <= {*traits}]


PLANTS = [
    *(("lexium", each) for each in rows("mcode", "lexium", "serial", "alone", "hmt")),
    *(("ethernet", each) for each in rows("mcode", "ethernet") if each.asks),
    *(("mdrive", each) for each in rows("mcode", "mdrive", "base") if each.asks),
    *(("pmx", each) for each in rows("pmx")),
    *(("tmcl", each) for each in rows("tmcl")),
]


@pytest.fixture
async def cell(tmp_path, request):
    async with CellSession(tmp_path, request.param) as made:
        yield made


def on(text):
    """The cell of a test."""
    return pytest.mark.parametrize("cell", [text], indirect=True)


async def asked(cell, *names):
    """What a drive answers to these questions, to all without names."""
    asking = Asking(cell.session, cell.session.drive("w"))
    await asking.all(dict.fromkeys(names) or None)
    return asking.report


def planted_line(question):
    """The line that a simulated drive is to answer otherwise: the last one, or the first that nothing else sends."""
    lines = [line for line in question.lines if line != WAIT and not line.startswith(SLEEP)]
    first = question.name in ("status-bare", "speed-bare")
    return next((line for line in lines if first or line.startswith(("MA", "MVP"))), lines[-1])


class Planted:
    """A simulated drive that answers one line otherwise from `begin` on: it refuses what it takes, and vice versa."""

    def __init__(self, cell, family, question):
        [placed] = cell.floor.floor.drives
        self.device, self.line, self.fits = placed.device, planted_line(question), question.shows == FITS
        self.real, self.begun, self.refused = self.device.execute, False, {}
        self.device.execute = {"pmx": self.pmx, "tmcl": self.tmcl}.get(family, self.mcode)

    def pmx(self, text, now):
        head, template, _ = self.line.partition("{")
        hit = text.startswith(head) if template else text == head
        return "!planted" if self.begun and hit else self.real(text, now)

    def tmcl(self, call, now):
        head, template, _ = self.line.partition("{")
        wanted = commands.parse(f"{head}0" if template else head)
        known = (wanted.command, wanted.type, wanted.motor, call.value if template else wanted.value)
        found = self.real(call, now)
        if not self.begun or (call.command, call.type, call.motor, call.value) != known:
            return found
        return ModuleReply(Status.NOT_AVAILABLE if found.status == Status.DONE else Status.DONE, call.value)

    def mcode(self, text, now, **more):
        line, signed, sign = text.rpartition(',"')
        line = line if signed and text.startswith("PR") else text
        head, template, _ = self.line.partition("{")
        if not (self.begun and (line.startswith(head) if template else line == head)):
            answer = self.real(text, now, **more)
            self.refused[line] = answer.refused
            return answer
        prints = line.startswith("PR") and not self.fits
        if self.refused.get(line) or prints:
            return PrintedAnswer((f"-77{sign[:-1]}",) if line.startswith("PR") else ())
        self.device.fail(33, now)
        return PrintedAnswer(refused=True)


@contextlib.contextmanager
def other_bytes(question):
    """Have simulated drives begin the reply to the last line of a question with a blank."""
    composed = replies.compose

    def compose(mode, text, outcome, prompt):
        found = composed(mode, text, outcome, prompt)
        return b" " + found if text.lstrip(b"!").startswith(planted_line(question).encode()) else found

    with mock.patch.object(replies, "compose", compose):
        yield


@pytest.mark.virtual
@pytest.mark.parametrize(("family", "question"), PLANTS, ids=lambda each: getattr(each, "name", each))
async def test_a_planted_deviation_is_found_by_its_question(tmp_path, family, question):
    async with CellSession(tmp_path, DRIVES[family].replace("baud = 9600", "baud = 0")) as cell:
        drive, file = cell.session.drive("w"), str(tmp_path / "r.toml")
        planted = Planted(cell, family, question)
        before = await asked(cell, question.name)
        assert (before.unasked, before.unlike) == ({}, []), before
        (tmp_path / "r.toml").write_text(before.text())
        assert not await compare(cell.session, drive, file, load(file))
        planted.begun = question.shows != BYTES or family == "tmcl"
        with contextlib.nullcontext() if planted.begun else other_bytes(question):
            assert await compare(cell.session, drive, file, load(file))
        assert cell.printed()[-1].startswith(f"{question.name}: here ")


def test_every_trait_that_a_question_needs_is_one_of_the_planted_drives_or_of_a_party_line():
    asked_of = {question for _, question in PLANTS} | {*rows("modbus", "closed"), *rows("mcode", "lexium", "party")}
    for family in FAMILIES:
        table = table_of(family)
        assert [each.name for each in table if each not in asked_of] == [], family


MODBUS = '[[bus]]\nname = "w"\nserve = ["modbus://127.0.0.1:0"]\n[[bus.drive]]\npersonality = "LMDCE"\n'


@pytest.mark.parametrize("question", rows("modbus", "closed"), ids=lambda each: each.name)
async def test_a_planted_deviation_is_found_over_modbus(tmp_path, question):
    async with AsyncExitStack() as stack:
        floor = RunningFloor(Floor(read(MODBUS, "cell")))
        stack.callback(floor.close)
        [served] = await serve_bus(floor, floor.floor.cell.buses[0], stack)
        session = Session(Settings({}, tmp_path / "config", tmp_path / "state", data=tmp_path / "data"))
        stack.push_async_callback(session.close)
        await session.open(served.endpoint, "w")
        sent, answer = [], ModbusPort._answer

        def planted(port, pdu, now):
            sent.append(pdu)
            return bytes((pdu[0] | 0x80, 2)) if sent[:-1].count(pdu) and pdu == last else answer(port, pdu, now)

        last = b""
        stack.enter_context(mock.patch.object(ModbusPort, "_answer", planted))
        before = Asking(session, session.drive("w"))
        await before.all({question.name: None})
        last = sent[-1]
        after = Asking(session, session.drive("w"))
        await after.all({question.name: None})
        assert (before.report.unlike, after.report.unlike) == ([], [question.name])


@pytest.mark.virtual
@pytest.mark.parametrize("family", DRIVES)
async def test_a_drive_is_as_it_was_and_it_takes_less_than_three_minutes(tmp_path, family):
    async with CellSession(tmp_path, DRIVES[family]) as cell:
        drive = cell.session.drive("w")

        async def settings():
            found = await drive.run(drive.family.values.parameters.read(lambda done, total: None))
            return {each.name: each.value for each in found.readings}

        before, began = await settings(), cell.session.now()
        report = await asked(cell)
        assert (report.unasked, report.unlike) == ({}, []) and len(report.answers) >= 13
        assert cell.session.now() - began < 90
        assert await settings() == before and drive.state.restore is None


@pytest.mark.virtual
@on(bus("w", drive("LMDCM", "", ROUTINE)))
async def test_beside_a_stored_program_nothing_is_asked_that_may_raise_an_error(cell):
    device, done = cell.device("w:!"), []
    real = device.execute
    device.execute = lambda text, now, **more: done.append(text) or real(text, now, **more)
    report = await asked(cell)
    table = {each.name: each.does for each in cell.session.drive("w").family.certifying.table()}
    assert {table[name] for name in report.answers} == {NOTHING, MODE}
    assert {table[name] for name in report.unasked} == {ERROR, MOVES}
    assert all(why.startswith("a program is stored (3 lines)") for why in report.unasked.values())
    assert not device.memory.error_flag and device.position(cell.floor.now()) == 0
    assert not any(line.startswith(("ZZ9", "R1=", "PR ER", "MA")) for line in done)


@pytest.mark.virtual
@on(bus("w", drive("LMDCM", "", 'program_text = """\nPG 1\nLB Ga\nH 50\nBR Ga\nE\nPG\n"""')))
async def test_while_a_program_runs_only_what_changes_nothing_is_asked(cell):
    await cell.session.run("EX Ga")
    report = await asked(cell)
    assert len(report.answers) == 5 and set(report.unasked.values()) == {"its program ran"}


@pytest.mark.virtual
@on(DRIVES["lexium"])
async def test_an_error_that_stands_is_left_there(cell, tmp_path):
    cell.device("w:!").fail(33, cell.floor.now())
    with pytest.raises(Refused, match=r"has an error \(EF=1\) that the questions would clear"):
        await certify(cell.session, cell.session.drive("w"), str(tmp_path / "r.toml"))
    assert cell.device("w:!").memory.error_flag and not (tmp_path / "r.toml").exists()


@pytest.mark.virtual
@on(bus("w", drive("LMDCM", LK=1)))
async def test_a_locked_drive_is_not_listed(cell):
    report = await asked(cell)
    assert all("locked (LK=1)" in why for why in report.unasked.values()) and report.unasked
    assert not cell.device("w:!").memory.error_flag


@pytest.mark.virtual
@on(DRIVES["lexium"])
async def test_nothing_moves_without_a_yes(cell):
    cell.session.questions.agreed = False
    device, asks = cell.device("w:!"), []
    moving = ("new-target", "move-while-stopping", "settling")
    report = await asked(cell, "bits", *moving)
    assert {*moving} == {*report.unasked} and {*report.answers} == {"bits"}

    async def no(question):
        asks.append(question)
        return False

    cell.session.front = Front(no)
    assert {*(await asked(cell, *moving)).unasked} == {*moving} and "the motor moves by 400 steps at most" in asks[0]
    assert device.position(cell.floor.now()) == 0

    async def stop(question):
        cell.session.stop("Ctrl+X")
        await asyncio.sleep(1)

    cell.session.front = Front(stop)
    with pytest.raises(Stopped):
        await asked(cell, *moving)
    cell.session.resume()

    async def yes(question):
        return True

    cell.session.front = Front(yes)
    assert not (await asked(cell, "settling")).unasked


@pytest.mark.virtual
@on(DRIVES["lexium"])
async def test_a_stop_in_a_move_stops_it_and_restores_what_the_question_changed(cell, tmp_path):
    session, device, file = cell.session, cell.device("w:!"), tmp_path / "r.toml"
    task = asyncio.ensure_future(session.tasks.run(certify(session, session.drive("w"), str(file))))
    while not device.moving(cell.floor.now()):
        await asyncio.sleep(0.01)
    session.stop("Ctrl+X")
    at = cell.floor.now()
    with pytest.raises(Stopped):
        await task
    assert not device.moving(at + 0.2)
    await asyncio.sleep(2)
    session.resume()
    assert not cell.moving()
    for word, value in (("VI", 1000), ("VM", 768000), ("A", 1000000), ("D", 1000000), ("EM", 0)):
        await session.run(f"PR {word}")
        assert cell.printed()[-1] == str(value)
    assert "the questions ended before it" in file.read_text() and load(str(file)).answers["precedence"] == ["ok", "20"]


@pytest.mark.virtual
@on(DRIVES["lexium"])
async def test_what_a_question_changes_is_owed_before_its_first_line(cell):
    drive, seen = cell.session.drive("w"), []
    real = cell.device("w:!").execute

    def execute(text, now, **more):
        if text.startswith(("CK=1", "PY=1", "EM=3", "VM=")):
            seen.append((text.rstrip("\x80"), drive.state.restore.lines))
        return real(text, now, **more)

    cell.device("w:!").execute = execute
    await asked(cell, "checksum-echo", "party", "echo-late")
    assert ("EM=3", "EM=0\nCK=0") in seen and ("PY=1", "PY=0") in seen and ("CK=1", "CK=0\nEM=0") in seen


@pytest.mark.virtual
@on(DRIVES["lexium"])
async def test_a_lost_line_ends_with_what_is_known(cell, tmp_path):
    device, session, file = cell.device("w:!"), cell.session, tmp_path / "r.toml"
    real = device.execute

    def execute(text, now, **more):
        if text.startswith("R1=25"):
            cell.world("unplug w")
        return real(text, now, **more)

    device.execute = execute
    with pytest.raises(TransportLost):
        await certify(session, session.drive("w"), str(file))
    found = load(str(file)).answers
    assert found["overflow"] and "bits" not in found
    assert any("R1=0: not restored; the next session" in text for text in cell.warned())


@pytest.mark.virtual
@on(DRIVES["lexium"])
async def test_a_drive_that_falls_silent_ends_the_questions(cell):
    device, real = cell.device("w:!"), cell.device("w:!").execute

    def execute(text, now, **more):
        if text.startswith("ZZ9"):
            asyncio.get_running_loop().call_later(0.5, cell.world, "power ! off")
        return real(text, now, **more)

    device.execute = execute
    asking = Asking(cell.session, cell.session.drive("w"))
    with pytest.raises(NoAnswer):
        await asking.all()
    assert asking.report.answers["unknown-word"] == ["error 60"] and len(asking.report.unasked) > 20


@pytest.mark.virtual
@on(bus("w", party("a"), party("b", CK=0), baud=0))
async def test_a_report_has_no_serial_number_and_no_name_and_is_compared(cell, tmp_path):
    session, file = cell.session, str(tmp_path / "r.toml")
    await certify(session, session.drive("w", "a"), file)
    text = (tmp_path / "r.toml").read_text()
    assert session.drive("w", "a").state.serial and session.drive("w", "a").state.serial not in text
    assert not any(name in text for name in ('"a"', str(tmp_path), "cell"))
    few = load(file)
    few.answers = {name: few.answers[name] for name in ("echo-full", "checksum-echo", "division")}
    (tmp_path / "r.toml").write_text(few.text())
    assert await compare(session, session.drive("w", "b"), file, load(file)) is False
    (tmp_path / "r.toml").write_text(few.text().replace('division = ["ok", "-3"]', 'division = ["ok", "-4"]'))
    assert await compare(session, session.drive("w", "b"), file, load(file)) is True
    assert cell.printed()[-1] == f"division: here ok // -3; in {file} ok // -4"


@pytest.mark.virtual
@on(DRIVES["lexium"])
async def test_a_guarded_line_is_no_question_and_what_is_owed_from_before_is_not_forgotten(cell):
    session = cell.session
    session.settings = replace(session.settings, guards=Guarding(also=frozenset({"R1"})))
    report = await asked(cell, "bits", "inverted", "unknown-word")
    assert {*report.answers} == {"unknown-word"} and all(
        "[guards] also has R1" in why for why in report.unasked.values()
    )
    session.drive("w").state.owes(before := owed(session.drive("w").state, ["EM=1"]))
    with pytest.raises(Refused, match="still owed other settings"):
        await asked(cell, "echo-late")
    assert session.drive("w").state.restore is before


@pytest.mark.virtual
@on(bus("w", party("a")))
async def test_a_drive_that_was_not_found_is_not_asked(cell):
    with pytest.raises(NoAnswer, match="z was not found on this line"):
        Asking(cell.session, cell.session.drive("w", "z"))


@pytest.mark.virtual
@on(DRIVES["pmx"])
async def test_a_report_of_another_family_is_refused_and_a_question_that_is_gone_counts(cell, tmp_path):
    file = tmp_path / "r.toml"
    file.write_text('[drive]\nfamily = "mcode"\nproduct = "LMDCM"\n[answers]\nbits = ["ok"]\n')
    with pytest.raises(Diagnostic, match="has answers of the family mcode"):
        await compare(cell.session, cell.session.drive("w"), str(file), load(str(file)))
    file.write_text('[drive]\nfamily = "pmx"\nproduct = "PMX-2ED-SA"\n[answers]\ngone = ["ok"]\n')
    assert await compare(cell.session, cell.session.drive("w"), str(file), load(str(file))) is True
    assert cell.printed() == ["gone: not compared: no question to PMX-2ED-SA"]


@pytest.mark.parametrize(
    "text", ["", "[drive]\n", '[drive]\nfamily = 1\n[answers]\na = ["ok"]\n', '[drive]\nfamily = "pmx"\n[answers]\n']
)
def test_another_file_is_no_report(tmp_path, text):
    (tmp_path / "r.toml").write_text(text)
    with pytest.raises(Diagnostic, match="is not a report"):
        load(str(tmp_path / "r.toml"))


def test_answers_are_lists_of_texts(tmp_path):
    (tmp_path / "r.toml").write_text('[drive]\nfamily = "pmx"\nproduct = "x"\n[answers]\na = ' + json.dumps("ok"))
    with pytest.raises(Diagnostic, match="must be a list of texts"):
        load(str(tmp_path / "r.toml"))


REPORT = """[drive]
family = "mcode"
product = "LMDCM"
version = "LMDCM 6.002"
[answers]
bits = ["ok", "3"]
[other_than_ruled]
questions = ["bits"]
[not_asked]
"no reason" = ["gone"]
"""


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ('version = "LMDCM 6.002"', "version = 6.002", r"[drive] version: must be a text"),
        ('version = "LMDCM 6.002"', 'version = ""', r"[drive] version: must be a text"),
        ('product = "LMDCM"\n', "", r"[drive] product: is missing"),
        ('product = "LMDCM"', 'product = ["LMDCM"]', r"[drive] product: must be a text"),
        ('product = "LMDCM"', 'prodcut = "LMDCM"', r"[drive]: no key prodcut; valid: family, product, version"),
        ('bits = ["ok", "3"]', 'bits = ["ok", 3]', r"[answers] bits: must be a list of texts"),
        ('bits = ["ok", "3"]', "bits = []", r"[answers] bits: must be a list of texts"),
        ('questions = ["bits"]', 'questions = ["gone"]', r"names gone, which has no answer"),
        ('questions = ["bits"]', 'questions = "bits"', r"questions: must be a list of texts"),
        ('"no reason" = ["gone"]', '"no reason" = 3', r"[not_asked] no reason: must be a list of texts"),
        ("[not_asked]", "[not asked]", "Expected"),
        ("[not_asked]", "[unasked]", r"no key unasked; valid: drive, answers, other_than_ruled, not_asked"),
    ],
)
def test_a_report_with_a_wrong_value_is_refused_and_its_place_is_named(tmp_path, before, after, told):
    file = tmp_path / "r.toml"
    file.write_text(REPORT)
    assert load(str(file)).unlike == ["bits"]
    assert before in REPORT
    file.write_text(REPORT.replace(before, after))
    with pytest.raises(Diagnostic) as caught:
        load(str(file))
    assert told in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.virtual
@on(DRIVES["lexium"])
async def test_a_report_with_other_than_one_answer_for_each_line_is_refused_before_anything_is_sent(cell, tmp_path):
    file = tmp_path / "r.toml"
    lines = next(each.lines for each in table_of("mcode") if each.name == "division")
    for answers in (["ok"] * (len(lines) - 1), ["ok"] * (len(lines) + 1)):
        file.write_text(
            REPORT.replace('bits = ["ok", "3"]', f"bits = {json.dumps(answers)}").replace("bits", "division")
        )
        sent = cell.written("w")
        with pytest.raises(
            Diagnostic, match=rf"division: has {len(answers)} texts?, and the question has {len(lines)}"
        ):
            await compare(cell.session, cell.session.drive("w"), str(file), load(str(file)))
        assert cell.written("w") == sent
