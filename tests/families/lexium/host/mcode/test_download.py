"""Downloads in memory: every line seen to be taken, and the drive left as it was found, whatever happens."""

import pytest

from multidrop.base.errors import DriveError, Inexpressible, NoAnswer, Refused, Stopped
from multidrop.dialects import End, Reply, StopPiece
from multidrop.dialects.program_files import Held
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import program_file
from multidrop.simulator.cell.spec import Faults
from tests.support.faults import disturb
from tests.support.mcode_drives import one_drive
from tests.support.procedure import ProcedureRunner

pytestmark = pytest.mark.slow

MODES = [(em, party, check) for em in range(4) for party in (False, True) for check in range(3)]
PROGRAM = """
'[VARIABLES]
VM=400000      ' faster
'[PROGRAMS]
PG 1
LB G1
  MR 51200     ' one turn
  H
  R1=R1+1
E
PG
S
'[END]
"""


def download(desk, state, text=PROGRAM, **how):
    progress = []
    lines = program_file.read(text, "x.mxt")
    desk.run(
        MCodeFamily(state).programs.download(lines, None, lambda done, total: progress.append((done, total))),
        state,
        **how,
    )
    return progress


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_program_is_stored_and_the_echo_mode_restored(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    progress = download(desk, state)
    assert progress[-1] == (9, 9)
    assert (state.programming, state.codec.em) == (False, em)
    assert desk.type(state, "PR VM") == ("400000",)
    listed = desk.type(state, "L")
    assert [line.split(None, 1)[1].upper() for line in listed] == ["LB G1", "MR 51200", "H", "R1=R1+1", "E"]


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_what_the_file_saves_is_the_echo_mode_that_was_there(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    download(desk, state)
    device = desk.devices["a" if party else "!"]
    device.reset(device.now)
    assert (device.memory.echo_mode, device.program.lines != {}) == (em, True)


@pytest.mark.parametrize("wanted", range(4))
@pytest.mark.parametrize(("em", "party", "check"), [(0, False, 0), (1, True, 0), (2, True, 1), (3, False, 2)])
def test_an_echo_mode_that_the_file_sets_is_kept_and_saved(bench, em, party, check, wanted):
    desk, state = one_drive(bench, em, party, check)
    download(desk, state, PROGRAM.replace("VM=400000", f"EM={wanted}"))
    device = desk.devices["a" if party else "!"]
    assert (state.codec.em, device.memory.echo_mode) == (wanted, wanted)
    device.reset(device.now)
    assert (device.memory.echo_mode, device.program.lines != {}) == (wanted, True)


@pytest.mark.parametrize(("em", "party", "check"), [(0, False, 0), (1, True, 1), (2, True, 0), (3, True, 2)])
def test_a_line_that_the_drive_refuses_ends_it_with_the_files_line(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    with pytest.raises(Refused, match=r"^line 3: .*'XYZZY 5': error \d+: "):
        download(desk, state, "PG 1\nLB G1\nXYZZY 5\nE\nPG\n")
    assert (state.programming, state.codec.em) == (False, em)
    assert desk.devices["a" if party else "!"].programming is None
    assert desk.type(state, "PR P") == ("0",)


def test_a_download_that_is_refused_half_way_says_what_is_stored(bench):
    desk, state = one_drive(bench, 1, True, 1)
    with pytest.raises(Refused, match=r"^line 5: .*'XYZZY 5': error \d+: [^;]*; .*3 lines are stored") as refused:
        download(desk, state, "PG 1\nLB G1\nMR 51200\nH\nXYZZY 5\nE\nPG\n")
    assert str(refused.value).endswith(
        "; 3 lines are stored (addresses 1 to 14, from label G1): the program in a is incomplete"
    )
    assert [line.split() for line in desk.type(state, "L")] == [["1", "LB", "G1"], ["6", "MR", "51200"], ["13", "H"]]


def test_a_download_that_is_refused_at_its_first_line_says_that_nothing_is_stored(bench):
    desk, state = one_drive(bench, 1, True, 1)
    with pytest.raises(Refused, match="; no line of the program is stored$"):
        download(desk, state, "PG 1\nXYZZY 5\nE\nPG\n")


def test_a_download_that_is_refused_behind_its_programs_says_that_they_are_stored(bench):
    desk, state = one_drive(bench, 0, False, 0)
    with pytest.raises(Refused, match=r"; 3 lines are stored \(addresses 1 to 7, 100 to 101, from label G1\)$"):
        download(desk, state, "PG 1\nLB G1\nE\nPG\nPG 100\nE\nPG\nXYZZY\n")


def test_a_stop_in_a_download_says_what_is_stored(bench):
    desk, state = one_drive(bench, 1, True, 1, baud=9600)

    def stop(desk):
        if b"R1=" in desk.written[-1]:
            desk.line.stop(desk.now, StopPiece(b"\x1b"))
            desk.wire.receive(b"\x1b", desk.now)

    with pytest.raises(Stopped, match=r"; 3 lines are stored \(addresses 1 to \d+, from label G1\): .* incomplete$"):
        download(desk, state, at=stop)


def test_a_refusal_is_told_though_what_comes_after_it_fails(bench):
    desk, state = one_drive(bench, 1, True, 1)

    def goes(desk):
        if b"EM=1" in desk.written[-1]:
            desk.devices["a"].power(False, desk.now)

    with pytest.raises(Refused, match=r"^line 3: .*'XYZZY 5': error \d+: "):
        download(desk, state, "PG 1\nLB G1\nXYZZY 5\nE\nPG\n", at=goes)
    assert state.settings_unknown and any("may be EM=0 now" in note for note in state.notes)


def test_a_program_whose_end_was_not_seen_is_not_told_as_stored(bench):
    desk, state = one_drive(bench, 1, True, 0)

    def goes(desk):
        if desk.written[-1] == b"aPG\n":
            desk.devices["a"].power(False, desk.now)

    with pytest.raises(NoAnswer, match="could not be taken out of program mode"):
        lines = program_file.read("PG 1\nLB G1\nE\nPG\n", "x.mxt")[:3]
        desk.run(MCodeFamily(state).programs.download(lines, None, lambda done, total: None), state, at=goes)
    assert state.programming


def test_a_variable_that_is_refused_ends_it_before_the_program(bench):
    desk, state = one_drive(bench, 1, True, 1)
    with pytest.raises(Refused, match="^line 1: .*error 23"):
        download(desk, state, "VM=500\nPG 1\nE\nPG\n")
    assert desk.type(state, "L") == ()


def test_no_line_of_a_program_is_sent_where_program_mode_was_refused(bench):
    desk, state = one_drive(bench, 1, True, 0)
    desk.type(state, "SL 5000")
    with pytest.raises(Refused, match="^line 1: .*'PG 1': error 73"):
        download(desk, state, "PG 1\nMR 51200\nE\nPG\n")
    assert not any(b"MR 51200" in frame for frame in desk.written)
    assert state.codec.em == 1


def test_a_line_too_long_for_this_drive_is_told_before_anything_is_sent(bench):
    desk, state = one_drive(bench, 1, True, 1)
    sent = len(desk.written)
    with pytest.raises(Inexpressible, match="^line 2: the line has 66 characters"):
        download(desk, state, f'PG 1\nPR "{"x" * 59}"\nPG\n')
    assert len(desk.written) == sent


def test_a_damaged_frame_in_program_mode_is_sent_again_to_the_same_address():
    state = MCodeState(MCode(em=0, checksum=1, escape=1))
    lines = program_file.read("PG 1\nMR 51200\nE\nPG\n", "x")
    procedure = ProcedureRunner(MCodeFamily(state).programs.download(lines, Held(), lambda done, total: None))
    asked = []
    replies = [
        Reply(prompt="1  "),
        Reply(end=End.NAK, prompt="1  "),
        Reply(prompt=">"),
        Reply(("0",), prompt=">"),
        Reply(prompt="1  "),
        Reply(prompt="6  "),
        Reply(prompt="8  "),
        Reply(prompt=">"),
    ]
    for reply in replies:
        asked.append(procedure.request.text)
        procedure.answer(reply)
    assert asked == ["PG 1", "MR 51200", "PG", 'PR ER,"~"', "PG 1", "MR 51200", "E", "PG"]
    assert procedure.request is None


def test_a_way_back_into_program_mode_that_is_not_seen_is_cleaned_up_after():
    state = MCodeState(MCode(em=0, checksum=1, escape=1))
    lines = program_file.read("PG 1\nMR 51200\nE\nPG\n", "x")
    procedure = ProcedureRunner(MCodeFamily(state).programs.download(lines, Held(), lambda done, total: None))
    for reply in (Reply(prompt="1  "), Reply(end=End.NAK, prompt="1  "), Reply(prompt=">"), Reply(("0",), prompt=">")):
        procedure.answer(reply)
    assert procedure.request.text == "PG 1"
    procedure.answer(Reply(end=End.DAMAGED))
    assert procedure.request.text == "PG" and state.programming


@pytest.mark.parametrize("line", range(8))
def test_a_stop_at_any_line_leaves_program_mode_and_restores_the_echo(bench, line):
    desk, state = one_drive(bench, 1, True, 1, baud=9600)
    stopped = []

    def stop(desk):
        if not stopped and len(desk.written) == 4 + line:
            stopped.append(desk.now)
            desk.line.stop(desk.now, StopPiece(b"\x1b"))
            desk.wire.receive(b"\x1b", desk.now)

    with pytest.raises(Stopped):
        download(desk, state, at=stop)
    assert stopped
    assert (state.programming, state.codec.em) == (False, 1)
    assert desk.devices["a"].programming is None
    assert desk.type(state, "PR P") == ("0",)


@pytest.mark.parametrize("seed", range(40))
def test_on_a_bad_line_a_download_is_right_or_says_that_it_is_not(bench, seed):
    desk, state = one_drive(bench, 1, True, 1, baud=9600)
    desk.devices["a"].execute("CE=0", desk.now)  # a flipped bit makes ^C of a C, and a reset forgets what is not saved
    disturb(desk.wire, Faults(flip=4e-3), seed)
    try:
        download(desk, state)
        whole = True
    except DriveError:
        whole = False
    disturb(desk.wire)
    device = desk.devices["a"]
    assert (device.programming is not None) is state.programming
    if whole:
        assert not state.programming
        listed = device.execute("L", desk.now).lines
        assert [line.split(None, 1)[1].upper() for line in listed] == ["LB G1", "MR 51200", "H", "R1=R1+1", "E"]
        assert device.execute("PR VM", desk.now).lines == ("400000",)
    assert device.position(desk.now) == 0
