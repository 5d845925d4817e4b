"""The search for TMCL modules: by name, after a question, address 1 first; a stop goes to every address asked."""

import asyncio

import pytest

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.families.tmcl.host.codec import frame_of
from multidrop.families.tmcl.manual.commands import TmclCall
from multidrop.shell.connect.urls import parse
from multidrop.shell.finding.rescuing import Rescue
from multidrop.shell.finding.scanning import NothingFound, Scanning, url_of
from tests.support.cell_session import CellSession, bus, drive
from tests.support.tuned_ports import Port

pytestmark = [pytest.mark.virtual, pytest.mark.slow]

HAZARD = (
    "a frame may hold bytes that MCode drives on the line obey: the addresses 3, 10, 13 and 27, and other bytes of a "
    "frame, are ^C, LF, CR and ESC to them"
)
IDENTITY, MST = TmclCall(136, 1), TmclCall(3)
LINE = ("1", "3", "27", "200")


def line(*names, **keys):
    return bus("b", *(drive("TMCM-3110" if name == "3" else "TMCM", name) for name in names), **keys)


def scanning(port, url="/dev/ttyUSB9?dialect=tmcl", agreed=True):
    port.session.questions.agreed = agreed
    found = []
    return found, Scanning(port.session, port.opener, parse(url), lambda drive: found.append(drive.facts()))


def asked(port, call=IDENTITY):
    """The addresses to which a frame was written, in order."""
    written = b"".join(pipe.written for pipe in port.pipes)
    frames = [written[at : at + 9] for at in range(0, len(written), 9)]
    return [frame[0] for frame in frames if frame == frame_of(frame[0] or 1, call)]


async def test_without_an_agreement_nothing_is_sent_and_the_question_names_hazard_and_time(tmp_path):
    port = Port(tmp_path, line("1"))
    _, search = scanning(port, agreed=False)
    with pytest.raises(Diagnostic) as refused:
        await search.run([9600], False)
    asks = "the search with TMCL at 9600 baud asks address 1 only (--all: each address), about 2 s"
    assert f"{asks}; {HAZARD}; nothing was sent" in str(refused.value) and "--yes" in str(refused.value)
    with pytest.raises(Diagnostic, match="asks addresses 1 to 255, about 40 s"):
        await search.run([9600], True)
    assert port.opened == []


@pytest.mark.parametrize(("answer", "opened"), [(True, [("tmcl", 9600)]), (False, [])])
async def test_a_person_is_asked_first(tmp_path, answer, opened):
    questions = []

    async def ask(question):
        questions.append((question, list(port.opened)))
        return answer

    port = Port(tmp_path, line("1"))
    port.session.front.ask = ask
    found, search = scanning(port, agreed=False)
    if answer:
        await search.run([], False)
        assert asked(port)[:1] == [1] and set(asked(port)) == {1}
    else:
        with pytest.raises(Diagnostic, match="the answer was no"):
            await search.run([], False)
    assert (port.opened, len(found)) == (opened, len(opened))
    [(question, before)] = questions
    assert HAZARD in question and before == []


async def test_a_search_that_names_no_language_sends_no_frame(tmp_path):
    port = Port(tmp_path, line("1"))
    _, search = scanning(port, "/dev/ttyUSB9")
    with pytest.raises(NothingFound):
        await search.run([], True)
    assert {family for family, _ in port.opened} == {"mcode", "pmx"}


async def test_every_module_is_found_in_the_time_that_was_named_and_none_moves(tmp_path):
    port = Port(tmp_path, line(*LINE))
    found, search = scanning(port)
    begun = asyncio.get_running_loop().time()
    await search.run([9600], True)
    assert asyncio.get_running_loop().time() - begun < 20
    assert [(each["address"], each["product"]) for each in found] == [
        (name, "TMCM-3110" if name == "3" else "TMCM-1241") for name in LINE
    ]
    assert url_of(search.found) == "serial:/dev/ttyUSB9?baud=9600&dialect=tmcl&drives=1,3,27,200"
    assert list(dict.fromkeys(asked(port))) == list(range(1, 256))
    assert not any(device.program.memory for device in port.devices)
    assert port.told() == []


@pytest.mark.parametrize("pause", [20, 60, 150, 255])
async def test_a_module_that_replies_late_is_found(tmp_path, pause):
    port = Port(tmp_path, bus("b", drive("TMCM", "40", G75=pause), drive("TMCM", "255", G75=pause)))
    found, search = scanning(port)
    await search.run([9600], True)
    assert [each["address"] for each in found] == ["40", "255"]


async def test_a_module_that_replies_to_every_address_is_one_module(tmp_path):
    port = Port(tmp_path, bus("b", drive("TMCM-1276", "7", "any_address = true")))
    found, search = scanning(port)
    await search.run([9600], True)
    assert [each["address"] for each in found] == ["7"] and found[0]["url"].endswith("dialect=tmcl&drives=7")
    [text] = [text for text in port.told() if "module 7" in text]
    assert "module 7 replied to address 1: it replies to every address, or another host asks it" in text


async def test_what_cannot_be_read_is_said_once_for_all_addresses(tmp_path):
    port = Port(tmp_path, bus("b", *(drive("TMCM", name, "any_address = true") for name in ("6", "9"))))
    _, search = scanning(port)
    with pytest.raises(NothingFound):
        await search.run([9600], False)
    assert [text for text in port.told() if "several may reply at once" in text] == [
        "/dev/ttyUSB9: TMCL at 9600 baud: what came at 1 is no module's reply: several may reply at once, "
        "or drives of another kind"
    ]


async def test_half_a_message_of_another_host_hides_no_module(tmp_path):
    port = Port(tmp_path, line(*LINE))
    port.floor.floor.wires["b"].receive(frame_of(1, TmclCall(1, 0, 0, 500))[:5], 0.0)
    found, search = scanning(port)
    await search.run([9600], True)
    assert [each["address"] for each in found] == list(LINE)


async def test_an_adapter_that_repeats_what_it_sends_is_noticed(tmp_path):
    port = Port(tmp_path, line(*LINE), repeats=True)
    found, search = scanning(port)
    await search.run([9600], True)
    assert [each["address"] for each in found] == list(LINE) and found[0]["url"].endswith("echo=local")


async def test_other_baud_rates_come_after_a_question_of_their_own(tmp_path):
    port = Port(tmp_path, line("1", baud=57600))
    questions = []

    async def ask(question):
        questions.append(question)
        return True

    port.session.front.ask = ask
    found, search = scanning(port, agreed=False)
    await search.run([], False)
    assert [(each["baud"], each["address"]) for each in found] == [(57600, "1")]
    assert len(questions) == 2 and "goes on with TMCL at 19200, 38400, 57600, 115200 baud" in questions[1]


async def test_nothing_found_says_what_was_asked_and_offers_no_rescue(tmp_path):
    port = Port(tmp_path, line("5"))
    _, search = scanning(port)
    with pytest.raises(NothingFound, match=r"\(TMCL at 9600 baud; address 1 only \(--all: each address\)\)") as failure:
        await search.run([9600], False)
    assert "rescue" not in str(failure.value)


async def test_a_rescue_refuses_it_and_sends_nothing(tmp_path):
    port = Port(tmp_path, line("1"))
    _, search = scanning(port)
    with pytest.raises(Diagnostic, match="freed by a pause"):
        await Rescue(port.session, search).run([], everything=True, erase=True)
    assert port.opened == []


async def test_the_verb_refuses_an_open_line(tmp_path):
    async with CellSession(tmp_path, line("1")) as cell:
        with pytest.raises(Diagnostic, match="cannot be searched for"):
            await cell.session.run("/scan")


# A stop meanwhile


async def stopped_after(port, search, address):
    """Search, stop once this address was asked, and return when it was."""
    running = asyncio.create_task(port.session.tasks.run(search.run([9600], True)))
    while address not in asked(port):
        await asyncio.sleep(0.01)
    for device in port.devices:
        for motor in device.motors:
            motor.rotate(500, port.floor.now())
    at = port.floor.now()
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    return at


def at_rest(port):
    return [all(not motor.moving(port.floor.now()) for motor in device.motors) for device in port.devices]


async def test_a_stop_reaches_each_motor_of_what_replied_and_every_address_that_was_asked(tmp_path):
    port = Port(tmp_path, line(*LINE))
    found, search = scanning(port)
    at = await stopped_after(port, search, 60)
    took = port.floor.now() - at
    assert [each["address"] for each in found] == ["1", "3", "27"]
    assert set(range(1, 61)) <= set(asked(port, MST)) and 200 not in asked(port, MST)
    assert at_rest(port) == [True, True, True, False]
    assert took < 2 + 61 * 2 * 0.06 + 6
    [text] = [text for text in port.told() if "the stop was sent with" in text]
    assert "sent with TMCL at 9600 baud" in text and "; velocity 0 was read from all 3. It was not confirmed" in text
    assert port.session.buses == {}


async def test_a_stop_of_what_replied_takes_no_longer_than_its_frames_whatever_was_asked(tmp_path):
    port = Port(tmp_path, line(*LINE))
    _, search = scanning(port)
    running = asyncio.create_task(stopped_after(port, search, 250))
    while not port.session.stops:
        await asyncio.sleep(0.01)
    at = port.floor.now()
    while not all(at_rest(port)):
        await asyncio.sleep(0.01)
    assert port.floor.now() - at < 1.5
    await running
    assert port.floor.now() - at < 30


async def test_a_module_that_replies_to_the_stop_only_gets_the_whole_stop_and_is_read(tmp_path):
    port = Port(tmp_path, line("1", "3"))
    found, search = scanning(port)
    second = port.devices[1]
    second.power(False, 0.0)  # it is silent as it is asked, and awake as the stop comes
    running = asyncio.create_task(port.session.tasks.run(search.run([9600], True)))
    while 9 not in asked(port):
        await asyncio.sleep(0.01)
    second.power(True, port.floor.now())
    second.motors[2].rotate(500, port.floor.now())
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    assert [each["address"] for each in found] == ["1"] and at_rest(port) == [True, True]
    [text] = [text for text in port.told() if "the stop was sent with" in text]
    assert "; velocity 0 was read from both. It was not confirmed" in text


async def test_a_second_stop_key_does_not_end_the_first_stop(tmp_path):
    port = Port(tmp_path, line(*LINE))
    _, search = scanning(port)
    running = asyncio.create_task(stopped_after(port, search, 40))
    while not port.session.stops:
        await asyncio.sleep(0.01)
    for _ in range(4):
        await asyncio.sleep(0.3)
        port.session.stop("Ctrl+X")
    await running
    assert set(range(1, 41)) <= set(asked(port, MST)) and at_rest(port)[:3] == [True] * 3


async def test_a_module_that_stores_the_stop_is_taken_out_of_download_mode(tmp_path):
    port = Port(tmp_path, line("1", "3"))
    _, search = scanning(port)
    running = asyncio.create_task(stopped_after(port, search, 20))
    while 10 not in asked(port):
        await asyncio.sleep(0.01)
    for device in port.devices:
        device.program.download(0)
    await running
    assert at_rest(port) == [True, True] and not any(device.program.storing for device in port.devices)


@pytest.mark.parametrize("at", [100, 900, 1500])
async def test_a_byte_that_is_lost_on_the_way_hides_no_module(tmp_path, at):
    port = Port(tmp_path, line(*LINE))
    found, search = scanning(port)
    written = Port.opener

    async def opener(connection, naming):
        opened = await written(port, connection, naming)
        [pipe], write, sent = port.pipes, port.pipes[0].write, []

        def losing(data):
            before = sum(map(len, sent))
            sent.append(data)
            return write(data[1:] if before <= at < before + len(data) else data)

        pipe.write = losing
        return opened

    search = Scanning(port.session, opener, parse("/dev/ttyUSB9?dialect=tmcl"), lambda drive: found.append(drive))
    await search.run([9600], True)
    assert [each.state.address for each in found] == list(LINE)


async def test_a_line_that_goes_on_losing_bytes_is_said(tmp_path):
    port = Port(tmp_path, f"seed = 3\n{line(*LINE)}[bus.faults]\ndrop = 0.01\n")
    _, search = scanning(port)
    await search.run([9600], True)
    assert any("the line loses bytes: modules at " in text and "may have been missed" in text for text in port.told())
