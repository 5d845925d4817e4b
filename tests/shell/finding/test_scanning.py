"""The search of a port: the order of languages and baud rates, the question before the others, and what is reported."""

import asyncio

import pytest

from multidrop.base.errors import Diagnostic, NoAnswer, Stopped, TransportLost
from multidrop.dialects.state import Remembered
from multidrop.shell.configuration import Settings
from multidrop.shell.connect import opening
from multidrop.shell.connect.urls import parse
from multidrop.shell.events import Notified
from multidrop.shell.finding.scanning import NothingFound, Scanning, url_of
from multidrop.shell.session import Session
from multidrop.shell.state.port_state import PortState
from tests.support.cell_session import CellSession, bus, drive, party, pmx
from tests.support.talker import Talker
from tests.support.tuned_ports import Port, lead_to

pytestmark = pytest.mark.virtual

MOVES = 'program_text = """PG 1\nLB Q1\nMR 5000\nRT\nE\nPG\nOE Q1\n"""'


def scanning(port, url="/dev/ttyUSB9"):
    found = []
    return found, Scanning(port.session, port.opener, parse(url), lambda drive: found.append(drive.facts()))


async def test_the_search_ends_at_the_first_answer_and_lists_every_drive_of_that_line(tmp_path):
    port = Port(tmp_path, bus("b", party("a", CK=0), party("k", EM=2)))
    found, search = scanning(port)
    await search.run([], False)
    assert port.opened == [("mcode", 9600)]
    assert [each["address"] for each in found] == ["a", "k"]
    expected = {"port": "/dev/ttyUSB9", "baud": 9600, "product": "LMDCM", "party": True, "checksum": 0, "em": 1}
    assert expected.items() <= found[0].items()
    assert {"version", "serial", "part", "name"} <= found[0].keys()
    assert url_of(search.found) == "serial:/dev/ttyUSB9?baud=9600&party=1&drives=a,k"
    assert port.session.buses == {}


async def test_before_another_baud_rate_a_person_is_asked_and_told_why(tmp_path):
    port = Port(tmp_path, bus("b", party("a"), baud=19200))
    found, search = scanning(port)
    with pytest.raises(Diagnostic, match=r"no drive replies with MCode at 9600 baud.*OE subroutine.*--yes"):
        await search.run([], False)
    assert port.opened == [("mcode", 9600)] and found == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "baud", [115200, *(pytest.param(baud, marks=pytest.mark.nightly) for baud in (4800, 19200, 38400))]
)
async def test_a_drive_at_any_baud_rate_is_found_after_a_yes(tmp_path, baud):
    port = Port(tmp_path, bus("b", party("a"), baud=baud))
    port.session.questions.agreed = True
    found, search = scanning(port)
    await search.run([], False)
    assert [(each["baud"], each["address"]) for each in found] == [(baud, "a")]
    assert port.opened[0] == ("mcode", 9600) and port.opened[-1] == ("mcode", baud)


@pytest.mark.slow
async def test_a_controller_of_the_other_family_is_found_last(tmp_path):
    port = Port(tmp_path, bus("b", pmx("07"), baud=19200))
    port.session.questions.agreed = True
    found, search = scanning(port)
    await search.run([], False)
    assert [(each["dialect"], each["address"], each["em"]) for each in found] == [("pmx", "07", None)]
    assert {family for family, _ in port.opened} == {"mcode", "pmx"}
    assert found[0]["url"] == "serial:/dev/ttyUSB9?baud=19200&dialect=pmx&drives=07"


async def test_only_what_is_given_is_searched_without_a_question(tmp_path):
    port = Port(tmp_path, bus("b", pmx("07"), baud=19200))
    found, search = scanning(port, "/dev/ttyUSB9?dialect=pmx")
    await search.run([19200], False)
    assert port.opened == [("pmx", 19200)] and len(found) == 1


async def test_nothing_found_names_what_was_tried(tmp_path):
    port = Port(tmp_path, bus("b"))
    _, search = scanning(port, "/dev/ttyUSB9?dialect=mcode")
    with pytest.raises(NothingFound, match=r"no drive replies on /dev/ttyUSB9 \(MCode at 4800 baud"):
        await search.run([4800], False)


async def test_a_no_to_the_rest_keeps_what_was_found(tmp_path):
    async def no(question):
        return False

    port = Port(tmp_path, bus("b", party("a")))
    port.session.front.ask = no
    found, search = scanning(port)
    await search.run([], True)
    assert len(found) == 1 and port.opened == [("mcode", 9600)]


@pytest.mark.slow
async def test_all_goes_on_and_takes_no_longer_than_its_bound(tmp_path):
    port = Port(tmp_path, bus("b"))
    port.session.questions.agreed = True
    _, search = scanning(port)
    begun = asyncio.get_running_loop().time()
    with pytest.raises(NothingFound):
        await search.run([], True)
    mcode = sum(63 * 2 * (8 * 10 / baud + 0.02) for baud in (4800, 9600, 19200, 38400, 115200))
    pmx_ = sum(100 * (6 * 10 / baud + 0.02) for baud in (9600, 19200, 38400, 57600, 115200))
    assert asyncio.get_running_loop().time() - begun < 1.15 * (mcode + pmx_)
    assert len(port.opened) == 10
    assert port.progress[-1].over and any(each.left for each in port.progress)


async def test_an_adapter_that_repeats_what_it_sends_is_noticed(tmp_path):
    port = Port(tmp_path, bus("b", party("a", EM=0), party("k", EM=1)), repeats=True)
    found, search = scanning(port)
    await search.run([], False)
    assert [each["address"] for each in found] == ["a", "k"]
    assert found[0]["url"].endswith("&echo=local")
    assert any("echo=local" in text for text in port.told())


async def test_an_adapter_that_repeats_is_noticed_by_a_drive_that_does_not(tmp_path):
    port = Port(tmp_path, bus("b", 'personality = "LMDCM"\nset = { EM = 1 }'), repeats=True)
    found, search = scanning(port)
    await search.run([], False)
    assert [(each["address"], each["em"]) for each in found] == [("", 1)] and found[0]["url"].endswith("echo=local")


async def test_a_search_for_controllers_takes_no_longer_behind_an_adapter_that_repeats(tmp_path):
    times, told = [], []
    for repeats in (False, True):
        port = Port(tmp_path, bus("b", pmx("07"), pmx("31")), repeats=repeats)
        found, search = scanning(port, "/dev/ttyUSB9?dialect=pmx")
        begun = asyncio.get_running_loop().time()
        await search.run([9600], False)
        times.append(asyncio.get_running_loop().time() - begun)
        told.append([text for text in port.told() if "repeats" in text or "no controller's reply" in text])
        assert [each["address"] for each in found] == ["07", "31"]
        assert found[0]["url"].endswith("echo=local") is repeats
    assert times[1] < 1.1 * times[0]
    assert told == [[], ["/dev/ttyUSB9: the adapter repeats what it sends; the URLs that are found have echo=local"]]


async def test_a_stop_ends_the_search_and_keeps_what_was_found(tmp_path):
    port = Port(tmp_path, bus("b", party("a"), party("z")))
    found, search = scanning(port)
    running = asyncio.create_task(port.session.tasks.run(search.run([], False)))
    await asyncio.sleep(0.7)
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    assert [each["address"] for each in found] == ["a"] and port.session.buses == {}
    assert port.opened == [("mcode", 9600)] * 2  # once more with the drive that replied, which is read then
    [text] = [text for text in port.told() if "the stop was sent with" in text]
    assert "sent with MCode at 9600 baud; not with MCode at 4800, 19200, 38400, 115200 baud and PMX at 9600" in text
    assert "no search there was agreed to" in text


@pytest.mark.parametrize("escape", [2, 3])
@pytest.mark.parametrize("rate", [4800, 9600])
async def test_a_stop_reaches_a_drive_that_has_not_replied_and_needs_its_name_before_the_key(tmp_path, escape, rate):
    port = Port(tmp_path, bus("b", party("Z"), baud=rate))
    [device] = port.devices
    device.execute(f"ES={escape}", 0.0)
    device.execute("SL 5000", 0.0)
    _, search = scanning(port)
    [at, *_] = search.stages([rate])
    with pytest.raises(Stopped):
        async with search.stopping_all(), search.opened(search.connection(at)):
            assert device.moving(port.floor.now())
            port.session.stop("Ctrl+X")
            raise Stopped("Ctrl+X")
    await asyncio.sleep(1)
    assert not device.moving(port.floor.now())


async def test_a_stop_of_a_search_says_what_the_drives_that_replied_were_read_at(tmp_path):
    port = Port(tmp_path, bus("b", party("a"), party("z")))
    found, search = scanning(port)
    running = asyncio.create_task(port.session.tasks.run(search.run([], False)))
    await asyncio.sleep(0.7)
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    [text] = [text for text in port.told() if "the stop was sent with" in text]
    assert "; velocity 0 was read from a. It was not confirmed for drives that have not replied" in text


async def test_a_stop_with_no_drive_open_does_not_say_that_it_was_sent(tmp_path):
    port = Port(tmp_path, bus("b", party("a")))
    port.session.stop("Ctrl+X")
    assert port.told()[-1] == "Ctrl+X: no drive is open; macros and scripts wait for /resume"


async def test_no_drive_that_hears_its_own_language_and_baud_rate_moves(tmp_path):
    drives = [party(name, EM=em) + f"\n{MOVES}" for em, name in enumerate("PRa")]
    port = Port(tmp_path, bus("b", *drives))
    found, search = scanning(port)
    await search.run([], False)
    assert {each["address"] for each in found} == set("PRa")
    assert not any(device.position(port.floor.now()) or device.memory.error_flag for device in port.devices)


async def test_the_verb_lists_drives_that_an_open_line_did_not_know(tmp_path):
    async with CellSession(tmp_path, bus("b", party("a"), party("k"))) as cell:
        device = cell.device("b:k")
        device.execute('DN="z"', 0.0)
        await cell.session.run("/scan")
        assert cell.printed() == ["b: z LMDCM 6.002, Hw: 3.2"]
        await cell.session.run("@z PR DN")
        assert cell.printed()[-1] == '"z"'


@pytest.mark.parametrize(
    ("cell", "line", "why"),
    [
        (bus("b", 'personality = "LMDCM"'), "/scan", "takes no address"),
        (bus("b", party("a")), "@a PG 1", "in program mode"),
    ],
)
async def test_the_verb_refuses_a_line_on_which_a_search_would_do_harm(tmp_path, cell, line, why):
    async with CellSession(tmp_path, cell) as open_:
        if line != "/scan":
            await open_.session.run(line)
        with pytest.raises(Diagnostic, match=why):
            await open_.session.run("/scan")


ALL = [("mcode", baud) for baud in (9600, 4800, 19200, 38400, 115200)]
ALL += [("pmx", baud) for baud in (9600, 19200, 38400, 57600, 115200)]


async def stopped_at(port, search, opened):
    """Search all, stop at this opening, and return the openings after the stop."""
    port.session.questions.agreed = True
    running = asyncio.create_task(port.session.tasks.run(search.run([], True)))
    while len(port.opened) < opened:
        await asyncio.sleep(0.1)
    device = port.devices[0]
    device.execute("SL 5000", port.floor.now())
    assert device.moving(port.floor.now())
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    return port.opened[opened:]


@pytest.mark.slow
async def test_a_stop_is_sent_first_where_drives_may_be_then_as_far_as_was_agreed_then_again_where_they_may_be(
    tmp_path,
):
    port = Port(tmp_path, bus("b", f"{party('a')}\n{MOVES}"))
    _, search = scanning(port)
    after = await stopped_at(port, search, 3)  # with MCode at 19200 baud
    assert after == [ALL[0], ALL[1], *ALL[3:], *ALL[:3]]
    await asyncio.sleep(1)
    device = port.devices[0]
    assert not device.moving(port.floor.now()) and port.session.buses == {}
    [text] = [text for text in port.told() if "the stop was sent with" in text]
    assert "not with" not in text and all(str(baud) in text for _, baud in ALL)


async def test_a_stop_before_any_agreement_reaches_the_remembered_rate_and_no_other(tmp_path):
    port = Port(tmp_path, bus("b", party("a"), baud=19200))
    state = PortState(port.session.settings.state, "/dev/ttyUSB9", 19200)
    state.remember({"a": Remembered("a", "a", "LMDCM", "6.002", "", "", True, 0, 1)})
    state.close()
    _, search = scanning(port)
    running = asyncio.create_task(port.session.tasks.run(search.run([], False)))
    await asyncio.sleep(0.7)
    device = port.devices[0]
    device.execute("SL 5000", port.floor.now())
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    assert port.opened == [("mcode", 9600), ("mcode", 19200)]
    await asyncio.sleep(1)
    assert not device.moving(port.floor.now())


@pytest.mark.slow
async def test_a_stop_at_the_question_reaches_what_was_searched(tmp_path):
    port = Port(tmp_path, bus("b", party("a")))
    asked = asyncio.Event()

    async def ask(question):
        asked.set()
        await asyncio.sleep(1000)

    port.session.front.ask = ask
    _, search = scanning(port)
    running = asyncio.create_task(port.session.tasks.run(search.run([], True)))
    await asked.wait()
    device = port.devices[0]
    device.execute("SL 5000", port.floor.now())
    port.session.stop("Ctrl+X")
    with pytest.raises(Stopped):
        await running
    assert set(port.opened) == {("mcode", 9600)}
    await asyncio.sleep(1)
    assert not device.moving(port.floor.now())


@pytest.mark.slow
async def test_a_second_stop_key_does_not_end_the_first_stop(tmp_path):
    port = Port(tmp_path, bus("b", party("a")))
    _, search = scanning(port)
    port.session.questions.agreed = True
    running = asyncio.create_task(port.session.tasks.run(search.run([], True)))
    while len(port.opened) < 3:
        await asyncio.sleep(0.1)
    for _ in range(4):
        port.session.stop("Ctrl+X")
        await asyncio.sleep(0.1)
    with pytest.raises(Stopped):
        await running
    assert port.opened[3:] == [ALL[0], ALL[1], *ALL[3:], *ALL[:3]]


@pytest.mark.slow
async def test_a_rate_at_which_the_port_cannot_be_opened_is_named_and_the_others_get_the_stop(tmp_path):
    port = Port(tmp_path, bus("b", party("a")))
    opener = port.opener

    async def failing(connection, naming):
        if port.session.stops and connection.baud == 38400:
            raise TransportLost("busy")
        return await opener(connection, naming)

    search = Scanning(port.session, failing, parse("/dev/ttyUSB9?dialect=mcode"), lambda drive: None)
    assert await stopped_at(port, search, 2) == [ALL[0], ALL[2], ALL[4], *ALL[:2]]
    assert any("NO STOP SENT with MCode at 38400 baud: busy" in text for text in port.told())


TALKATIVE = bus("b", drive("TMCM", "1", "any_address = true"))
TMCL = "frames came as TMCL drives send them: dialect=tmcl opens such a line"


@pytest.mark.slow
@pytest.mark.parametrize(("family", "title"), [("mcode", "MCode"), ("pmx", "PMX")])
async def test_frames_of_nine_bytes_that_a_search_hears_are_named(family, title, tmp_path):
    port = Port(tmp_path, TALKATIVE)
    _, search = scanning(port, f"/dev/ttyUSB9?dialect={family}")
    with pytest.raises(NothingFound):
        await search.run([9600], False)
    assert any(text.endswith(f"{title} at 9600 baud: {TMCL}") for text in port.told())
    assert len(port.told()) < 10


@pytest.mark.slow
async def test_a_search_that_hears_frames_of_nine_bytes_goes_on_to_no_other_rate_or_language(tmp_path):
    port = Port(tmp_path, TALKATIVE)
    port.session.questions.agreed = True
    _, search = scanning(port)
    with pytest.raises(NothingFound, match=r"\(MCode at 9600 baud; "):
        await search.run([], True)
    assert port.opened == [("mcode", 9600)]


async def test_the_message_of_a_line_that_is_opened_in_mcode_names_tmcl(tmp_path):
    port = Port(tmp_path, TALKATIVE)
    (opened,) = await port.opener(parse("/dev/ttyUSB9"), str)
    port.session.adopt(opened, 0)
    with pytest.raises(NoAnswer, match=TMCL):
        await opened.bus.identify(opened.hints)
    await port.session.forget(opened.bus)


async def test_a_silent_line_is_not_taken_for_tmcl(tmp_path):
    port = Port(tmp_path, bus("b"))
    (opened,) = await port.opener(parse("/dev/ttyUSB9"), str)
    port.session.adopt(opened, 0)
    with pytest.raises(NoAnswer) as failure:
        await opened.bus.identify(opened.hints)
    assert "TMCL" not in str(failure.value)
    await port.session.forget(opened.bus)


@pytest.mark.slow
@pytest.mark.parametrize("family", ["pmx", "mcode", "tmcl"])
@pytest.mark.parametrize(("says", "every"), [(b"12345\r\n", 0.02), (b"\xf3\x80", 0.004), (b"OK\r", 0.05)])
async def test_a_search_among_endless_bytes_ends_and_says_what_came(tmp_path, monkeypatch, family, says, every):
    async def transport(connection, port="", within=None, baud=None):
        return Talker(says, every)

    lead_to(monkeypatch, transport)
    session = Session(Settings({}, tmp_path / "c", tmp_path / "s", data=tmp_path / "d"))
    session.questions.agreed = True
    said = []
    session.subscribe(lambda event: said.append(event.text), Notified)
    search = Scanning(session, opening.open_buses, parse(f"/dev/ttyUSB9?dialect={family}"), lambda drive: None)
    begun = session.now()
    with pytest.raises(NothingFound, match=r"no drive replies on .*bytes came"):
        await search.run([9600], False)
    assert session.now() - begun < 120
    if session.now() - begun > 30:
        assert [text for text in said if "given up after" in text and "bytes came" in text]
    await session.close()
