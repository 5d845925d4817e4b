"""Every setting of a drive is read in few bytes, without a side effect."""

from types import SimpleNamespace

import pytest

from multidrop.dialects.values import IO, VARIABLES, Permission
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.manual import parameters as manual
from multidrop.families.lexium.manual.point_types import types
from multidrop.families.lexium.simulator.state.models import MODELS
from multidrop.simulator.cell.spec import Faults
from tests.support.direct_drive import DirectDrive
from tests.support.mcode_drives import MODES, Desk

PRODUCTS = ("LMDOM", "LMDCM", "LMM", "MDI", "MDIE", "MDIX")


def nothing(done, total):
    pass


def desk_of(bench, product, em, party, check, **more):
    desk = Desk(bench, (em, check), party=party, personality=product, **more)
    model = MODELS[product]
    desk.state.identified(product, model.version, model.part)
    desk.state.signature_seen(True)
    return desk


def read(desk, progress=nothing):
    return desk.bench.run(MCodeFamily(desk.state).values.parameters.read(progress), desk.state)


def direct(product="LMDCM", *lines, program=""):
    one = DirectDrive(product, *lines, program=program)
    return one, one.run(MCodeFamily(one.state).values.parameters.read(nothing))


def _agrees_with_the_drive(product, em, party, check, bench):
    desk = desk_of(bench, product, em, party, check)
    before = len(desk.witness.lines)
    steps = []
    found = read(desk, lambda *each: steps.append(each))
    held = desk.device.memory.values
    wanted = {each.name for each in manual.settings(product)}
    assert wanted <= found.values.keys()
    assert all(found.values[name] == held[name] for name in wanted if name in held)
    lines = desk.witness.lines[before:]
    assert [line for line in lines if line[1]] == [] and not any("ER" in line[0] for line in lines)
    assert steps[0][0] == 0 and steps[-1][0] == steps[-1][1]
    assert desk.bench.notes == [] and desk.bench.strays == []


@pytest.mark.parametrize("product", PRODUCTS)
def test_all_settings_are_read_and_nothing_is_refused(bench, product):
    _agrees_with_the_drive(product, 1, True, 1, bench)


@pytest.mark.parametrize(("em", "party", "check"), [(0, False, 0), (2, True, 0), (3, False, 1), (0, True, 2)])
def test_settings_are_read_in_every_echo_mode(bench, em, party, check):
    _agrees_with_the_drive("LMDCM", em, party, check, bench)


@pytest.mark.wide
@pytest.mark.parametrize(("em", "party", "check"), MODES)
@pytest.mark.parametrize("product", PRODUCTS)
def test_settings_are_read_in_every_mode_of_every_product(bench, product, em, party, check):
    _agrees_with_the_drive(product, em, party, check, bench)


def test_an_ethernet_drive_is_not_asked_for_what_it_refuses():
    one, found = direct("LMDCE")
    assert one.refused == [] and not {"DN", "PY", "CK", "BD"} & found.values.keys()
    assert {"EM", "ES", "CE"} <= {each.name for each in found.readings if each.fixed}


@pytest.mark.parametrize(("em", "check"), [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0)])
@pytest.mark.parametrize("product", ["LMDCM", "MDI"])
def test_an_old_error_is_neither_cleared_nor_in_the_way(bench, product, em, check):
    desk = desk_of(bench, product, em, False, check)
    desk.device.execute("XYZ", desk.bench.now)
    code = desk.device.memory.values["ER"]
    found = read(desk)
    assert code and desk.device.memory.values["ER"] == code and desk.device.memory.error_flag
    assert {each.name for each in manual.settings(product)} <= found.values.keys()


def test_units_defaults_and_sections():
    _, found = direct("LMDCM", "IS=1,2,1", "VA Q1=25", "R2=7", "PF=8,2,0,1", "LS=1,500,1", program="PG 1\nLB G1\nE\nPG")
    rows = {each.name: each for each in found.readings}
    assert (rows["VM"].value, rows["VM"].unit, rows["VM"].default) == (768000, "steps/s", 768000)
    assert (rows["IS1"].value, rows["IS1"].section, rows["IS1"].default) == ((2, 1), IO, (0, 0))
    assert (rows["Q1"].value, rows["Q1"].section) == (25, VARIABLES)
    assert rows["R2"].section == VARIABLES and rows["PF"].value == (8, 2, 0, 1) and rows["LS1"].value == (500, 1)
    assert found.labels == ("G1",)
    assert {"OE", "IS5"} <= dict(found.unread).keys()
    assert not {"P", "C1", "ER", "TE", "ST"} & rows.keys()


def test_with_encoder_counts_units_and_defaults_are_those_of_counts():
    _, found = direct("LMDCM", "EE=1")
    row = next(each for each in found.readings if each.name == "VM")
    assert (row.value, row.unit, row.default) == (60000, "counts/s", 60000)
    assert any(name == "A, D, MS, VI and VM for steps" for name, _ in found.unread)


def test_words_of_firmware_6_are_not_asked_of_an_older_one():
    names = {each.name for each in manual.settings("LMDCM", "LMDCM 5.007, Hw: 3.2")}
    assert (
        "VM" in names
        and not names & {"AJ", "DT", "BL", "F1", "FM", "PF", "RA"}
        and "LS" not in manual.lists("LMDCM", "LMDCM 5.007")
    )


def test_a_small_motor_is_not_asked_for_the_inputs_that_it_lacks():
    names = {each.name for each in manual.settings("LMDCM", "LMDCM 6.002", "LMDCM421")}
    assert "FM" in names and not names & {"D4", "FC", "TC"}


def test_a_refused_line_is_said_and_not_asked_in_pieces():
    one = DirectDrive("LMDOM")
    one.state.identified("LMDCM", "LMDCM 6.002", "")
    found = one.run(MCodeFamily(one.state).values.parameters.read(nothing))
    refused = [name for name, reason in found.unread if "refuses" in reason]
    assert "AS" in refused and len(set(one.refused)) == len(one.refused)
    assert one.device.memory.error_flag


def test_a_print_in_an_unknown_form_takes_no_other_setting_with_it():
    one = DirectDrive("LMDCM")
    execute = one.device.execute

    def odd(text, now):
        answer = execute(text, now)
        wrong = "TI" in text and not answer.refused
        return SimpleNamespace(lines=("TI is odd",) if wrong else answer.lines, refused=answer.refused)

    one.device.execute = odd
    found = one.run(MCodeFamily(one.state).values.parameters.read(nothing))
    assert {"VM", "PF", "F1", "MS"} <= found.values.keys() and {"TI", "TR"} <= dict(found.unread).keys()


def test_a_product_of_unknown_name_is_asked_for_what_every_lexium_has():
    one = DirectDrive("LMDCM")
    one.state.identified("LMDXX", "LMDXX 6.002", "")
    found = one.run(MCodeFamily(one.state).values.parameters.read(nothing))
    assert one.refused == [] and {"VM", "IS1"} <= found.values.keys() and "AS" not in found.values
    plan = MCodeFamily(one.state).values.parameters.plan(found, {"VM": 5000, "MS": 16}, Permission())
    assert [change.text for change in plan] == ["MS=16", "VM=5000"]


def test_losses_on_a_noisy_line_are_asked_again(bench):
    desk = desk_of(bench, "LMDCM", 1, True, 1, baud=9600, faults=Faults(drop=2e-3), seed=4)
    assert {each.name for each in manual.settings("LMDCM")} <= read(desk).values.keys()


@pytest.mark.parametrize("product", MODELS)
def test_the_types_of_points_are_those_of_the_drive(product):
    points = MODELS[product].points
    for n, kinds in points.input_types.items():
        assert kinds <= types(f"{'S' if points.shared else 'IS'}{n}", product), n
    for n, kinds in points.output_types.items():
        own = kinds if points.shared or product in ("LMDCM", "LMDCE") else kinds - {21, 24, 25}
        assert own <= types(f"{'S' if points.shared else 'OS'}{n}", product), n


@pytest.mark.parametrize(("bd", "rate"), [(48, 4800), (96, 9600), (19, 19200), (38, 38400), (11, 115200)])
def test_a_snapshot_says_the_rate_that_the_drive_is_set_to(bd, rate):
    one = DirectDrive("LMDCM")
    one.device.memory.values["BD"] = bd
    assert one.run(MCodeFamily(one.state).values.snapshot(nothing)).baud == rate
