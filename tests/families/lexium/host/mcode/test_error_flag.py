"""Units that say NAK to everything while an error stands, and carry it out (MDrivePlus with a checksum)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import DriveError, NoAnswer, Refused
from multidrop.dialects import End, Hints, Priority
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.framing import sealed
from tests.support.mcode_drives import Witness, one_drive

MODES = [(em, party, check) for em in range(4) for party in (False, True) for check in (1, 2)]
NAK = b"\x15"


def unit(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check, "MDI", personality="MDI")
    [device] = desk.devices.values()
    return desk, state, device, Witness(device)


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_while_an_error_stands_values_are_read_and_it_is_told_before_the_next_command(bench, em, party, check):
    desk, state, device, witness = unit(bench, em, party, check)
    device.fail(86, desk.now)
    assert desk.type(state, "PR R1") == ("0",)
    assert desk.run(desk_motion(state)).position == 0
    assert device.memory.error_flag and state.error is (em != 2)
    state.error = True
    assert desk.type(state, "R1=5") == ()
    assert any("error 86" in note and "an old error" in note for note in desk.notes)
    assert len(witness.executed("R1=5")) == 1 and desk.type(state, "PR R1") == ("5",)
    assert desk.type(state, "PR ER") == ("0",)


def desk_motion(state):
    [axis] = yield from MCodeFamily(state).motion(Priority.POLL)
    return axis


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_an_error_that_comes_by_itself_leaves_open_what_a_nak_says(bench, em, party, check):
    desk, state, device, witness = unit(bench, em, party, check)
    desk.type(state, "R1=4")
    device.fail(86, desk.now)  # and the host does not know
    try:
        desk.type(state, "R1=5")
    except NoAnswer as error:
        assert "not known whether" in str(error) and em != 2
    except Refused as error:  # EM=2 shows no NAK, and asks EF
        assert "came by itself" in str(error) and em == 2
    assert len(witness.executed("R1=5")) == 1
    assert len([frame for frame in desk.written if b"R1=5" in frame]) == 1


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_refusal_is_one_where_the_flag_was_clear(bench, em, party, check):
    desk, state, device, _ = unit(bench, em, party, check)
    with pytest.raises(Refused, match="error 21"):
        desk.type(state, "RC=500")
    assert not device.memory.error_flag
    assert desk.type(state, "R1=5") == ()


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_it_is_opened_while_an_error_stands_and_that_is_said(bench, em, party, check):
    name = "a" if party else "!"
    desk = bench([{"personality": "MDI", "name": name, "party": party, "set": {"EM": em, "CK": check, "ES": 1}}])
    device = desk.devices[name]
    device.fail(86, 0.0)
    hints = Hints(drives=("a",), party=True) if party else Hints()
    [state] = desk.run(MCodeFamily.identify(hints))
    assert state.codec == MCode(em=em, party=party, checksum=check, escape=1)
    assert state.error and device.memory.error_flag and state.product.startswith("MDI")
    assert any("EF=1" in note for note in state.notes)


@given(
    em=st.sampled_from([1, 2, 3]),
    check=st.sampled_from([1, 2]),
    cuts=st.lists(st.integers(1, 40), max_size=4),
    head=st.sampled_from([b"", NAK, b"\x06"]),
    value=st.integers(-(2**31), 2**31 - 1),
)
def test_a_nak_in_front_of_an_answer_is_read_however_the_bytes_come(em, check, cuts, head, value):
    codec = MCode(em=em, checksum=check)
    request = codec.request("", "PR ER")
    if em == 2:
        head = b""
    data = (sealed(b"PR ER") if em == 3 else b"") + head + sealed(str(value).encode()) + b"\r\n"
    for cut in cuts:
        assert codec.decode(request, data[: cut % len(data)]) is None
    found = codec.decode(request, data) or codec.on_quiet(request, data)
    if head or em == 2 or check == 2:
        assert (found.reply.end, found.reply.lines) == (End.DONE, (str(value),))
        assert found.reply.flagged is (head == NAK)
    else:
        assert found is None or found.reply.lines == ()  # nothing before the ACK is taken


def test_the_bytes_of_a_client_of_real_units():
    codec = MCode(em=1, checksum=1)
    found = codec.decode(codec.request("", "PR ER"), bytes.fromhex("15 32 33 9B 0D 0A"))
    assert (found.reply.lines, found.reply.flagged, found.reply.end) == (("23",), True, End.DONE)


def test_a_damaged_command_is_repeated_while_the_flag_is_clear_and_executed_once(bench):
    desk, state, _, witness = unit(bench, 1, False, 1)
    whole = desk.wire.receive

    def once_damaged(data, now):
        desk.wire.receive = whole
        whole(data.replace(b"R1=5", b"R1=7"), now)

    desk.wire.receive = once_damaged
    try:
        assert desk.type(state, "R1=5") == ()
    except DriveError as error:
        pytest.fail(str(error))
    assert len(witness.executed("R1=5")) == 1 and witness.executed("R1=7") == []
