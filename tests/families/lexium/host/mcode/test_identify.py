"""Finding drives: nothing moves, nothing is refused or saved, and nobody else's answer is taken for a drive's."""

from dataclasses import replace

import pytest

from multidrop.base.errors import Inexpressible, NoAnswer
from multidrop.dialects import Hints, Reply
from multidrop.drives.line import Line
from multidrop.families.lexium.host.mcode import identity
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.simulator.cell.spec import Faults
from tests.support.faults import disturb
from tests.support.mcode_drives import MODES, Witness

SEVERAL = [(em, check) for em in range(4) for check in range(3)]


def opened(bench, *tables, hints=None, before=()):
    desk = bench(list(tables))
    device = next(iter(desk.devices.values()))
    for text in before:
        assert not device.execute(text, 0.0).refused, text
    found = desk.run(MCodeFamily.identify(hints or Hints()))
    return desk, device, found


@pytest.mark.wide
@pytest.mark.parametrize("line", ["PR 2", 'PR "1.5"', 'PR "EM=",R1', 'PR "?"', 'PR ">"', 'PR "0";', 'PR P," ",V'])
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in range(3)])
def test_a_program_that_prints_all_the_time_is_not_mistaken_for_answers(bench, em, check, line):
    program = ("PG 1", "LB G1", line, "H 20", "BR G1", "E", "PG", "EX G1")
    _, device, [state] = opened(bench, {"set": {"EM": em, "CK": check, "ES": 3}}, before=program)
    assert state.codec == MCode(em=em, checksum=check, escape=3)
    assert (state.product, state.name, state.error, device.memory.error_flag) == ("LMDCM", "!", False, False)


def test_half_a_line_on_a_party_line_is_not_executed_by_opening(bench):
    desk = bench([{"name": "a", "party": True}])
    desk.wire.receive(b"\n\naMR 51200", 0.0)
    desk.wait(0.1)
    [state] = desk.run(MCodeFamily.identify(Hints(drives=("a",), party=True)))
    assert state.product == "LMDCM"
    assert not desk.devices["a"].moving(desk.now) and desk.devices["a"].position(desk.now) == 0


def test_a_drive_named_p_is_taken_for_one_on_a_party_line(bench):
    desk, device, [state] = opened(bench, {"name": "P", "party": True}, hints=Hints(drives=("P",)))
    assert state.address == "P" and not device.memory.error_flag


def test_a_lost_answer_does_not_lead_to_a_checksum_that_the_drive_would_refuse(bench):
    for seed in range(40):
        desk = bench([{"name": "a", "party": True, "set": {"EM": 1}}], baud=9600)
        disturb(desk.wire, Faults(drop=0.002), seed)
        try:
            desk.run(MCodeFamily.identify(Hints(drives=("a",))))
        except NoAnswer:
            continue
        assert [frame for frame in desk.written if frame[:1] == b"a" and max(frame) > 0x7F] == [], seed


# --- names


def test_a_name_of_two_characters_is_refused_before_anything_is_sent(bench):
    """A drive named `a` would take `abPR VR` for its own `bPR VR`, and set its error flag."""
    for cut in (False, True):
        desk = bench([{"name": "a", "party": True}, {"name": "b", "party": True}])
        with pytest.raises(Inexpressible, match="no drive name 'ab'"):
            desk.run(MCodeFamily.identify(Hints(drives=("a", "ab"), cut=cut)))
        assert desk.written == [] and not any(device.memory.error_flag for device in desk.devices.values())


@pytest.mark.wide
@pytest.mark.parametrize("names", ["PES", "SE", "abc", "!1"])
@pytest.mark.parametrize(("em", "check"), SEVERAL)
def test_several_drives_are_found_as_each_is_set_and_only_print(bench, names, em, check):
    tables = [{"name": n, "party": True, "set": {"EM": em, "CK": check, "ES": i}} for i, n in enumerate(names)]
    desk = bench(tables, baud=9600)
    devices = list(desk.devices.values())
    witnesses = [Witness(device) for device in devices]
    before = [(dict(device.memory.values), repr(device.nvm.store)) for device in devices]
    found = desk.run(MCodeFamily.identify(Hints(drives=tuple(names))))
    expected = [MCode(em=em, party=True, checksum=check, escape=i) for i in range(len(names))]
    assert [state.codec for state in found] == expected
    assert [(dict(device.memory.values), repr(device.nvm.store)) for device in devices] == before
    for device, witness in zip(devices, witnesses, strict=True):
        assert {(text[:3], refused, stored) for text, refused, stored in witness.lines} == {("PR ", False, False)}
        assert not device.memory.error_flag and device.position(desk.now) == 0


@pytest.mark.parametrize("name", "PES")
@pytest.mark.parametrize("party", [None, True])
def test_a_drive_named_like_a_command_is_found_on_a_party_line(bench, name, party):
    desk = bench([{"name": name, "party": True}])
    desk.wire.receive(b"\n\n", 0.0)
    [device] = desk.devices.values()
    witness = Witness(device)
    [state] = desk.run(MCodeFamily.identify(Hints(drives=(name,), party=party)))
    assert (state.address, state.product, device.memory.error_flag) == (name, "LMDCM", False)
    assert all(text.startswith("PR ") for text, _, _ in witness.lines)


@pytest.mark.parametrize("name", "PES")
def test_a_drive_named_like_a_command_that_is_alone_is_found(bench, name):
    desk = bench([{"name": name}])
    [state] = desk.run(MCodeFamily.identify(Hints(drives=(name,), party=False)))
    assert (state.address, state.name, state.product) == ("", name, "LMDCM")
    assert not desk.devices[name].memory.error_flag


def test_what_helps_where_a_single_drive_named_p_is_not_in_party_mode_is_said(bench):
    desk = bench([{"name": "P"}])
    with pytest.raises(NoAnswer, match="party=0"):
        desk.run(MCodeFamily.identify(Hints(drives=("P",))))
    assert not desk.devices["P"].memory.error_flag


@pytest.mark.parametrize("name", ["", "a"])
@pytest.mark.parametrize(("em", "check"), SEVERAL)
def test_a_slow_line_behind_a_gateway_is_opened_though_its_baud_rate_is_not_known(bench, em, check, name):
    desk = bench([{"name": name or "!", "party": bool(name), "set": {"EM": em, "CK": check}}], baud=1200)
    desk.line = Line(MCode())
    [state] = desk.run(MCodeFamily.identify(Hints(drives=("a",), party=True) if name else Hints()))
    assert (state.product, state.codec.em, state.codec.checksum) == ("LMDCM", em, check)
    assert not next(iter(desk.devices.values())).memory.error_flag


# --- bad wires


@pytest.mark.slow
def test_nothing_is_misread_on_a_bad_wire_and_nothing_but_prints_is_executed(bench, nightly):
    found, rounds = [], 6 if nightly else 3
    for number, (em, party, check) in enumerate(rounds * MODES):
        names = "ab" if party else "!"
        tables = [{"name": n, "party": party, "set": {"EM": em, "CK": check, "ES": 2 - i}} for i, n in enumerate(names)]
        desk = bench(tables, baud=9600)
        witnesses = [Witness(device) for device in desk.devices.values()]
        disturb(desk.wire, Faults(flip=3e-3, drop=1e-3, delay=(0.0, 0.01)), number)
        try:
            knowns = desk.run(MCodeFamily.identify(Hints(drives=tuple(names) if party else ())))
        except NoAnswer:
            knowns = []
        for i, state in enumerate(knowns):
            if state.product and not state.settings_unknown:
                assert state.codec == MCode(em=em, party=party, checksum=check, escape=2 - i), number
                assert state.product.startswith("LM"), number  # nothing tells a damaged letter without a checksum
                found.append(state)
        for text, refused, stored in (line for witness in witnesses for line in witness.lines):
            assert refused or text[:2].upper() in ("PR", ""), (number, text)
            assert not stored
    assert len(found) > 25 * rounds


@pytest.mark.parametrize(
    ("said", "version"),
    [
        (b"\r\n3.010", "3.010"),
        (b"LMDCM 6.002, Hw: 3.2", "LMDCM 6.002, Hw: 3.2"),
        (b"000LMDCM 6.002, Hw: 3.2", "LMDCM 6.002, Hw: 3.2"),
        (b"\r\nLM#CM 6.002, Hw: 3.2", None),
        (b"\r\nLMDCM\xa06.002, Hw: 3.2", None),
    ],
)
def test_a_version_that_lost_its_head_is_not_taken_for_an_older_product(said, version):
    talk = MCodeFamily.identify(Hints(party=False))
    request = next(talk)
    mark = request.text.rpartition(",")[2].strip('"').encode()
    following = talk.send(Reply(raw=said + b">LMDCM853>110>110" + mark + b"\r\n"))
    asked = {None: "PR VR", "3": 'PR "<",DN,">","~', "L": 'PR "<",DN,">",SN,"~'}
    assert following.text.startswith(asked[version and version[0]])


@pytest.mark.parametrize("offset", range(10))
def test_another_host_on_the_line_does_not_mislead(bench, offset):
    desk = bench([{"name": n, "party": True, "set": {"EM": 1, "ES": i}} for i, n in enumerate("ab")], baud=38400)
    desk.wire.receive(b"\n\n", 0.0)
    desk.wait(0.1)
    due = [0.1 + 0.0037 * offset + 0.0637 * n for n in range(400)]

    def poll(desk):
        while due and desk.now >= due[0]:
            due.pop(0)
            desk.wire.receive(b'bPR P,"b ",V\n', desk.now)

    found = desk.run(MCodeFamily.identify(Hints(drives=("a", "b"))), at=poll)
    for i, state in enumerate(found):
        assert state.settings_unknown or state.codec == MCode(em=1, party=True, escape=i)
        assert state.product in ("", "LMDCM")
    assert any(state.product for state in found) and len(due) < 399


def test_a_name_that_a_stop_needs_and_that_could_not_be_read_is_said(bench):
    desk = bench([{"name": "q", "set": {"ES": 3, "EM": 1}}])

    def cut(desk):
        if b"DN" in desk.written[-1]:
            disturb(desk.wire, Faults(drop=1.0), 0)

    [state] = desk.run(MCodeFamily.identify(Hints()), at=cut)
    assert state.codec.escape == 3 and state.name == ""
    assert any("its name could not be read" in note and "ES=3" in note for note in state.notes)


HALVES = ["MR 51200", "MA", "SL 100", "S", "E", "EX ", "P=5", "R1=", "EM=", "CK=1", "PY", "PR"]


@pytest.mark.wide
@pytest.mark.parametrize("half", HALVES)
@pytest.mark.parametrize(("em", "check"), [(0, 0), (1, 0), (2, 1)])
@pytest.mark.parametrize("name", ["", "a"])
def test_half_a_line_in_a_drives_buffer_becomes_no_command_by_opening(bench, half, em, check, name):
    desk = bench([{"name": name or "!", "party": bool(name), "set": {"EM": em, "CK": check}}])
    [device] = desk.devices.values()
    witness = Witness(device)
    desk.wire.receive((b"\n\n" if name else b"") + (name + half).encode(), 0.0)
    desk.wait(0.1)
    [state] = desk.run(MCodeFamily.identify(Hints(drives=(name,) if name else ())))
    assert state.product == "LMDCM"
    assert {text[:3] for text, refused, _ in witness.lines if not refused} == {"PR "}


@pytest.mark.wide
@pytest.mark.parametrize("line", ['PR ""', 'PR "?";'])
@pytest.mark.parametrize(("em", "check"), [(0, 0), (1, 0), (3, 2)])
@pytest.mark.parametrize("every", [20, 90])
def test_a_drive_that_prints_all_the_time_is_not_mistaken_for_one_that_is_not_there(bench, line, em, check, every):
    desk = bench([{"name": "b", "party": True, "set": {"EM": em, "CK": check}}], baud=19200)
    device = desk.devices["b"]
    for text in ("PG 1", "LB G1", line, f"H {every}", "BR G1", "E", "PG", "EX G1"):
        assert not device.execute(text, 0.0).refused
    absent, present = desk.run(MCodeFamily.identify(Hints(drives=("a", "b"))))
    assert (absent.product, absent.settings_unknown, absent.notes) == ("", True, ["a does not reply"])
    assert (present.product, present.settings_unknown, device.memory.error_flag) == ("LMDCM", False, False)


# --- MDrivePlus


@pytest.mark.wide
@pytest.mark.parametrize("personality", ["MDI", "MDIE", "MDIX"])
@pytest.mark.parametrize(("em", "check"), SEVERAL)
@pytest.mark.parametrize("name", ["", "a"])
def test_version_and_part_number_tell_an_mdriveplus_from_another(bench, personality, em, check, name):
    party = {"name": name, "party": True} if name else {}
    table = {"personality": personality, "set": {"EM": em, "CK": check}, **party}
    hints = Hints(drives=("a",)) if name else Hints()
    desk = bench([table])
    (device,) = desk.devices.values()
    witness = Witness(device)
    (state,) = desk.run(MCodeFamily.identify(hints))
    assert (state.product, state.version) == (personality, "3.010") and state.part.endswith(device.memory.model.part)
    assert all(text.startswith("PR ") and not refused for text, refused, _ in witness.lines)


@pytest.mark.parametrize(
    ("part", "product"),
    [
        ("MDI1FRD23A7", "MDI"), ("MDI1FRD23A7-N", "MDI"), ("MDI1FRD23A7-EQ", "MDIE"), ("MDI1PRQ34B7-N-EQ", "MDIE"),
        ("MDI3CRL23C7-EQ", "MDIX"), ("MDI4MRQ17C4", "MDIX"), ("", "MDI"), ("something else", "MDI"),
    ],
)  # fmt: skip
def test_a_part_number_that_says_nothing_is_that_of_a_base_unit(part, product):
    assert identity.mdrive(part) == product


@pytest.mark.parametrize(("em", "check"), [(1, 0), (2, 0), (0, 1), (2, 2)])
def test_names_that_are_likely_are_tried_before_anything_is_absent_and_nothing_moves(bench, em, check):
    tables = [{"name": name, "party": True, "set": {"EM": em, "CK": check, "ES": 3}} for name in "ab"]
    desk, _, [state] = opened(bench, *tables, hints=Hints(tried=("b", "left")))
    assert (state.address, state.product) == ("b", "LMDCM")
    assert not any(device.memory.error_flag or device.moving(desk.now) for device in desk.devices.values())
    last = MCodeFamily(state).remember()
    both = (replace(last, address="z", name="z"), last, replace(last, address="a", name="a"))
    found = desk.run(MCodeFamily.identify(Hints(remembered=both)))
    assert [each.address for each in found] == ["a", "b", "z"]  # the first is selected, whichever was used last
    assert [each.unconfirmed is None for each in found] == [True, True, False]
    assert MCodeFamily(found[2]).remember() == both[0] and "z replied here last time" in found[2].notes[0]
    assert not any(device.memory.error_flag for device in desk.devices.values())


def test_a_drive_alone_is_found_though_the_line_was_a_party_line_last_time(bench):
    desk, _, [state] = opened(bench, {"name": "b", "party": True}, hints=Hints(tried=("b",)))
    alone, device, [found] = opened(bench, {"set": {"EM": 1}}, hints=Hints(remembered=(MCodeFamily(state).remember(),)))
    assert (found.address, found.product, device.memory.error_flag) == ("", "LMDCM", False)
    assert alone.devices


def test_a_motion_module_is_known_as_one_whatever_its_version_adds_to_the_name(bench):
    """The manual prints LMMCM (5.1.141); its own words are those of the Motion Module."""
    for version in ("LMMCM 6.002, Hw: 3.2", "LMMOM 5.009, Hw: 3.1", "LMM 6.002"):
        _, _, [state] = opened(bench, {"personality": "LMM", "identity": {"version": version}})
        assert (state.product, state.version) == ("LMM", version)
