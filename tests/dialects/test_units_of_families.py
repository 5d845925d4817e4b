"""What each family's lines take, and how many counts a turn has, from the manuals' own figures."""

import pytest

from multidrop.dialects.families import FAMILIES
from multidrop.dialects.units import Takes
from multidrop.families.lexium.host.units import counted, rests_on
from multidrop.families.lexium.manual.mnemonic import EVERY
from multidrop.families.tmcl.host.codec import Tmcl, TmclState


@pytest.mark.parametrize(
    ("product", "values", "steps", "turn"),
    [
        ("LMDOM", {"MS": "256", "RD": "0"}, None, 51_200),  # 7.3: 51200 microsteps are one revolution
        ("LMDOM", {"MS": "128", "RD": "0"}, None, 25_600),
        ("LMDOM", {"MS": "128", "RD": "0"}, 400, 51_200),
        ("LMDCM", {"MS": "256", "EE": "1", "AS": "0"}, None, 4000),  # 7.3: 1000 lines, 4000 counts
        ("LMDCM", {"MS": "256", "EE": "1", "AS": "2"}, None, 51_200),  # with hMT EE changes nothing
        ("LMM", {"MS": "256", "EE": "0", "SA": "0.9", "EL": "500"}, None, 102_400),
        ("LMM", {"MS": "256", "EE": "1", "SA": "1.8", "EL": "500"}, None, 2000),  # 5.1.38: 500 lines are 2000 counts
        ("MDIE", {"MS": "256", "EE": "1"}, None, 2048),
        ("MDIX", {"MS": "256", "EE": "1", "EL": "512"}, None, 2048),
    ],
)
def test_counts_of_a_turn(product, values, steps, turn):
    assert counted(product, values, steps).turn == turn


def test_an_unknown_product_tells_nothing_of_a_turn():
    assert rests_on("LMX") == ["MS"] and counted("LMX", {"MS": "256"}, None).turn is None


@pytest.mark.parametrize("product", sorted(EVERY))
def test_only_settings_of_the_product_are_asked(product):
    words = rests_on(product)
    assert "MS" in words and ("EE" in words) == (product not in ("LMDOM", "LMDOE", "MDI"))
    assert ("AS" in words) == product.startswith("LMDC") and ("SA" in words) == (product == "LMM")


TAKEN = [
    ("mcode", "MA {1 mm}", [("", Takes.PLACE, True)]),
    ("mcode", "mr={1 mm},1,1", [("", Takes.DISTANCE, True)]),
    ("mcode", "MR512", [("", Takes.DISTANCE, True)]),
    ("mcode", "  MR -5 ' back", [("", Takes.DISTANCE, True)]),
    ("mcode", "P={1 mm}", [("", Takes.PLACE, False)]),
    ("mcode", "SL {1 mm/s}", [("", Takes.VELOCITY, False)]),
    ("mcode", "VM={1 mm/s}", [("", Takes.SPEED, False)]),
    ("mcode", "D={1 mm/s2}", [("", Takes.ACCELERATION, False)]),
    ("modbus", "MA {1 mm}", [("", Takes.PLACE, True)]),
    ("pmx", "X{1 mm}", [("x", Takes.TARGET, True)]),
    ("pmx", "X1Y{1 mm}", [("x", Takes.TARGET, True), ("y", Takes.TARGET, True)]),
    ("pmx", "I{1 mm}:{2 mm}", [("x", Takes.TARGET, True), ("y", Takes.TARGET, True)]),
    ("pmx", "PY={1 mm}", [("y", Takes.PLACE, False)]),
    ("pmx", "LSPDX={1 mm/s}", [("x", Takes.SPEED, False)]),
    ("tmcl", "MVP ABS, 0, {1 mm}", [("", Takes.PLACE, True)]),
    ("tmcl", "mvp rel,0,{1 mm}", [("", Takes.DISTANCE, True)]),
    ("tmcl", "ROR 0, {1 mm/s}", [("", Takes.VELOCITY, False)]),
    ("tmcl", "SAP 0, 0, {1 mm}", [("", Takes.PLACE, True)]),
    ("tmcl", "SAP 5, 0, {1 mm/s2}", [("", Takes.ACCELERATION, False)]),
]
NOT_TAKEN = {
    "mcode": ("D1={1 mm}", "R1={1 mm}", "MA {1 mm}+5", "MA P+5", "PR {1 mm}", "MS={1 mm}", "EX {1 mm}", "MA", "D1=5"),
    "pmx": ("x{1 mm}", "ACCX={1 mm}", "HSPD={1 mm/s}", "V1={1 mm}", "TX{1 mm}", "JX+", ""),
    "tmcl": ("ROL 0, {1 mm/s}", "MVP COORD, 0, {1 mm}", "SAP 6, 0, {1 mm}", "SGP 0, 2, {1 mm}", "4 0, 0, {1 mm}"),
}


@pytest.mark.parametrize(("family", "line", "found"), TAKEN)
def test_what_a_line_takes(family, line, found):
    state = FAMILIES[family].new_state(FAMILIES[family].codec, "1")
    fields = FAMILIES[family](state).units.fields(line)
    assert [(each.axis, each.takes, each.moves) for each in fields] == found
    assert all(line[each.start : each.stop].strip("{}")[0] in "-0123456789" for each in fields)


@pytest.mark.parametrize("family", NOT_TAKEN)
def test_any_other_place_takes_none(family):
    state = FAMILIES[family].new_state(FAMILIES[family].codec, "1")
    assert [line for line in NOT_TAKEN[family] if FAMILIES[family](state).units.fields(line)] == []


def test_motors_of_a_module_are_axes():
    state = TmclState(Tmcl(), "1")
    state.motors_counted(3)
    units = FAMILIES["tmcl"](state).units
    assert list(units.axes()) == ["0", "1", "2"]
    assert [each.axis for each in units.fields("MVP ABS, 2, {1 mm}")] == ["2"]
    assert units.reads("GAP 1, 2") == ("2", Takes.PLACE) and units.disturbs("SAP 140, 1, 4") == ("1",)


def test_lines_after_which_positions_count_from_elsewhere():
    lines = ("P=0", "P 5", "C1=5", "MS=128", "EE=1", "RD=1", "IC P", "FD", "IP", "SA=0.9")
    state = FAMILIES["mcode"].new_state(FAMILIES["mcode"].codec, "a")
    disturbs = FAMILIES["mcode"](state).units.disturbs
    assert [line for line in lines if not disturbs(line)] == []
    assert [line for line in ("PR P", "MA 0", "VM=5000", "R1=5", "PR MS", "IC R1") if disturbs(line)] == []


SETS = {
    "mcode": ("MS=128", "ms 128", "EE=1", "AS 1", "RD=1", "SA=0.9", "EL=500", "FD", "IP"),
    "modbus": ("MS=128", "EE=1", "IP"),
    "pmx": ("SLX=1", "POLY=1", "SLY=0"),
    "tmcl": ("SAP 140, 0, 5", "SAP 154, 0, 3", "RSAP 140, 0", "sap 153, 0, 7"),
}
LEAVES = {
    "mcode": ("PR MS", "P=0", "VM=5000", "MR 128", 'PR "MS=1"', "R1=5", "S"),
    "modbus": ("VM=5000", "MR 128", "P=0", "PR MS"),
    "pmx": ("SLX", "PX=0", "HSPDX=1000", "X1000", "SLAX=5", "POLX"),
    "tmcl": ("SAP 4, 0, 500", "GAP 140, 0", "STAP 140, 0", "MVP ABS, 0, 140", "SAP 1, 0, 0"),
}


def first_request(family, line):
    """The request that carries a line, after those that are asked before it."""
    record = FAMILIES[family]
    address = {"mcode": "a", "modbus": "", "pmx": "00", "tmcl": "1"}[family]
    state = record.new_state(record.codec, address)
    state.identified("LMDCE" if family == "modbus" else "TMCM-1140" if family == "tmcl" else "LMDCM", "")
    return next(record(state).perform(line))


@pytest.mark.parametrize("family", SETS)
def test_requests_after_which_a_count_may_have_another_length(family):
    record = FAMILIES[family]
    recounts = record(record.new_state(record.codec, "")).units.recounts
    assert [line for line in SETS[family] if not recounts(first_request(family, line))] == []
    assert [line for line in LEAVES[family] if recounts(first_request(family, line))] == []


def test_a_register_that_is_written_by_its_number_counts_as_its_word():
    record = FAMILIES["modbus"]
    for address, values, counts in ((0x48, [128], True), (0x47, [0, 128], True), (0x87, [128], False)):
        state = record.new_state(record.codec, "")
        state.identified("LMDCE", "")
        assert record(state).units.recounts(next(record(state).registers.write(address, values))) is counts
