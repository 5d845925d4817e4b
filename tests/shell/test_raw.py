r"""Raw mode: a person's own bytes out, every byte in with its time, and nobody else on the line."""

import asyncio
from contextlib import asynccontextmanager
from dataclasses import replace
from types import SimpleNamespace
from unittest import mock

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, NoAnswer, Stopped, TransportLost
from multidrop.drives.conversations import Conversations
from multidrop.macros import Macro, MacroStep
from multidrop.shell.configuration import Settings
from multidrop.shell.events import By, Bytes
from multidrop.shell.raw import ByteForm, hex_of, parse_bytes, text_of
from multidrop.shell.scripts.executor import play
from multidrop.shell.session import Session
from tests.support.automated import automated
from tests.support.cell_session import CellSession, bus, moves, party, pmx

pytestmark = pytest.mark.virtual

ALONE = 'personality = "LMDCM"\nset = { EM = 0 }'


@asynccontextmanager
async def opened(folder, *drives, query="", reconnect=False, identified=lambda bus: None):
    """A line in raw mode from the beginning."""
    shop = CellSession(folder, bus("line", *(drives or (ALONE,)), baud=0))
    await shop.session.close()
    settings = Settings({}, folder / "config", folder / "state", data=folder / "data")
    shop.session = Session(settings, raw=True, reconnect=reconnect)
    shop.session.subscribe(shop.events.append)
    shop.session.hooks.identified.append(identified)
    await shop.session.open_all([shop.url + query])
    try:
        yield shop
    finally:
        await shop.session.close()


def rows(shop, outgoing=False):
    found = [event.rows for event in shop.events if isinstance(event, Bytes) and event.outgoing is outgoing]
    return [row for each in found for row in each]


async def say(shop, *lines):
    """Run lines; return what was received after them."""
    shop.events.clear()
    for line in lines:
        await shop.session.run(line)
    await asyncio.sleep(1.0)
    return rows(shop)


@pytest.fixture
async def shop(tmp_path):
    async with opened(tmp_path) as made:
        yield made


async def test_opening_writes_nothing(shop):
    await asyncio.sleep(10.0)
    assert shop.written("line") == b"" and shop.session.buses["line"].drives == {}


async def test_text_goes_out_with_its_terminator_and_every_byte_is_shown(shop):
    await say(shop, "/raw show text")
    assert await say(shop, "PR P") == ["PR P\\r\\n", "0\\r\\n", ">"]
    assert rows(shop, outgoing=True) == ["PR P\\r"]
    await say(shop, "/raw show hex", "/raw end none")
    assert await say(shop, "PR P", "/bytes CR") == ["50 52 20 50", "0D 0A", "30 0D 0A", "3E"]
    await say(shop, "/raw show both")
    assert await say(shop, "/bytes 0D") == ["\\r\\n".ljust(24) + " 0D 0A", ">".ljust(24) + " 3E"]


async def test_a_line_with_an_at_sign_is_text(tmp_path):
    async with opened(tmp_path, pmx("01"), query="?dialect=pmx") as shop:
        await say(shop, "/raw show text")
        assert await say(shop, "@01ID") == ["Performax-2ED-SA\\r"]
        assert shop.written("line") == b"@01ID\r"


async def test_the_stop_is_that_of_the_family_in_the_url_and_says_so(tmp_path):
    async with opened(tmp_path) as shop:
        await say(shop, "SL 50000")
        device = shop.device("line:!")
        assert moves(device, device.now)
        shop.session.stop("Ctrl+X")
        await asyncio.sleep(1.0)
        assert not moves(device, device.now)
        assert "line: raw, so the stop of mcode was sent, and no drive was asked" in shop.warned()
        assert not shop.session.tally().stand
        assert await say(shop, "/raw show text", "PR V") == ["PR V\\r\\n", "0\\r\\n", ">"]
    async with opened(tmp_path, pmx("00"), query="?dialect=pmx") as shop:
        shop.session.stop("Ctrl+X")
        await asyncio.sleep(1.0)
        assert b"ABORT" in shop.written("line") and b"SR0=0" in shop.written("line")


async def test_a_stop_that_was_written_is_not_written_again_when_the_line_comes_back(tmp_path):
    async with opened(tmp_path, reconnect=True) as shop:
        for when in ("before the loss", "during the loss"):
            if when == "before the loss":
                shop.session.stop("Ctrl+X")
                await asyncio.sleep(1.0)
            await replugged(shop, stop=when == "during the loss")
            owed = shop.written("line").count(b"\x1b\x05") > 0
            assert owed == (when == "during the loss")
        await replugged(shop)
        assert shop.written("line") == b""


async def replugged(shop, stop=False):
    """Unplug the line, and plug it in; forget what was written before."""
    shop.world("/sim unplug line")
    await asyncio.sleep(1.0)
    shop.events.clear()
    if stop:
        shop.session.stop("Ctrl+X")
    shop.world("/sim plug line")
    await asyncio.sleep(5.0)
    assert shop.session.buses["line"].lost is None


async def test_raw_off_finds_the_drives_and_raw_on_takes_the_line_back(tmp_path):
    async with opened(tmp_path, party("a"), party("b"), query="?drives=a,b") as shop:
        await say(shop, "/raw end lf")
        with pytest.raises(TransportLost, match="line is raw"):
            await shop.session.buses["line"].at("a").send("PR P")
        await say(shop, "/raw off")
        assert list(shop.session.buses["line"].drives) == ["a", "b"]
        await shop.session.run("@b PR P")
        assert shop.printed()[-1] == "0"
        line = shop.session.buses["line"]
        line.telemetry.subscribe(["a", "b"], 0.05)
        await asyncio.sleep(1.0)
        shop.events.clear()
        await shop.session.run("/raw")
        begun = len(shop.written("line"))
        await asyncio.sleep(5.0)
        assert len(shop.written("line")) == begun  # nothing is polled
        await shop.session.run("/raw off")
        shop.events.clear()
        await asyncio.sleep(1.0)
        assert b"PR P" in shop.written("line")


async def test_a_port_where_nothing_answers_is_opened_from_a_session_that_runs(tmp_path):
    async with CellSession(tmp_path, bus("line", party("a"), baud=0)) as shop:
        with pytest.raises(NoAnswer):
            await shop.session.run(f"/open {shop.url}?drives=q")
        shop.events.clear()
        await shop.session.run(f"/raw open {shop.url}?drives=q")
        assert shop.session.selected_bus == "line-2" and list(shop.session.raw) == ["line-2"]
        assert shop.written("line-2") == b""
        await shop.session.run('/bytes "q"')
        assert shop.written("line-2") == b"q"


async def test_a_macro_never_sends_its_lines_as_bytes(tmp_path):
    async with opened(tmp_path, party("a"), party("b"), query="?drives=a,b") as shop:
        for line in ("MR 5", "@a MR 5", "@line:a MR 5"):
            with pytest.raises(Diagnostic, match="line is raw: a macro's lines are for drives; |has no address"):
                await play(shop.session, shop.session.origin, Macro("go", (MacroStep(0.0, line),)), {})
        assert shop.written("line") == b""


async def test_the_selected_drive_is_the_same_afterwards(tmp_path):
    async with opened(tmp_path, party("a"), party("b"), query="?drives=a,b") as shop:
        await shop.session.run("/raw off")
        for line in ("/use b", "/raw", "/raw off"):
            await shop.session.run(line)
        assert shop.session.selected.address == "b"


async def test_raw_waits_for_the_conversation_under_way_and_a_stop_ends_that(tmp_path):
    async with opened(tmp_path, party("a"), query="?drives=a") as shop:
        await shop.session.run("/raw off")
        print_ = asyncio.create_task(shop.session.run("@a PR P"))
        await asyncio.sleep(0)
        await shop.session.run("/raw")
        await print_
        assert shop.printed()[-1] == "0" and "line" in shop.session.raw
        await shop.session.run("/raw off")
        never = asyncio.get_running_loop().create_future()
        with mock.patch.object(Conversations, "under_way", [SimpleNamespace(over=never)]):
            reserving = asyncio.create_task(shop.session.run("/raw"))
            await asyncio.sleep(1.0)
        shop.session.stop()
        with pytest.raises(Stopped):
            await reserving
        assert "line" not in shop.session.raw
        await shop.session.run("@a PR P")


async def test_where_no_drive_replies_the_line_stays_raw(tmp_path):
    async with opened(tmp_path, party("a"), query="?drives=q") as shop:
        with pytest.raises(NoAnswer):
            await shop.session.run("/raw off")
        assert "line" in shop.session.raw and "line stays raw" in shop.told()
        shop.events.clear()
        assert await say(shop, '/bytes 61 "PR P" LF') != []


async def test_automation_in_raw_mode_stops_the_line_when_it_ends_early(shop):
    with pytest.raises(Diagnostic):
        async with automated(shop.session):
            await shop.session.run("SL 20000", replace(shop.session.origin, by=By.SCRIPT))
            await asyncio.sleep(0.5)
            raise Diagnostic("failed")
    device = shop.device("line:!")
    await asyncio.sleep(0.5)
    assert not moves(device, device.now)
    shop.events.clear()
    with pytest.raises(Diagnostic):
        async with automated(shop.session):
            await shop.session.run("PR P", replace(shop.session.origin, by=By.SCRIPT))
            raise Diagnostic("failed")
    assert shop.written("line") == b"PR P\r"  # a print starts nothing


async def test_a_guarded_text_asks_and_an_address_is_refused(shop):
    for line, part in {"FD": "erases all", "aCP": "erases the program", "@line:a PR P": "has no address a"}.items():
        with pytest.raises(Diagnostic, match=part):
            await shop.session.run(line)
    assert shop.written("line") == b""
    await shop.session.run("@line: PR P")
    assert shop.written("line") == b"PR P\r"


async def test_text_on_its_way_is_on_record_until_it_has_left(shop):
    link = shop.session.buses["line"].link
    link.line.byte_time = 0.1
    await shop.session.run("MR 512")
    assert link.cut == "MR 512\r"
    await asyncio.sleep(1.0)
    assert link.cut == ""
    await shop.session.run("/bytes 4D 52")
    await asyncio.sleep(5.0)
    assert link.cut == "MR"
    await shop.session.run("/bytes CR")
    await asyncio.sleep(1.0)
    assert link.cut == ""


async def test_a_line_that_was_lost_comes_back_raw(tmp_path):
    async with opened(tmp_path, reconnect=True) as shop:
        shop.world("/sim unplug line")
        await asyncio.sleep(1.0)
        with pytest.raises(TransportLost):
            await shop.session.run("PR P")
        shop.world("/sim plug line")
        await asyncio.sleep(3.0)
        assert await say(shop, "/raw show text", "PR P") == ["PR P\\r\\n", "0\\r\\n", ">"]


async def test_what_a_port_cannot_do_is_one_clear_line(shop):
    for line in ("/raw baud 19200", "/raw dtr on", "/raw rts off", "/raw break"):
        with pytest.raises(Diagnostic, match="has no baud rate, DTR, RTS or break; valid on a serial port"):
            await shop.session.run(line)
    for line in (
        "/raw baud",
        "/raw dtr",
        "/raw dtr up",
        "/raw break 0",
        "/raw baud x",
        "/raw end x",
        "/raw nonsense",
    ):
        with pytest.raises(Diagnostic, match="usage|baud rate|break takes"):
            await shop.session.run(line)
    for line in ("/raw on", "/bytes 5", "/bytes", '/bytes "€"', "€"):
        with pytest.raises(Diagnostic):
            await shop.session.run(line)
    assert shop.written("line") == b""
    await shop.session.run("/raw off")
    for line in ("/raw off", "/bytes 0D", "/raw end lf"):
        with pytest.raises(Diagnostic, match="not in raw mode"):
            await shop.session.run(line)


@pytest.mark.parametrize(
    ("typed", "what"), [("baud 19200", "the baud rate 19200"), ("dtr on", "DTR"), ("rts off", "RTS")]
)
async def test_a_setting_that_the_port_refuses_is_named_with_the_line_and_the_reason(shop, typed, what):
    def refuses(value):
        raise OSError(5, "Input/output error")

    names = ("set_baud", "set_dtr", "set_rts", "set_break")
    shop.session.buses["line"].link.transport.control = SimpleNamespace(**dict.fromkeys(names, refuses))
    with pytest.raises(Diagnostic) as caught:
        await shop.session.run(f"/raw {typed}")
    assert str(caught.value) == f"line: the port does not take {what} (Input/output error); nothing was changed"


@pytest.mark.parametrize("refused", [True, False])
async def test_a_break_that_cannot_be_begun_or_ended_is_said_so(shop, refused):
    def set_break(on):
        if on is refused:
            raise OSError(5, "Input/output error")

    shop.session.buses["line"].link.transport.control = SimpleNamespace(set_break=set_break)
    with pytest.raises(Diagnostic, match=r"the port does not take break \(Input/output error\)"):
        await shop.session.run("/raw break")


async def test_a_stop_drops_text_that_was_typed_before_it(shop):
    since = shop.session.stops
    shop.session.stop()
    with pytest.raises(Stopped):
        await shop.session.run("SL 50000", since=since)
    assert b"SL" not in shop.written("line")


def test_bytes_are_written_as_hex_names_and_text():
    for text, expected in {
        "0D 0A": b"\r\n", "1b5B": b"\x1b[", "0x41": b"A", "ESC cr NUL": b"\x1b\r\0", "^C ^x ^[": b"\x03\x18\x1b",
        '"PR P" CR': b"PR P\r", '""': b"", "": b"", '"a b"0D': b"a b\r",
    }.items():  # fmt: skip
        assert parse_bytes(text) == expected, text
    for text in ("5", "0G", "HELLO", "^", "^1x", "0x", '"é€"'):
        with pytest.raises(Diagnostic, match="/bytes"):
            parse_bytes(text)


def test_ff_is_the_byte_that_it_is_in_hex_and_no_form_feed():
    assert parse_bytes("FF") == parse_bytes("ff") == parse_bytes("0xFF") == b"\xff"
    assert parse_bytes("0C") == parse_bytes("^L") == b"\x0c"


@given(st.binary(max_size=200))
@example(bytes(range(256)))
def test_rows_hold_every_byte_and_no_control_character(data):
    for form in ByteForm:
        shown = list(form.rows(data))
        assert all(row.isprintable() and row.isascii() for row in shown)
    assert bytes.fromhex("".join(ByteForm.HEX.rows(data))) == data
    assert parse_bytes(hex_of(data)) == data and text_of(data) == "".join(ByteForm.TEXT.rows(data))


@pytest.mark.parametrize("answer", [True, False])
async def test_a_line_that_waits_in_a_party_is_executed_by_the_search_for_drives_after_a_yes_only(tmp_path, answer):
    asked = []

    async def ask(question):
        asked.append(question)
        return answer

    async with opened(tmp_path, party("a", CK=0), query="?drives=a") as shop:
        await say(shop, "/bytes LF LF", "aVM=77777")
        shop.session.front.ask = ask
        if answer:
            await shop.session.run("/raw off")
        else:
            with pytest.raises(Diagnostic, match="the answer was no"):
                await shop.session.run("/raw off")
            assert "line" in shop.session.raw
            shop.session.stop()
            await shop.session.run("/raw off")
        assert asked == [r"line: no drive has replied to 'aVM=77777\r': in party mode a drive executes it now"]
        await say(shop, "PR VM")
        assert (shop.device("line:a").memory.values["VM"] == 77777) is answer


async def test_a_line_that_a_drive_has_replied_to_asks_nothing(shop):
    await say(shop, "PR P")
    await shop.session.run("/raw off")
    assert "line" not in shop.session.raw


async def test_a_line_that_is_opened_raw_is_told_to_features_as_one_that_is_open(tmp_path):
    told = []
    async with opened(tmp_path, identified=told.append) as shop:
        assert told == list(shop.session.buses.values())
