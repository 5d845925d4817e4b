"""The rescue of a drive: its steps, its questions, and what it leaves alone."""

import asyncio
from itertools import product

import pytest

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.shell.connect.urls import parse
from multidrop.shell.finding.rescuing import Rescue
from multidrop.shell.finding.scanning import NothingFound, Scanning
from tests.support.cell_session import bus, pmx
from tests.support.tuned_ports import Port

pytestmark = pytest.mark.virtual

BAUDS = (4800, 9600, 19200, 38400, 115200)
QUICK = [(0, 0, 0, "!", 9600), (2, 1, 1, "P", 115200), (3, 1, 2, "9", 4800), (1, 0, 1, "a", 19200)]
ALL = [each for each in product(range(4), (0, 1), range(3), "!P9", BAUDS) if each not in QUICK]


def drive(name="k", em=1, py=1, ck=0, more=""):
    party = "true" if py else "false"
    return f'personality = "LMDCM"\nname = "{name}"\nparty = {party}\nset = {{ EM = {em}, CK = {ck} }}\n{more}'


def rescue(port, url="/dev/ttyUSB9"):
    found = []
    scanning = Scanning(port.session, port.opener, parse(url), lambda each: found.append(each.facts()))
    return found, Rescue(port.session, scanning), scanning


@pytest.mark.parametrize(
    ("em", "py", "ck", "name", "baud"), [*QUICK, *(pytest.param(*each, marks=pytest.mark.nightly) for each in ALL)]
)
async def test_a_drive_in_any_mode_under_any_name_at_any_baud_rate_is_free(tmp_path, em, py, ck, name, baud):
    port = Port(tmp_path, bus("b", drive(name, em, py, ck), baud=baud))
    port.session.questions.agreed = True
    found, work, _ = rescue(port)
    await work.run([], everything=False, erase=False)
    assert [(each["baud"], each["address"], each["em"], each["party"], each["checksum"]) for each in found] == [
        (baud, name if py else "", em, bool(py), ck)
    ]
    [device] = port.devices
    assert (device.memory.echo_mode, device.memory.party, device.memory.checksum, device.memory.name) == (
        em,
        bool(py),
        ck,
        name,
    )


@pytest.mark.nightly
async def test_a_controller_of_the_other_family_is_found(tmp_path):
    port = Port(tmp_path, bus("b", pmx("42"), baud=38400))
    port.session.questions.agreed = True
    found, work, _ = rescue(port)
    await work.run([], everything=False, erase=False)
    assert [(each["dialect"], each["address"], each["baud"]) for each in found] == [("pmx", "42", 38400)]


async def test_nothing_that_may_do_harm_is_sent_before_a_yes(tmp_path):
    port = Port(tmp_path, bus("b", drive(em=2)))
    port.devices[0].execute("PG 1", 0.0)
    _, work, _ = rescue(port)
    with pytest.raises(Diagnostic, match=r"stops every drive.*error 20.*OE subroutine.*erases nothing.*--yes"):
        await work.run([], everything=False, erase=False)
    assert len(port.opened) == 1 and port.devices[0].programming is not None
    assert any(text.startswith("step 2: clear the line") for text in port.told())


@pytest.mark.slow
async def test_nothing_is_erased_without_a_word_for_it(tmp_path):
    port = Port(tmp_path, bus("b", drive(more='program_text = "PG 1\\nLB G1\\nE\\nPG"')))
    port.devices[0].power(False, 0.0)
    port.session.questions.agreed = True
    _, work, _ = rescue(port)
    with pytest.raises(NothingFound, match="no drive replies on /dev/ttyUSB9"):
        await work.run([9600], everything=False, erase=False)
    assert any("--erase" in text for text in port.told())


async def test_factory_defaults_come_last_and_after_a_question_of_their_own(tmp_path):
    port = Port(tmp_path, bus("b"))
    questions = []

    async def ask(question):
        questions.append(question)
        return "erases their programs" not in question and "listen" not in question

    port.session.front.ask = ask
    _, work, _ = rescue(port, "/dev/ttyUSB9?dialect=mcode")
    with pytest.raises(Diagnostic, match="the answer was no"):
        await work.run([9600], everything=False, erase=False)
    assert len(questions) == 3 and "erases their programs" in questions[-1]


async def test_a_power_cycle_is_listened_to_and_nothing_is_sent_meanwhile(tmp_path):
    port = Port(tmp_path, bus("b", drive("a", em=0, py=0)))
    [device] = port.devices
    device.power(False, 0.0)

    async def switched_on():
        await asyncio.sleep(5.0)
        device.power(True, port.floor.now())
        port.floor.floor.wires["b"].look_again()
        port.floor.write("b", b"")

    async def ask(question):
        if "listen" in question:
            before.append(len(port.pipes))
            switching.append(asyncio.ensure_future(switched_on()))
        return True

    switching, before = [], []
    port.session.front.ask = ask
    found, work, _ = rescue(port, "/dev/ttyUSB9?dialect=mcode")
    await work.run([9600], everything=False, erase=False)
    assert [each["name"] for each in found] == ["a"]
    assert port.pipes[before[0]].written == b"" and port.pipes[before[0] + 1].written != b""
    assert any("a sign-on with MCode at 9600 baud" in text for text in port.told())


async def test_plain_sets_the_modes_after_a_question(tmp_path):
    port = Port(tmp_path, bus("b", drive("k", em=2, py=1, ck=1)))
    _, work, scanning = rescue(port)
    await work.run([], everything=False, erase=False)
    with pytest.raises(Diagnostic, match="EM=0, CK=0, PY=0 is set in k"):
        await work.make_plain(scanning.found[0])
    port.session.questions.agreed = True
    await work.make_plain(scanning.found[0])
    [device] = port.devices
    assert (device.memory.echo_mode, device.memory.party, device.memory.checksum) == (0, False, 0)
    assert scanning.found[0].url == "serial:/dev/ttyUSB9?baud=9600&party=0"


async def test_a_stop_ends_a_rescue(tmp_path):
    port = Port(tmp_path, bus("b"))
    port.session.questions.agreed = True
    _, work, _ = rescue(port)
    running = asyncio.create_task(port.session.tasks.run(work.run([], everything=False, erase=True)))
    await asyncio.sleep(6.0)
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    assert port.session.buses == {} and not any(text.endswith("factory defaults") for text in port.told())


@pytest.mark.slow
async def test_a_stop_while_it_listens_reaches_every_rate_that_was_agreed_to(tmp_path):
    port = Port(tmp_path, bus("b", drive("a", em=0, py=0)))
    device = port.devices[0]
    device.power(False, 0.0)
    listens = asyncio.Event()

    async def ask(question):
        if "listen" in question:
            listens.set()
        return True

    port.session.front.ask = ask
    _, work, _ = rescue(port, "/dev/ttyUSB9?dialect=mcode")
    running = asyncio.create_task(port.session.tasks.run(work.run([], everything=False, erase=False)))
    await listens.wait()
    await asyncio.sleep(1.0)
    before = len(port.opened)
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    assert {baud for _, baud in port.opened[before:]} == set(BAUDS) - {9600}  # it listens with that one
    assert any("the stop was sent with MCode at" in text for text in port.told())
