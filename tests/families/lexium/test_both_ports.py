"""One drive open over MCode/TCP and over Modbus/TCP at once: what is typed to either has the same answer."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, Refused, Stopped
from multidrop.drives.events import Traffic, Unsolicited
from multidrop.shell.configuration import Settings
from multidrop.shell.events import FAILURES, By, Notified, OnBus, Output, Printed
from multidrop.shell.session import Session
from multidrop.simulator.cells import load
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from tests.support.automated import automated
from tests.support.until import PATIENCE

CELL = """
[[bus]]
name = "eth"
serve = ["tcp://127.0.0.1:0", "modbus://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCE"
set = { EM = 1, IS = ["1,1,0", "2,2,0"] }
program = "p.mxt"
[bus.drive.world]
limit_plus = 5000000
inputs = [[0.0, 3, 0]]
"""
PROGRAM = "PG 100\nLB A3\nR1=77\nLB A4\nH 20\nBR A4\nE\nPG\n"


@pytest.fixture
async def session(tmp_path):
    """A session with the buses `mcode` and `modbus`, which are one drive."""
    (tmp_path / "p.mxt").write_text(PROGRAM)
    (tmp_path / "cell.toml").write_text(CELL)
    async with AsyncExitStack() as stack:
        floor = RunningFloor(Floor(load(tmp_path / "cell.toml")))
        stack.callback(floor.close)
        served = [each for bus in floor.floor.cell.buses for each in await serve_bus(floor, bus, stack)]
        made = Session(Settings({}, tmp_path / "config", tmp_path / "state", data=tmp_path / "data"))
        stack.push_async_callback(made.close)
        made.questions.agreed = True
        made.events = []
        made.subscribe(made.events.append)
        urls = {each.endpoint.partition(":")[0]: each.endpoint for each in served}
        await made.open(urls["tcp"], "mcode")
        await made.open(urls["modbus"], "modbus")
        yield made


async def answers(session, line, bus):
    """What a line printed on a bus, or which kind of failure it was."""
    session.events.clear()
    try:
        async with asyncio.timeout(PATIENCE):
            await session.run(f"@{bus}: {line}")
    except FAILURES as failure:
        return type(failure).__name__
    return printed(session)


def printed(session):
    return [event.text for event in session.events if isinstance(event, Output | Printed)]


SAME = [
    "PR P",
    'PR P," ",V',
    'PR "x=",P," y=",V,"!"',
    "pr vm",
    "PR VI,VM,A,D",
    "PR I1,I2,I3,I4",
    "PR IN",
    "PR HT",
    "PR MS",
    "PR VR",
    "PR SN",
    "PR PN",
    "PR IS",
    "PR OS",
    "PR TR",
    "PR MU",
    "PR EF",
    "PR ER",
    "PR 12",
    "PR O1",
    "PR MA",
    "PR P;",
    "VM=600000",
    "PR VM",
    "vm 500000",
    "PR VM",
    "P=-70000",
    "PR P",
    "R1=-2147483648",
    "PR R1",
    "IC R1",
    "PR R1",
    "DC R1",
    "PR R1",
    "HC=40",
    "PR HC",
    "IS=4,7,1",
    "PR IS",
    "OS=1,17,1",
    "OS=2,16,1",
    "PR OS",
    "O2=1",
    "OT=0",
    "MU=1",
    "PR MU",
    "S",
    "HC=200",
    "V=5",
    "BY=1",
    "VM=5",
    "MS=3",
    "A=1",
    "PR EF",
    "' a remark",
    "CF",
    "E",
    "IP",
    "PR VM",
]


@pytest.mark.slow
async def test_the_same_line_has_the_same_answer(session):
    differing = []
    for line in SAME:
        mcode, modbus = [await answers(session, line, bus) for bus in ("mcode", "modbus")]
        if mcode != modbus:
            differing.append((line, mcode, modbus))
    assert differing == []


async def test_a_program_is_run_paused_and_ended(session):
    await session.run("@modbus: EX A3")
    assert await answers(session, "PR BY", "mcode") == ["1"]
    assert await answers(session, "PR R1", "modbus") == ["77"]
    await session.run("@modbus: PS")
    await session.run("@modbus: RS")
    await session.run("@modbus: E")
    assert await answers(session, "PR BY", "modbus") == ["0"]


async def test_user_variables_and_what_has_no_register(session):
    await session.run("@mcode: VA V1=5")
    assert await answers(session, "PR V1", "modbus") == ["5"]
    for line in ("PR UV", "VM=VM+1", "CP", "PR Q7"):
        with pytest.raises(Inexpressible, match="MCode/TCP"):
            await session.run(f"@modbus: {line}")


async def test_pr_al_prints_what_it_prints_over_mcode_as_far_as_there_are_registers(session):
    mcode, modbus = [dict(row.split(" = ", 1) for row in await answers(session, "PR AL", bus) if row) for bus in BOTH]
    assert len(modbus) > 60
    differing = {name for name in modbus if name in mcode and mcode[name] != modbus[name]}
    assert differing <= {"I5", "IT", "TS", "D5"}
    assert await answers(session, "PR EF", "mcode") == ["0"]


BOTH = ("mcode", "modbus")


async def test_raw_registers_outputs_and_identification(session):
    await session.run("/use modbus")
    session.events.clear()
    for line in ("/register 0x57 =-5", "/register 87", "/register 0x57 1", "/register 0x57=1,0", "/register 0x0057 2"):
        await session.run(line)
    assert printed(session) == [
        *("0x0057 = 65531 (0xFFFB)", "0x0058 = 65535 (0xFFFF)", "P = -5"),
        "0x0057 = 65531 (0xFFFB)",
        *("0x0057 = 1 (0x0001)", "0x0058 = 0 (0x0000)", "P = 1"),
    ]
    session.events.clear()
    await session.run("/coil 2 1")
    await session.run("/coil 2")
    await session.run("/coil 2 0")
    await session.run("/coil 2")
    await session.run("/device")
    lines = printed(session)
    assert lines[:2] == ["O2 = 1", "O2 = 0"] and len(lines) == 9
    assert any(line.startswith("version: LMDCE") for line in lines)
    with pytest.raises(Refused, match="exception 02 illegal data address at register 0x0002"):
        await session.run("/register 2")


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("/register", "usage"),
        ("/register P", "no number P"),
        ("/register 0x10000", "no register 0x10000"),
        ("/register 0x57 =", "usage|no number"),
        ("/register 0x57 2 3", "usage|no number"),
        ("/register 0x57 =5x", "no number 5x"),
        ("/coil", "usage"),
        ("/coil 0", "no output 0"),
        ("/coil 1 2", "usage"),
        ("/device x", "usage"),
    ],
)
async def test_wrong_usage(session, line, named):
    await session.run("/use modbus")
    with pytest.raises(Diagnostic, match=named):
        await session.run(line)


@pytest.mark.slow
async def test_a_stop_ends_program_and_motion_and_is_seen_to_work(session):
    await session.run("@modbus: EX A3")
    await session.run("@modbus: SL 500000")
    await asyncio.sleep(0.2)
    session.events.clear()
    bus = session.buses["modbus"]
    session.buses = {"modbus": bus}
    session.stop()
    with pytest.raises(Stopped):
        await session.run("@modbus: MR 5", replace(session.origin, by=By.MACRO))
    async with asyncio.timeout(PATIENCE):
        await bus.stopped()
    sent = [e.event.data for e in session.events if isinstance(e, OnBus) and isinstance(e.event, Traffic)]
    assert sent[0] == bytes.fromhex("FFFE0000000601412020 2045 FFFF0000000B0110007800020400000000")
    assert [e.text for e in session.events if isinstance(e, Notified) and "stopped, velocity 0" in e.text]
    assert not [e for e in session.events if isinstance(e, OnBus) and isinstance(e.event, Unsolicited)]
    assert await answers(session, "PR V,BY", "modbus") == ["00"]


async def test_the_state_in_words_is_the_same_over_both(session):
    def said():
        return [event.text for event in session.events if isinstance(event, Output)]

    async def status(bus):
        session.events.clear()
        await session.run(f"/status {bus}:")
        return said()

    assert await status("mcode") == [
        "at rest: P=0",
        "program: none runs",
        "error: none",
        "inputs: 1 high, 2 high, 3 low, 4 high",
    ]
    await session.run("@mcode: EX A3")
    await session.run("@mcode: SL 2000")
    with pytest.raises(DriveError):
        await session.run("@mcode: VI=5000000")
    for bus in ("mcode", "modbus"):
        moving, program, error, inputs, *outputs = await status(bus)
        assert moving.startswith("moving: V=") and program == "program: running" and error == "error: none"
        assert inputs == "inputs: 1 high, 2 high, 3 low, 4 high"
        assert outputs == ["outputs: 1 inactive, 2 inactive, 3 inactive"] * (bus == "modbus")
    await session.run("@modbus: O2=1")
    assert (await status("modbus"))[-1] == "outputs: 1 inactive, 2 active, 3 inactive"


async def test_a_raw_write_of_a_guarded_register_needs_a_yes(session):
    session.questions.agreed = False
    await session.run("/use modbus")
    for line in ("/register 0x3C =1", "/register 0x8D =84,3", "IP", "AS=3"):
        with pytest.raises(Diagnostic, match="nothing was sent; --yes agrees to it"):
            await session.run(line)
    await session.run("/register 0x8B =600000")
    assert await answers(session, "PR VM", "modbus") == ["600000"]


REFUSED = ["RC=200", "/register 0x67 =70000", "/register 0x67 =200", "STATUS", "VM=0", "PR MR", "/register 0x02 =1"]


@pytest.mark.slow
@pytest.mark.parametrize("line", REFUSED)
async def test_a_refused_line_ends_no_program_and_no_motion(session, line):
    for each in ("SL 20000", "/sleep 0.5", "EX A3"):
        await session.run(each if each.startswith("/") else f"@mcode: {each}")
    await session.run("/use modbus")
    session.events.clear()
    with pytest.raises(FAILURES):
        async with automated(session):
            await session.run(line)
    assert await answers(session, "PR BY", "mcode") == ["1"]
    assert await answers(session, "PR V", "mcode") == ["20000"]


@pytest.mark.slow
@pytest.mark.parametrize("line", ["SL 20000", "/register 0x78 =20000", "MA 900000", "/register 0x43 =0,10"])
async def test_an_accepted_write_that_moves_counts_and_the_program_is_named(session, line):
    await session.run("@mcode: EX A3")
    await session.run("/use modbus")
    assert await answers(session, "PR BY", "modbus") == ["1"]
    with pytest.raises(FAILURES):
        async with automated(session):
            for each in (line, "/sleep 0.2", "RC=200"):
                await session.run(each)
    told = [event.text for event in session.events if isinstance(event, Notified) and event.warning]
    assert [text for text in told if text.startswith("program ended")] == ["program ended, if one was running: modbus"]
    assert await answers(session, "PR BY,V", "mcode") == ["00"]


@pytest.mark.parametrize("line", ["JE=0", "R1=5", "VM=500000", "/register 0x67 =20", "/coil 1 1", "SL 0", "PR P"])
async def test_a_write_that_starts_nothing_leaves_a_program_alone(session, line):
    await session.run("@mcode: EX A3")
    await session.run("/use modbus")
    with pytest.raises(FAILURES):
        async with automated(session):
            for each in (line, "RC=200"):
                await session.run(each)
    assert await answers(session, "PR BY", "mcode") == ["1"]
