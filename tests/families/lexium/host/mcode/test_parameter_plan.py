"""From any settings to any others the drive refuses no step, and what can move the motor waits for its name."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects.values import Permission, differing
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.settings import MCodeParameters
from tests.support.direct_drive import DirectDrive
from tests.support.examples import examples
from tests.support.random_settings import PROGRAM, lines

pytestmark = pytest.mark.slow

PRODUCTS = ("LMDOM", "LMDCM", "LMDCM", "LMDCE", "LMM", "MDI", "MDIE", "MDIX")


def settings_of(one):
    return one.run(MCodeParameters(one.state).read(lambda done, total: None))


def random_drive(random, product):
    one = DirectDrive(product, program=PROGRAM)
    for line in lines(random, product, random.randint(0, 16)):
        one.try_lines(line)
        one.device.advance(one.device.now + 1.0)
    one.try_lines("SL 0")
    one.device.advance(one.device.now + 50.0)
    one.try_lines()
    return one


def steps(product, wanted, *present, named=(), program=PROGRAM):
    one = DirectDrive(product, *present, program=program)
    plan = MCodeParameters(one.state).plan(settings_of(one), wanted, Permission(frozenset(named)))
    for change in plan:
        one.run(MCodeFamily(one.state).perform(change.text))
    return [change.text for change in plan], dict(plan.withheld + plan.impossible)


@pytest.mark.parametrize(
    ("present", "sent"),
    [
        (("EL=60", "VI=30"), ["VI=214", "EE=1"]),
        (("EL=60", "VI=214"), ["EE=1"]),
        (("EL=6000", "VI=3"), ["EE=1"]),
        (("VI=20",), ["VI=25", "EE=1"]),
    ],
)
def test_counting_begins_with_a_velocity_of_one_count_of_the_encoder_that_there_is(present, sent):
    assert steps("MDIX", {"EE": 1}, *present, named=("EE",)) == (sent, {})


@examples(25, nightly=600)
@given(st.randoms(use_true_random=False), st.sampled_from(PRODUCTS))
def test_no_step_between_any_two_settings_is_refused(random, product):
    here, there = random_drive(random, product), random_drive(random, product)
    present, wanted = settings_of(here), settings_of(there).values
    whole = random.random() < 0.6
    wanted = {name: value for name, value in wanted.items() if whole or random.random() < 0.4}
    named = frozenset(name for name in wanted if random.random() < 0.8)
    try:
        plan = MCodeParameters(here.state).plan(present, wanted, Permission(named))
    except Diagnostic as error:
        assume(whole and "with MS" not in str(error))  # a drive rounds VM up beyond what it takes
        raise
    for change in plan:
        here.run(MCodeFamily(here.state).perform(change.text))
        here.device.advance(here.device.now + 1.0)
    left = {name for name, *_ in differing(settings_of(here).values, wanted) if name in wanted}
    assert left <= {name for name, _ in plan.withheld + plan.impossible}


@pytest.mark.parametrize(
    ("wanted", "present", "sent"),
    [
        ({"VM": 500, "VI": 100}, (), ["VI=100", "VM=500"]),
        ({"VM": 900000, "VI": 800000}, (), ["VM=900000", "VI=800000"]),
        ({"VM": 768000}, (), []),
        ({"MS": 16, "VM": 40000, "VI": 63, "A": 5000}, (), ["MS=16", "A=5000", "VI=1", "VM=40000", "VI=63"]),
        ({"MS": 16}, (), ["MS=16"]),
        ({"MS": 16, "VI": 500}, (), ["MS=16", "VI=500"]),
        ({"EE": 1, "VI": 100}, (), ["EE=1", "VI=100"]),
        ({"HT": 65000, "MT": 500}, ("HT=500", "MT=65000"), ["MT=500", "HT=65000"]),
        ({"IS1": (2, 0), "IS2": (1, 0)}, ("IS=1,1,0", "IS=2,2,0"),
         ["IS=1,0,0", "IS=2,0,0", "IS=1,2,0", "IS=2,1,0"]),
        ({"LS0": (200, 1), "LS1": (300, 1)}, ("LS=1,100,1", "LS=0,-100,1"), ["LS=1,300,1", "LS=0,200,1"]),
        ({"MF": 768000, "VM": 100000}, ("MF=500", "VM=100000"), ["VM=768000", "MF=768000", "VM=100000"]),
        ({"Q1": 5, "Q2": 6}, ("VA Q1=1",), ["Q1=5", "VA Q2=6"]),
        ({"PF": (8, 2, 0, 0), "F1": 2.5}, (), ["PF=8,2,0,0", "F1=2.5"]),
        ({"TI": (1, "G1")}, (), ["TI=1,G1"]),
    ],
)  # fmt: skip
def test_the_order_follows_the_present_values(wanted, present, sent):
    assert steps("LMDCM", wanted, *present) == (sent, {})


def test_both_points_of_an_mdriveplus_clock_are_set_with_one():
    assert steps("MDIX", {"S7": (34, 0)}) == (["S7=34,0"], {})


def test_steps_that_change_what_a_position_is_say_so():
    one = DirectDrive("LMDCM")
    present = settings_of(one)
    remarks = MCodeParameters(one.state).plan(present, {"MS": 16, "RD": 1, "RC": 5}, Permission()).remarks
    assert len(remarks) == 1 and remarks[0].startswith("MS, RD: the position counter")
    assert MCodeParameters(one.state).plan(present, {"RC": 5}, Permission()).remarks == ()


def test_the_unit_of_motion_comes_before_its_values():
    wanted = {"EE": 1, "MS": 256, "VM": 70000, "VI": 100, "A": 50000}
    sent, withheld = steps("LMDCM", wanted, "MS=16")
    assert sent[0] == "EE=1" and sent[1:] == ["A=50000", "VI=1", "VM=70000", "VI=100"] and withheld == {}


@pytest.mark.parametrize(
    ("name", "value", "present"),
    [
        ("DE", 0, ()), ("JE", 1, ()), ("PM", 1, ()), ("AS", 1, ()), ("AS", 3, ()), ("LK", 1, ()), ("FS", 5, ()),
        ("FL", 1, ("IS=3,13,0",)), ("EE", 1, ("PM=1",)), ("MU", 1, ("AS=1",)), ("IS1", (4, 0), ()),
        ("IS2", (11, 0), ()), ("IS2", (7, 0), ("JE=1",)), ("EM", 1, ()), ("BD", 19, ()), ("DN", "x", ()),
        ("CK", 1, ()), ("TI", (1, 200), ()),
    ],
)  # fmt: skip
def test_what_can_move_or_cut_off_the_drive_waits_for_its_name(name, value, present):
    sent, withheld = steps("LMDCM", {name: value}, *present)
    assert sent == [] and list(withheld) == [name]
    one = DirectDrive("LMDCM", *present, program=PROGRAM)
    plan = MCodeParameters(one.state).plan(settings_of(one), {name: value}, Permission(frozenset({name})))
    assert [change.name for change in plan] == [name]


def test_jog_inputs_are_restored_where_jogging_is_off():
    assert steps("LMDCM", {"IS2": (7, 0), "JE": 1}) == (
        ["IS=2,7,0"],
        {"JE": "inputs of the jog types turn the motor then"},
    )


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"VM": 0}, "VM = 0: valid: 2 to 2560000"),
        ({"VM": 10}, "VI = 1000 and VM = 10: VI must be below VM"),
        ({"MS": 3}, "MS = 3: valid: 1, 2, 4"),
        ({"MS": 1, "VM": 20000, "VI": 4}, "VM = 20000: with MS = 1 at most 10000"),
        ({"HT": 65000, "MT": 1000}, "together at most 65535"),
        ({"IS1": (15, 0)}, "type 15; valid: 0, 1, 2"),
        ({"IS1": (1, 0), "IS2": (1, 0)}, "only one of them can have type 1"),
        ({"IS3": (13, 0), "IS4": (1, 0)}, "a clock takes both"),
        ({"LS0": (5, 1), "LS1": (5, 1)}, "the minus limit must be below"),
        ({"VERY": 5}, "VERY: is neither a word of the drive nor a name for a variable"),
        ({"G1": 5}, "G1: is a label of the program"),
        ({"V": 5}, "V: is not a setting"),
        ({"SA": 1.8}, "SA: an LMDCM lacks it"),
        ({"VM": "fast"}, "VM = fast: valid"),
        ({"IS1": 5}, "IS1 = 5: takes 2 whole numbers"),
        ({"IS1": (1, 0, 0)}, "takes 2 whole numbers"),
        ({"PF": (20, 2, 0, 0)}, "PF = [20, 2, 0, 0]: valid"),
        ({"TI": (9, "G1")}, "TI = (9, 'G1'): takes TI=<input>,<label/address>"),
        ({"TI": (1.5, "G1")}, "takes TI="),
        ({"TR": (0, "G1")}, "takes TR="),
        ({"TR": (5, "G1", 70000)}, "takes TR="),
        ({"TR": (5, "G1", "G1")}, "takes TR="),
        ({"TR": (5,)}, "takes TR="),
        ({"TC": (1, "G1")}, "takes TC="),
        ({"F1": "1\rMR 5"}, "F1 = 1"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_one_line_and_no_step(wanted, said):
    with pytest.raises(Diagnostic) as caught:
        steps("LMDCM", wanted)
    assert said in str(caught.value)


@pytest.mark.parametrize("name", ["ab", "a\rMR 5", '"', 5])
def test_a_device_name_is_one_character(name):
    one = DirectDrive("LMDCM")
    with pytest.raises(Diagnostic, match="one letter or digit"):
        MCodeParameters(one.state).plan(settings_of(one), {"DN": name}, Permission(communication=True))


def test_a_name_that_a_neighbour_bears_and_the_end_of_party_mode_are_conflicts():
    one = DirectDrive("LMDCM", "PY=1")
    plan = MCodeParameters(one.state).plan(settings_of(one), {"DN": "b", "PY": 0}, Permission(communication=True))
    assert (
        MCodeParameters(one.state).conflict(plan, ["b"])
        and MCodeParameters(one.state).conflict(plan, ["c"])
        and not MCodeParameters(one.state).conflict(plan, [])
    )


def test_trips_need_their_labels():
    assert steps("LMDCM", {"TI": (1, "K9")})[1] == {"TI": "the program in the drive has no label K9; download it first"}


@pytest.mark.parametrize(("line", "said"), [("SL 5000", "moves"), ("TE=8", "armed trips"), ("EX G3", "runs a program")])
def test_a_drive_at_work_is_left_alone(line, said):
    one = DirectDrive("LMDCM", "TT=60000,G1", line, program="PG 1\nLB G1\nRT\nLB G3\nH 5000\nBR G3\nE\nPG")
    one.device.advance(one.device.now + 0.5)
    assert said in one.run(MCodeParameters(one.state).ready())
