"""Commands that no sign of the drive confirms: what their effect shows, and what is said where it shows nothing."""

import pytest

from multidrop.base.errors import NoAnswer, Refused
from multidrop.families.lexium.host.mcode.operations import written
from tests.support.mcode_drives import Desk

NOT_CONFIRMED = "its execution is not confirmed"


def losing(desk, text):
    """Lose the frames with that text on their way, and nothing else."""
    receive = desk.bench.wire.receive
    desk.bench.wire.receive = lambda data, now: None if text.encode() in data else receive(data, now)


def quiet(bench, check=0, party=False):
    return Desk(bench, (2, check), party=party)


def remarks(desk):
    return [note for note in desk.bench.notes if NOT_CONFIRMED in note]


@pytest.mark.parametrize("text", ["VM=400000", "R1=-5", "A 200000", "MT=0"])
@pytest.mark.parametrize(("check", "party"), [(0, False), (1, True), (2, False)])
def test_a_setting_is_read_back_in_em_2(bench, text, check, party):
    desk = quiet(bench, check, party)
    desk.type(text)
    assert len(desk.witness.executed(text)) == 1 and not remarks(desk)


def test_a_setting_that_is_lost_is_reported_and_not_sent_again(bench):
    desk = quiet(bench, 1)
    losing(desk, "VM=400000")
    with pytest.raises(NoAnswer, match="VM reads 768000 after 'VM=400000': it is not known whether it was executed"):
        desk.type("VM=400000")
    assert sum(b"VM=400000" in frame for frame in desk.bench.written) == 1


@pytest.mark.parametrize("text", ["MR 51200", "MA 51200", "SL 10000"])
def test_a_drive_that_moves_after_it_stood_has_executed_the_motion(bench, text):
    desk = quiet(bench, 1)
    desk.type(text)
    assert len(desk.witness.executed(text)) == 1 and not remarks(desk)


@pytest.mark.parametrize("text", ["MR 51200", "EX 1", "S", "IC R1", "H"])
def test_what_is_lost_and_cannot_be_read_is_reported_as_not_confirmed(bench, text):
    desk = quiet(bench, 1)
    losing(desk, text)
    desk.type(text)
    assert not desk.witness.executed(text) and len(remarks(desk)) == 1
    assert sum(text.encode() in frame for frame in desk.bench.written) == 1


def test_a_motion_that_changes_another_is_reported_as_not_confirmed(bench):
    desk = quiet(bench)
    desk.type("SL 10000")
    desk.type("SL 20000")
    assert len(remarks(desk)) == 1 and "'SL 20000'" in remarks(desk)[0]


def test_what_a_program_writes_is_no_loss(bench):
    desk = quiet(bench)
    for line in ("PG 1", "LB G1", "R1=7", "BR G1", "E", "PG", "EX G1"):
        desk.device.execute(line, desk.bench.now)
    desk.type("R1=5")
    assert len(remarks(desk)) == 1


def test_a_refusal_is_still_seen_in_em_2(bench):
    desk = quiet(bench)
    with pytest.raises(Refused):
        desk.type("VM=5000000000")
    assert not remarks(desk)


@pytest.mark.parametrize("text", ["MR 100", "VM=400000"])
def test_a_late_ack_of_another_drive_confirms_nothing(bench, text):
    desk = Desk(bench, (1, 1), (1, 1), party=True)
    receive = desk.bench.wire.receive

    def instead(data, now):
        if text.encode() in data:
            desk.bench.line.receive(b"\x06", now)
        elif b"R1=3" not in data:
            receive(data, now)

    desk.bench.wire.receive = instead
    with pytest.raises(NoAnswer):
        desk.type("R1=3", drive=1)
    if text == "MR 100":
        desk.type(text)
        assert len(remarks(desk)) == 1
    else:
        with pytest.raises(NoAnswer, match="VM reads 768000 after"):
            desk.type(text)
    assert not desk.witness.executed(text)


def test_em_1_reads_nothing_back(bench):
    desk = Desk(bench, (1, 1))
    desk.type("VM=400000")
    desk.type("MR 100")
    assert [frame.rstrip(b"\r")[:-1] for frame in desk.bench.written] == [b"VM=400000", b"MR 100"]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("VM=400000", ("VM", 400000)),
        ("vm 400000", ("VM", 400000)),
        ("R1=-5", ("R1", -5)),
        ("P=5", None),  # a position moves on by itself
        ("R1=R2", None),
        ("R1=5+1", None),
        ("IS=1,2,0", None),
        ("MR 5", None),
        ("Q7=5", None),  # a name that the drive may not have: reading it would be an error
        ("PR VM", None),
        ("VM", None),
    ],
)
def test_only_what_prints_as_it_was_written_is_read_back(text, found):
    assert written(text) == found
