"""Simulated drives behind a shared port: they execute nothing that is not a whole line of one writer."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.lexium.simulator.ports.mcode import MCodePort
from multidrop.families.lexium.simulator.ports.replies import checksum
from multidrop.families.pmx.simulator.device import PmxPort
from multidrop.families.tmcl.host import codec
from multidrop.families.tmcl.manual import commands
from multidrop.features.sharing.stop_bytes import stop_bytes
from multidrop.features.sharing.writer_turns import WRITER_TIMEOUT, ClientWrite, PortClients, Say
from tests.support.examples import examples
from tests.support.lexium import drive
from tests.support.pmx_controller import Bench
from tests.support.shared_exchange import ADA, BOB, Port
from tests.support.tmcl_module import Module


class Far:
    """A port of a simulated drive that keeps what it executes. `now` is its time, s."""

    def __init__(self, port: Any, device: Any, executed: list[str]) -> None:
        self.port, self.executed, self.now = port, executed, 0.0
        execute = device.execute

        def kept(command: Any, now: float) -> Any:
            executed.append(str(command))
            return execute(command, now)

        device.execute = kept

    def take(self, data: bytes) -> bytes:
        self.port.receive(data, self.now)
        return b"".join(each.data for each in self.port.sent(self.now))


def mcode(party: bool, check: int, em: int, es: int) -> Far:
    device = drive(f"EM={em}", f"ES={es}", *(['DN="a"', "PY=1"] if party else []), *(["CK=1"] if check else []))
    port = MCodePort(device)
    port.receive(b"\n\n", 0.0)
    port.advance(0.0)
    return Far(port, device, [])


def pmx() -> Far:
    device = Bench().device
    return Far(PmxPort(device, alone=False), device, [])


def tmcl() -> Far:
    module = Module()
    return Far(module.port, module.device, [])


def checked(line: bytes, check: bool) -> bytes:
    return line + bytes([checksum(line)]) if check else line


def executed_alone(make: Callable[[], Far], data: bytes) -> set[str]:
    """What a drive executes of the bytes of one writer."""
    far = make()
    far.take(data)
    return set(far.executed)


def lines_of(data: bytes) -> set[str]:
    """What may be one line of these bytes, whichever ends of lines the drive takes: consecutive pieces of them."""
    pieces = [each.decode("latin-1") for each in re.split(b"[\r\n]", data)]
    return {"".join(pieces[at:end]) for at in range(len(pieces)) for end in range(at + 1, len(pieces) + 1)}


def shared(
    make: Callable[[], Far], port: Port, reads: Sequence[bytes], following: Sequence[bytes], leaves: bool, more: bytes
) -> None:
    """Let one client send some reads, another one follow it, and the first go on; check what the drive executes."""
    far, at = make(), 0

    def send(client: int, data: bytes) -> None:
        nonlocal at
        port.send(client, data, far.now)
        if reply := far.take(port.written[at:]):
            port.reply(reply, far.now)
        at = len(port.written)
        far.now += 0.05

    for data in reads:
        send(ADA, data)
    if leaves:
        port.do(port.exchange.leave(ADA))
    else:
        far.now += WRITER_TIMEOUT + 1.0
    for data in following:
        send(BOB, data)
    if not leaves:
        far.now += WRITER_TIMEOUT + 1.0
        send(ADA, more)
    first = b"".join(reads) + (b"" if leaves else more)
    whole = lines_of(first) | lines_of(b"".join(following))
    whole |= executed_alone(make, first) | executed_alone(make, b"".join(following))
    whole |= {each[1:] for each in whole} | {each[:-1] for each in whole}  # without a name, or a check byte
    done = {each for each in far.executed if "~" not in each}  # no drive knows such a command
    assert done <= whole, (far.executed, whole, port.written)


WORDS = ["MR 51200", "VM=5", "PR P,V", "CP", "S", "R1=5 ", "PR P", ""]
ENDS = [b"\r", b"\n", b"\r\n"]


@st.composite
def lines(draw: st.DrawFn, party: bool, check: bool) -> bytes:
    """Some lines of a writer that uses names, a checksum or ends of lines as it likes."""
    made = b""
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(["a", "a", "*", "b"])) if party else ""
        made += checked((name + draw(st.sampled_from(WORDS))).encode(), check) + draw(st.sampled_from(ENDS))
    return made


@examples(60, nightly=2000)
@given(st.data(), st.booleans(), st.booleans(), st.integers(0, 2), st.integers(0, 3))
def test_mcode_executes_no_line_of_two_writers(data: st.DataObject, party: bool, check: bool, em: int, es: int) -> None:
    def make() -> Far:
        return mcode(party, check, em, es)

    text = data.draw(lines(party, check))
    cut = data.draw(st.integers(0, len(text)))
    middle = data.draw(st.integers(0, cut))
    following = [data.draw(st.sampled_from([b"", b"\r", b"\n", b"\r\n"])) + data.draw(lines(party, check))]
    stated = data.draw(st.sampled_from([None, party]))
    port = Port(data.draw(st.sampled_from(["", "mcode"])), party=stated)
    reads = [each for each in (text[:middle], text[middle:cut]) if each]
    shared(make, port, reads, following, data.draw(st.booleans()), text[cut:] or b"\r")


@pytest.mark.parametrize("party", [True, False])
@pytest.mark.parametrize("check", [True, False])
@pytest.mark.parametrize("follows", ENDS)
def test_no_prefix_of_a_command_that_erases_is_executed_by_the_next_writers_end(
    party: bool, check: bool, follows: bytes
) -> None:
    line = checked(b"aFD" if party else b"FD", check)
    for end in ENDS:
        whole = line + end
        for cut in range(len(whole)):
            far = mcode(party, check, 1, 1)
            port = Port()
            port.send(ADA, whole[:cut])
            if reply := far.take(port.written):
                port.reply(reply)
            at = len(port.written)
            port.do(port.exchange.leave(ADA))
            port.send(BOB, follows)
            far.take(port.written[at:])
            alone = executed_alone(lambda: mcode(party, check, 1, 1), whole[:cut])
            assert set(far.executed) <= alone, (whole[:cut], far.executed)


PMX_LINES = st.lists(
    st.sampled_from([b"@00STORE\r", b"@00X1000\r", b"@00PX\r", b"@00HSPD=50\r\n"]), min_size=1, max_size=3
)


@given(PMX_LINES, st.integers(0, 30), PMX_LINES, st.sampled_from([b"", b"\r", b"\n", b"00\r"]), st.booleans())
def test_a_pmx_executes_no_line_of_two_writers(
    first: list[bytes], cut: int, second: list[bytes], head: bytes, leaves: bool
) -> None:
    text = b"".join(first)
    shared(pmx, Port("pmx"), [text[:cut]], [head + b"".join(second)], leaves, text[cut:] or b"\r")


FRAMES = st.lists(
    st.sampled_from(["ROR 0, 100", "MVP ABS, 0, 51200", "SAP 6, 0, 100", "STAP 6, 0", "GAP 1, 0"]),
    min_size=1,
    max_size=3,
)


@given(FRAMES, st.integers(0, 27), FRAMES, st.booleans())
def test_a_tmcl_module_executes_no_frame_of_two_writers(
    first: list[str], cut: int, second: list[str], leaves: bool
) -> None:
    text = b"".join(codec.frame_of(1, commands.parse(each)) for each in first)
    following = b"".join(codec.frame_of(1, commands.parse(each)) for each in second)
    shared(tmcl, Port("tmcl"), [text[:cut]], [following], leaves, text[cut:])


def test_bytes_that_the_port_dropped_leave_a_doubt_only_where_nothing_follows_that_makes_a_line_harmless() -> None:
    stops = stop_bytes("")
    for purged in (False, True):
        exchange = PortClients(stops, 9600)
        for count, words in (
            (1, "1 byte that had not left was dropped"),
            (3, "3 bytes that had not left were dropped"),
        ):
            assert exchange.dropped(count, *([True, 1.0] if purged else [])) == [Say("", "unsent", words)]
        assert exchange.dropped(0) == []
        assert [each.data for each in exchange.over() if isinstance(each, ClientWrite)] == (
            [stops.harmless(True)] if purged else []
        )
