"""Opening a port after a session that was cut off: half a line is never executed, and what was owed is put back."""

from dataclasses import replace

import pytest

from multidrop.base.errors import TransportLost
from multidrop.dialects import End, Hints, Owed, Reply
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.operations import put_back_found
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import program_file
from multidrop.simulator.cell.spec import Faults
from tests.support.cases import for_each
from tests.support.faults import disturb
from tests.support.mcode_drives import MODES, Witness
from tests.support.procedure import ProcedureRunner

MOVES_ON_ERROR = ("PG 1", "LB G1", "OE X1", "E", "LB X1", "SL 50000", "RT", "PG", "EX G1")
TILDES = b"~" * 65


def left(bench, em=1, party=True, check=1, half=b"", program=(), **settings):
    name = "a" if party else "!"
    desk = bench([{"name": name, "party": party, "set": {"EM": em, "CK": check, **settings}}])
    desk.wire.receive(b"\n\n", 0.0)
    desk.wait(0.5)
    device = desk.devices[name]
    for line in program:
        assert not device.execute(line, desk.now).refused, line
    witness = Witness(device)
    desk.wire.receive(half, desk.now)
    desk.wait(0.1)
    desk.events()
    desk.strays.clear()
    return desk, device, witness


def found(desk, party, **hints):
    drives = ("a",) if party else ()
    return desk.run(MCodeFamily.identify(Hints(drives=drives, party=party or None, **hints)))


@pytest.mark.slow
@for_each("escape", range(4))
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_half_a_line_of_our_own_overflows_between_stops(bench, em, party, check, escape):
    half = b"aMR 51200" if party else b"MR 51200"
    desk, device, witness = left(bench, em, party, check, half, program=MOVES_ON_ERROR, ES=escape)
    assert device.interpreter.handler is not None
    [state] = found(desk, party, cut="aMR 51200")
    assert state.codec == MCode(em=em, party=party, checksum=check, escape=escape)
    assert not any("MR" in text for text, refused, _ in witness.lines if not refused)
    desk.wait(1.0)
    assert not device.moving(desk.now) and not device.running


def test_a_stop_stands_before_and_behind_what_overflows_and_no_end_of_a_line_before_it(bench):
    desk, *_ = left(bench)
    found(desk, True, cut="aMR 51200")
    first, second = desk.written[:2]
    before, behind = first.split(TILDES)
    assert before == b"\x1b\x05a\x05a\x1b\x1b\x05" and behind == b"\r\n" + second
    assert second == b"\x1b\x05a\x05a\x1b\n\x1b\x05"


@pytest.mark.slow
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_on_a_clean_line_opening_raises_no_error_and_stops_nothing(bench, em, party, check):
    desk, device, _ = left(bench, em, party, check, program=MOVES_ON_ERROR)
    device.execute("SL 1000", desk.now)
    found(desk, party)
    assert not device.memory.error_flag and device.velocity(desk.now) == 1000
    assert not any(TILDES in data or b"\x1b" in data or b"\x05" in data for data in desk.written)


@pytest.mark.slow
@for_each("half", [b"MR 5", b"aMR 5", b"MA 51200", b"aSL 5", b"*MR 5"])
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_half_a_line_of_somebody_elses_is_not_executed_either(bench, em, party, check, half):
    desk, device, witness = left(bench, em, party, check, half)
    found(desk, party)
    desk.wait(1.0)
    assert device.position(desk.now) == 0 and not device.moving(desk.now)
    assert not any(text[:2] in ("MR", "MA", "SL") for text, refused, _ in witness.lines if not refused)


OWED = Owed(1, "a", "LMDCM", "LMDCM 6.002, Hw: 3.2", "LMDCM571", "040100097")


OWED_NAMES = (OWED.name, OWED.product, OWED.version, OWED.part, OWED.serial)


def killed(bench, em=1, party=True, check=1):
    """A drive as a session leaves it that is killed in the middle of a download."""
    desk, device, witness = left(bench, em, party, check)
    for line in ("EM=0", "PG 1", "LB G1", "R1=5"):
        device.execute(line, desk.now)
    name = "a" if party else "!"
    return desk, device, witness, Owed(em, name, *(OWED.product, OWED.version, OWED.part), f"0401{ord(name):05d}")


@pytest.mark.slow
@pytest.mark.parametrize("half", [b"", b"aMR 51200"])
@pytest.mark.parametrize(("em", "party", "check"), [mode for mode in MODES if mode[0]])
def test_what_was_owed_is_put_back_and_said(bench, em, party, check, half):
    desk, device, _, owed = killed(bench, em, party, check)
    desk.wire.receive(half, desk.now)
    [state] = found(desk, party, owed=(owed,), cut=half.decode())
    assert (device.programming, device.memory.echo_mode, state.codec.em) == (None, em, em)
    assert state.restore is None and device.position(desk.now) == 0
    who = "a" if party else "the drive"
    assert [note for note in state.notes if "interrupted" in note] == [
        f"{who}: an interrupted download or program mode left EM=0; EM={em} is set again; check the program in it"
    ]
    assert desk.type(state, "PR P") == ("0",)


@pytest.mark.parametrize(
    "other",
    [
        Owed(1, "b", OWED.product, OWED.version, OWED.part, OWED.serial),
        Owed(1, "a", "LMDOM", OWED.version, OWED.part, OWED.serial),
        Owed(1, "a", OWED.product, "LMDCM 5.0", OWED.part),
        Owed(1, "a", OWED.product, OWED.version, "LMDCM572"),
        Owed(1, "a", OWED.product, OWED.version, OWED.part, "040100098"),
        Owed(1, "a", OWED.product, OWED.version, OWED.part),
    ],
)
def test_nothing_is_put_back_in_another_drive(bench, other):
    desk, device, *_ = killed(bench)
    [state] = found(desk, True, owed=(other,))
    assert (device.programming, device.memory.echo_mode, state.restore) == (None, 0, None)
    assert not any(b"EM=" in data for data in desk.written)


@pytest.mark.parametrize(
    ("owed", "printed", "put_back"),
    [
        (OWED, OWED.serial, True),
        (OWED, "040100098", False),
        (OWED, "", False),
        (replace(OWED, serial=""), "", True),
        (replace(OWED, serial="", version="LMDCM 5.0"), "", False),
        (replace(OWED, serial="", part="LMDCM572"), "", False),
    ],
)
def test_a_drive_whose_serial_number_was_not_read_yet_is_asked_for_it(owed, printed, put_back):
    state = MCodeState(MCode(party=True, checksum=1), "a")
    state.named("a")
    state.identified(OWED.product, OWED.version, OWED.part)
    procedure, sent = ProcedureRunner(put_back_found(state, [owed])), list[str]()
    while procedure.request is not None and "EM=1" not in sent:
        sent.append(procedure.request.text)
        answer = {"PR SN": printed, "PR ER": "36"}.get(sent[-1].partition(",")[0], "0")
        procedure.answer(Reply((f"{answer}~a",)) if answer else Reply((), end=End.REFUSED))
    assert ("EM=1" in sent) is put_back


def test_a_version_that_noise_had_changed_keeps_nothing_from_the_drive_with_the_serial_number(bench):
    desk, device, _, owed = killed(bench, check=0)
    [state] = found(desk, True, owed=(replace(owed, version="LMDCM 6.002,' Hw: 3.2", part="LMDCM5?1"),))
    assert (device.memory.echo_mode, state.codec.em, state.restore) == (1, 1, None)


@pytest.mark.parametrize("em", [1, 2, 3])
def test_a_drive_that_was_set_since_stays_as_it_is(bench, em):
    desk, device, *_ = left(bench, em=em)
    [state] = found(desk, True, owed=(Owed(3 if em == 1 else 1, *OWED_NAMES),))
    assert (device.memory.echo_mode, state.restore) == (em, None) and not any("cut off" in note for note in state.notes)


def test_what_could_not_be_put_back_at_opening_stays_owed_and_is_put_back_before_the_next_line(bench):
    desk, device, *_, owed = killed(bench)
    lost = []

    def loses(desk):
        if b"EM=1" in desk.written[-1] and not lost:
            lost.append(True)
            disturb(desk.wire, Faults(drop=1.0))

    hints = Hints(drives=("a",), party=True, owed=(owed,))
    [state] = desk.run(MCodeFamily.identify(hints), at=loses)
    assert lost and state.restore == owed and any("may be EM=0 now" in note for note in state.notes)
    disturb(desk.wire)
    assert desk.type(state, "PR EM") == ("1",)
    assert state.restore is None


def test_a_download_says_what_is_owed_before_the_echo_mode_is_changed(bench):
    desk, device, _ = left(bench)
    [state] = found(desk, True)
    seen = []

    def look(desk):
        seen.append((state.restore, device.memory.echo_mode))

    lines = program_file.read("PG 1\nLB G1\nE\nPG\n", "x")
    desk.run(MCodeFamily(state).programs.download(lines, None, lambda done, total: None), state, at=look)
    assert (None, 0) not in seen and (OWED, 0) in seen and (state.restore, device.memory.echo_mode) == (None, 1)


def lost_behind(procedure, text):
    """Forward a conversation up to the reply to this request: the line is lost with the next one."""
    request = next(procedure)
    while request.text != text:
        request = procedure.send((yield request))
    procedure.send((yield request))
    while True:
        procedure.throw(TransportLost("the port is gone"))


def test_an_echo_mode_that_was_borrowed_as_the_line_was_lost_stays_owed(bench):
    desk, device, _ = left(bench)
    [state] = found(desk, True)
    lines = program_file.read("PG 1\nLB G1\nE\nPG\n", "x")
    with pytest.raises(TransportLost):
        desk.run(
            lost_behind(MCodeFamily(state).programs.download(lines, None, lambda done, total: None), "EM=0"), state
        )
    assert (state.restore, device.memory.echo_mode) == (OWED, 0)
    assert desk.type(state, "PR EM") == ("1",)
    assert (state.restore, device.memory.echo_mode) == (None, 1)
