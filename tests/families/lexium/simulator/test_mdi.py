"""How an MDrivePlus differs from a Lexium, beyond which words it has: motion, points, programs, memory, codes."""

from __future__ import annotations

import re

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from tests.support.mdrive_unit import Unit
from tests.support.sample_files import FOLDER
from tests.support.sample_programs import begin, load, printed, say

# Motion.


def test_a_bare_number_repeats_the_last_move_from_the_factory_on() -> None:
    unit = Unit("MDI", "MR 100")
    assert unit.at(1.0, "P") == ["100"] and unit.say("-50") == [""] and unit.at(2.0, "P") == ["50"]
    assert Unit().say("NE=0", "-50") == ["", "?20"]


def test_vm_and_sl_go_to_five_million_whatever_ms_is() -> None:
    unit = Unit()
    assert unit.say("VM=5000000", "MS=1", "VM=5000000", "PR VM", "SL 5000000", "SL 5000001") == [
        *("", "", "", "5000000", "", "?21"),
    ]
    assert Unit().say("MS=1", "VM=5000000", "MS=256", "PR VM,VI") == ["", "", "", "50000001024"]


def test_a_move_begins_when_it_has_been_worked_out() -> None:
    unit = Unit()
    assert unit.say("MR 51200", "PR MV,V,P") == ["", "100"]
    assert unit.at(0.0024, "V", "MV") == ["0", "1"] and unit.at(0.0026, "V") != ["0"]
    assert unit.say("MR 51200") == [""], "on the way it takes no time"
    assert unit.at(5.0, "P", "MV")[1] == "0"


@pytest.mark.parametrize("stop", ["SL 0", "\x1b", "DE=0"])
def test_a_stop_before_a_move_has_begun_is_a_stop(stop: str) -> None:
    unit = Unit("MDI", "MR 51200")
    unit.port.advance(0.001)
    unit.device.advance(0.001)
    unit.write(stop if stop == "\x1b" else stop + "\r")
    assert unit.at(2.0, "P", "MV", "V") == ["0", "0", "0"]


def test_a_pause_before_a_move_has_begun_keeps_it_back() -> None:
    unit = Unit("MDI", "PG 1", "MR 51200", "H", "PR P", "E", "PG", "EX 1")
    unit.device.advance(0.001)
    assert unit.say("PS") == [""] and unit.at(2.0, "P", "MV") == ["0", "0"]
    assert unit.say("RS") == [""] and unit.told(5.0) == "51200\r\n\r\n>"


def test_a_limit_that_closes_before_a_move_has_begun_stops_it() -> None:
    unit = Unit("MDI", "S2=2,0,0", inputs=((0.001, 2, 0),))
    assert unit.say("MR 51200") == [""]
    unit.port.advance(2.0)
    assert unit.say("PR ER", "PR P", "PR MV") == ["83", "0", "0"]


def test_mv_and_mp_last_until_mt_is_over_and_ht_has_no_part_in_that() -> None:
    unit = Unit("MDI", "MT=200", "HT=1000", "MR 1000")
    (moved,) = [unit.device.motor.axis.profile.end]
    assert unit.at(moved + 0.001, "MV", "MP", "V") == ["1", "1", "0"]
    assert unit.at(moved + 0.199, "MV", "MP") == ["1", "1"] and unit.at(moved + 0.201, "MV", "MP") == ["0", "0"]
    assert unit.say("SL 1000", "SL 0", "PR MV") == ["", "", "1"]


@pytest.mark.parametrize(("ht", "mt", "falls"), [(0, 100, False), (2, 0, True), (500, 0, True)])
def test_the_run_current_stays_where_ht_is_0(ht: int, mt: int, falls: bool) -> None:
    unit = Unit("MDI", f"HT={ht}", f"MT={mt}", "MR 1000")
    assert unit.at(5.0, "MV") == ["0"]
    assert unit.device.motor.heat.holding(unit.device.now) is falls
    assert unit.say("HT=1", "MT=65001", "HT=65535", "MT=65000", "HT=535", "HT=536")[:2] == ["?21", "?21"]


def test_with_de_0_a_move_is_counted_and_turns_nothing() -> None:
    unit = Unit("MDIE", "DE=0")
    assert unit.say("MR 51200") == [""]
    assert unit.at(2.0, "P", "C1", "C2", "ER") == ["51200", "51200", "0", "0"]
    assert unit.say("DE=1", "MR 51200") == ["", ""]
    assert unit.at(4.0, "C1", "C2") == ["102400", "2048"]


# The encoder.


@pytest.mark.parametrize("personality", ["MDIE", "MDIX"])
def test_the_encoder_has_512_lines(personality: str) -> None:
    unit = Unit(personality, "MR 51200")
    assert unit.at(2.0, "C1", "C2", "P") == ["51200", "2048", "51200"]
    assert unit.say("EE=1", "PR P,MS", "MR -2048") == ["", "2048256", ""]
    assert unit.at(4.0, "C1", "C2", "P") == ["0", "0", "0"]


def test_other_lines_are_set_on_an_expanded_unit() -> None:
    unit = Unit("MDIX", "EL=1000", "MR 51200")
    assert unit.at(2.0, "C2") == ["4000"]


def test_an_encoder_has_50_to_6400_lines_of_which_each_is_coarse_enough_for_256_microsteps() -> None:
    unit = Unit("MDIX")
    assert unit.say("EL 49", "EL 6401", "EL 50", "El=4096", "PR EL", "EE=1", "PR MS", "EE=0") == [
        *("?21", "?21", "", "", "4096", "", "256", ""),
    ]
    for lines in (50, 200, 4096, 6400):
        unit = Unit("MDIX", f"EL={lines}", "VI=256", "EE=1", "VM=200000", f"MR {4 * lines}")
        assert unit.at(20.0, "P", "C1", "C2") == [str(4 * lines), "51200", str(4 * lines)]
    assert Unit("MDI").say("EL=4096", "PR EL") == ["?37", "?37"]


def test_the_lines_of_the_encoder_decide_which_speed_is_less_than_a_count() -> None:
    unit = Unit("MDIX", "VI=12", "EL=1024")
    assert unit.say("EE=1", "VI=13", "EE=1") == ["?90", "", ""]


def test_a_unit_without_an_encoder_prints_0_for_three_words_of_it_and_takes_no_value() -> None:
    unit = Unit()
    assert unit.say("PR EE", "PR ST", "PR C2", "PR EE,ST,C2", "R1=C2+EE", "PR R1,EF") == [
        *("0", "0", "0", "000", "", "00"),
    ]
    assert unit.say("EE=1", "EE=0", "ST=0", "C2=0", "IC C2", "VA EE", "PR DB", "PR I6") == [
        *("?37", "?37", "?37", "?37", "?37", "?29", "?37", "?37"),
    ]
    unit = Unit("MDI", "PG 1", "LB K1", "BR K2,EE=1", 'PR "none ",C2,ST', "E", "LB K2", 'PR "one"', "E", "PG", "EX K1")
    assert unit.told(0.1).startswith("none 00\r\n") and unit.say("PR ER") == ["0"]


def test_a_speed_of_less_than_a_count_is_no_speed_in_counts() -> None:
    unit = Unit("MDIE", "VI=24")
    assert unit.say("EE=1", "PR EE", "VI=25", "EE=1", "MS=128", "MS=256") == ["?90", "0", "", "", "?21", ""]


def test_a_trip_on_position_is_in_motor_steps_with_the_encoder_too() -> None:
    unit = Unit("MDIE", "PG 1", "LB K1", "PR C1", "RT", "PG", "TP=25600,K1", "EE=1", "TE=2", "MR 2048")
    assert "25600\r\n" in unit.told(3.0)
    unit = Unit("MDIE", "PG 1", "LB K1", "PR C1", "RT", "PG", "P=0", "MR -51200")
    assert unit.at(2.0, "C1") == ["-51200"]
    assert unit.say("EE=1", "TP=-25600,K1", "TE=2", "MR 2048") == [""] * 4
    assert "-25600\r\n" in unit.told(4.0)


def test_the_end_of_a_move_is_corrected_three_times() -> None:
    unit = Unit("MDIE", "EE=1", "SM=1", "MT=50", stall_at=25600)
    assert unit.say("MR 2048") == [""]
    creeps = set()
    while unit.device.now < 120 and (due := unit.device.deadline) is not None:
        unit.device.advance(due)
        profile = unit.device.motor.axis.profile
        if unit.device.motor.axis.kind == "correction" and profile.moving(due):
            creeps.add(profile.start)
    assert unit.say("PR ER") == ["92"] and len(creeps) == 3


# Points.


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_each_of_the_four_points_is_an_input_or_an_output(n: int) -> None:
    unit = Unit()
    assert unit.say(f"PR S{n}", f"O{n}=1", f"S{n}=16,0", f"PR S{n}", f"O{n}=1", "PR IL,IN", f"PR I{n}") == [
        *("0, 0, 0", "?9", "", "16, 0, 0", "", f"{15 - 2 ** (n - 1)}" * 2, "1"),
    ]
    assert unit.say(f"O{n}=0", "PR IL", f"S{n}=16,1,0", f"O{n}=1", "PR IL", f"O{n}=0", "PR IL") == [
        *("", "15", "", "", "15", "", f"{15 - 2 ** (n - 1)}"),
    ]
    assert unit.say(f"S{n}=0,0,1", f"O{n}=1", "PR IL") == ["", "?9", "15"]


def test_groups_write_and_read_their_points_at_once() -> None:
    unit = Unit("MDI", *(f"S{n}=16,1,0" for n in (1, 2, 3, 4)))
    for value in (0, 13, 15, 2):
        for word in ("OL", "OT"):
            assert unit.say(f"{word} {value}", "PR IL", "PR IN") == ["", str(value), str(value)], (word, value)
    assert unit.say("OL=16", "OT=255", "PR IL", "OT=256", "S4=0,0,0", "OL=0", "PR IL") == [
        *("?21", "", "15", "?21", "", "", "8"),
    ]
    assert Unit().say("PR OL", "PR OT") == ["?35", "?35"]


@pytest.mark.parametrize("personality", ["MDI", "MDIE", "MDIX"])
def test_a_group_is_written_where_no_point_is_an_output_and_changes_nothing(personality: str) -> None:
    unit = Unit(personality)
    assert unit.say("OL 0", "OL 13", "OT 0", "OT 15", "OL=15", "PR IL", "PR EF,ER", "OL 16", "OL -1") == [
        *("", "", "", "", "", "15", "00", "?21", "?21"),
    ]
    assert unit.say("S4=17,0,0", "OL 0", "OT 255", "PR EF") == ["", "", "", "0"], "an output of the drive's own"
    assert unit.say("S3=16,1,0", "PR IL", "O1=1") == ["", "11", "?9"], "nothing was kept for it"
    assert personality != "MDIX" or unit.say("OH 0", "OH 15", "PR IH", "OH 16") == ["", "", "15", "?21"]


def test_the_groups_of_an_expanded_unit() -> None:
    unit = Unit("MDIX", *(f"S{n}=16,1,1" for n in (1, 2, 3, 4, 9, 10, 11, 12)))
    assert unit.say("OT=165", "PR IL", "PR IH", "PR IN", "OH=3", "PR IH", "PR IN", "O12=1", "PR IH", "PR I12") == [
        *("", "5", "10", "165", "", "3", "53", "", "11", "1"),
    ]


def test_point_13_takes_a_third_field_as_the_others_do() -> None:
    unit = Unit("MDIX")
    assert unit.say("S13=60,0,0", "PR S13", "S13 60,0,0", "s13 60,1,1", "PR S13", "S13=61,0", "PR S13") == [
        *("", "60, 0, 0", "", "", "60, 1, 1", "", "61, 0, 0"),
    ]
    assert unit.say("S13=60,0,2", "S13=60,0,0,0", "S13=60", "S13=16,0,0", "S7=33,0,0") == [
        *("?21", "?24", "?38", "?8", "?24"),
    ]
    assert Unit("MDI").say("S13=60,0,0", "S13 60,0,0") == ["?37", "?37"]


@pytest.mark.parametrize("kind", [9, 12, 13, 14, 15, 21, 22, 24, 25, 26, 28, 29, 33, 60])
def test_types_that_its_points_do_not_have(kind: int) -> None:
    assert Unit().say(f"S1={kind},0,0") == ["?8"]


@pytest.mark.parametrize("line", ["S1=0,2,0", "S1=0,0,2", "S1=16,0,1", "S5=9,2", "S5=10,-1"])
def test_levels_and_sources_that_there_are_not(line: str) -> None:
    assert Unit().say(line) == ["?21"]


def test_fields_of_a_set_up() -> None:
    unit = Unit()
    assert unit.say("S1=0", "S1=1,0", "S2=1,0,0", "S2=0,0,0", "S1=0,0,0,0", "S4=17,0,0", "S3=17,0,0", "PR S1,S4") == [
        *("?38", "", "?6", "", "?24", "", "?6", "1, 0, 017, 0, 0"),
    ]
    assert unit.say("S5=9", "PR S5", "S5=10,1", "PR S5", "S5=9", "PR S5", "S5=11", "S6=1,0") == [
        *("", "9, 0", "", "10, 1", "", "9, 0", "?8", "?20"),
    ]


def test_an_output_follows_the_drive_and_sourcing_needs_expanded_io() -> None:
    unit = Unit("MDI", "S4=17,0,0")
    assert unit.say("PR I4", "SL 1000", "PR I4,IL", "SL 0") == ["0", "", "17", ""]
    assert unit.at(1.0, "I4", "IL") == ["0", "15"]
    assert Unit("MDIX").say("S1=16,1,1", "O1=1", "PR IL", "O1=0", "PR IL") == ["", "", "15", "", "14"]


def test_the_analog_input_has_ten_bits() -> None:
    unit = Unit("MDI", analog=((0.0, 1023), (1.0, 500)))
    assert unit.say("PR I5", "S5=10,1", "PR I5", "S5=10,0", "PR I5") == ["1023", "", "800", "", "1023"]
    assert unit.at(1.5, "I5") == ["500"]


def test_clock_points_are_a_pair_and_make_the_motor_follow() -> None:
    unit = Unit("MDIX", "S7=33,1")
    assert unit.say("PR S8", "S8=34,0", "PR S7", "S7=16,0", "S7=49,0", "PR S8", "S7=33,1") == [
        *("33, 1", "", "34, 0", "?8", "", "49, 0", ""),
    ]
    assert unit.say("CR=0.5", "PR CR", "CM=1") == ["", "0.500", ""]
    unit.device.world.set_input(8, 1, 0.0)
    for pulse in range(10):
        for level in (1, 0):
            unit.device.world.set_input(7, level, pulse / 1000)
            unit.device.advance(pulse / 1000)
            unit.device.advance(pulse / 1000)
    assert unit.say("PR P") == ["5"]


def test_limits_do_nothing_and_a_jog_is_87_while_the_clock_mode_is_on() -> None:
    unit = Unit("MDIX", "S2=2,0,0", "S3=7,0,0", "CM=1", limit_plus=0)
    assert unit.say("MR 5") == [""] and unit.at(1.0, "P", "ER") == ["5", "0"]
    unit.device.world.set_input(3, 0, 1.0)
    assert unit.say("JE=1", "PR JE,MV") == ["?87", "10"], "it is taken"
    assert unit.say("CM=0", "MR 5") == ["", "?83"]


def test_capture_and_trip_output_are_on_point_13() -> None:
    unit = Unit("MDIX", "PG 1", "LB K1", "PR PC", "RT", "PG", "TC=K1", "S13=61,0")
    assert unit.say("TE=4", "S13=60,0", "TE=4", "MR 51200") == ["?12", "", "", ""]
    unit.device.world.set_input(13, 0, 0.5)
    unit.device.advance(0.6)
    assert int(unit.told(2.0).split()[0]) > 0 and unit.say("PR TE") == ["0"]
    unit = Unit("MDIX", "S13=61,1", "CW=255", "TR=1000,0,3", "TE=16", "MR 5000")
    pulses = 0
    while unit.device.now < 1 and (due := unit.device.deadline) is not None:
        unit.device.advance(due)
        pulses += unit.device.motor.trips.fired_at == unit.device.now
    assert pulses == 3 and unit.say("PR TE") == ["0"]


@pytest.mark.parametrize(("trip", "caught"), [("TR=25600,K1,2", ["25600", "51200"]), ("TP=25600,K1", ["0"])])
def test_every_trip_but_tp_captures_the_position(trip: str, caught: list[str]) -> None:
    unit = Unit("MDIX", "PG 1", "LB K1", "PR PC", "RT", "PG", "S13=61,0", trip, f"TE={16 if trip[1] == 'R' else 2}")
    assert unit.say("MR 102400") == [""]
    assert [line for line in unit.told(4.0).replace(">", "").split() if line] == caught


def test_a_cell_drives_the_inputs_that_a_unit_has() -> None:
    cell = '[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "{}"\n[bus.drive.world]\ninputs = [[1.0, {}, 0]]\n'
    floor = Floor(read(cell.format("MDIX", 12)))
    floor.advance(2.0)
    (placed,) = floor.drives
    assert placed.device.execute("PR IH", 2.0).lines == ("7",)  # type: ignore[attr-defined]
    floor.command("/sim input ! 13 0", 2.0)
    for personality, n, told in (("MDI", 9, "from 1 to 4"), ("MDIX", 6, "no input 6"), ("MDIX", 14, "from 1 to 13")):
        with pytest.raises(Diagnostic, match=told):
            read(cell.format(personality, n))
    with pytest.raises(Diagnostic, match="valid: 1, 2, 3, 4, 7, 8, 9"):
        floor.command("/sim input ! 5 0", 2.0)
    with pytest.raises(Diagnostic, match="0 to 1023"):
        floor.command("/sim analog ! 1024", 2.0)


def test_the_supply_is_all_of_its_power() -> None:
    floor = Floor(read('[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "MDI"\n'))
    with pytest.raises(Diagnostic) as caught:
        floor.command("/sim supply ! off", 0.0)
    assert caught.value.hint == "/sim power ! off switches it"


# Programs and memory.


def test_a_program_is_in_memory_as_it_is_typed() -> None:
    unit = Unit("MDI", "PG 1", "LB K1", 'PR "kept"', "E", "PG", "VA Q1=5", "R1=3")
    unit.write("\x03")
    assert unit.say("L", "PR R1", "PR Q1") == ['1  LB K1|6  PR "kept"|14  E', "0", "?35"]
    assert unit.say("CP") == [""]
    unit.write("\x03")
    assert unit.say("L") == [""]


def test_what_cp_takes() -> None:
    lines = ("PG 1", "LB K1", "H 1", "LB K2", "H 1", "E", "PG", "VA Q1=5")
    assert Unit("MDI", *lines).say("CP K2", "L", "PR Q1", "CP 1", "L", "PR Q1") == [
        *("", "1  LB K1|6  H 1", "5", "", "", "5"),
    ]
    assert Unit("MDI", *lines).say("CP 0,K1", "CP 1,K1", "CP S", "CP 0") == ["?24", "?24", "?34", "?42"]


def test_cp_1_clears_from_the_beginning_whatever_stands_there() -> None:
    assert Unit("MDI").say("CP 1", "CP 1", "CP 2") == ["", "", "?42"]
    unit = Unit("MDI", "PG 100", "LB K1", "E", "PG")
    assert unit.say("CP 1", "L", "EX K1") == ["", "", "?30"]
    assert Unit("MDI", "PG 1", "LB K1", "E", "PG", "LK=1").say("CP 1") == ["?44"]


def test_names_have_two_characters_at_most() -> None:
    unit = Unit()
    assert unit.say("VA A1", "VA AB", "VA A12", "VA Q", "VA 1A") == ["", "", "?24", "", "?24"]
    assert unit.write("PG 1\rLB K12\r")[-1] == "?"


def test_a_handler_is_declared_in_a_program_and_goes_with_it() -> None:
    unit = Unit("MDI", "PG 1", "LB G1", "OE K1", "E", "LB K1", 'PR "oops"', "RT", "PG", "EX G1")
    unit.told(0.1)
    assert Unit().say("OE K1", "OE 0") == ["?46", "?46"]
    assert "oops" in unit.write("XX\r") + unit.told(0.2)
    assert unit.say("PR ER", "CP", "XX") == ["20", "", "?20"]
    assert unit.device.interpreter.handler is None


def test_what_is_typed_while_no_program_runs_is_40() -> None:
    unit = Unit("MDI", "PG 1", "LB K1", "H 1000", "E", "LB K2", "IC R1", "RT", "PG")
    assert unit.say("H", "H 5", "CL K2", "BR K2", "EX K1", "CL K2") == ["?40", "?40", "?40", "?46", "", ""]
    unit.told(2.0)
    assert unit.say("PR R1", "IV R2", "PR IF", "77", "PR R2,IF") == ["1", "", "1", "", "770"]


def test_break_points_have_a_place_and_a_count() -> None:
    unit = Unit("MDI", "PG 1", "LB K1", "IC R1", "E", "PG")
    assert unit.say("BP", "BP K1", "BP K1,2", "BP=0") == ["?24", "?38", "", ""]


def test_h_0_waits_for_motion() -> None:
    unit = Unit("MDI", "PG 1", "MR 51200", "H 0", "PR P", "E", "PG", "EX 1")
    assert unit.told(3.0).startswith("51200\r\n")


def test_whole_numbers_only() -> None:
    unit = Unit("MDI", "R1=7/2", "VA Q1=2")
    assert unit.say("PR R1", "R2=AB R1", "R2=3+SQ Q1", "R2=Q1*R1", "PR R2") == ["3", "?24", "?24", "", "6"]


def test_a_program_that_prints_fast_waits_for_the_wire_and_loses_nothing() -> None:
    line = f'PR "{"0123456789" * 4} ",R1'
    unit = Unit("MDI", "PG 1", "LB G1", "IC R1", line, "BR G1,R1<100", "E", "PG", "EX G1")
    heard = unit.told(60.0)
    assert [int(line.split()[-1]) for line in heard.splitlines() if line[:1] == "0"] == list(range(1, 101))
    assert unit.say("PR ER") == ["0"]
    unit = Unit("MDI", "PG 1", "LB G1", "IC R1", line, "BR G1", "E", "PG")
    assert unit.say("EX G1") == [""]
    assert 210 < len(unit.told(10.0).splitlines()) < 225, "10 s at 9600 bit/s"


@pytest.mark.parametrize(("line", "name"), [('DN="a"', "a"), ("DN=65", "A"), ('DN="65"', "A"), ('DN="7"', "7")])
def test_a_name_is_a_character_or_its_code(line: str, name: str) -> None:
    assert Unit().say(line, "PR DN") == ["", f'"{name}"']


@pytest.mark.parametrize(
    ("personality", "part"), [("MDI", "MDI1FRD23A7"), ("MDIE", "MDI1FRD23A7-EQ"), ("MDIX", "MDI3CRL23C7-EQ")]
)
def test_what_it_says_of_itself(personality: str, part: str) -> None:
    unit = Unit(personality)
    assert unit.say("PR VR", "PR PN") == ["3.010", part]
    signs_on = "Copyright\xa9 2001-2009 by Intelligent Motion Systems, Inc.\r\n"
    assert unit.write("\x03") == signs_on + ">" and unit.write("FD\r").endswith(signs_on + ">")
    assert Unit(personality, "S").write("EM=1\rS\r\x03").endswith(signs_on)


def test_all_parameters_are_its_own() -> None:
    for personality, there, absent in (("MDI", "S4", "EE"), ("MDIE", "EE", "S9"), ("MDIX", "CR", "IT")):
        listed = {line.split(" = ")[0] for line in Unit(personality).say("PR AL")[0].split("|")}
        assert there in listed and absent not in listed and not listed & {"AO", "RD", "IS", "OS", "VT", "TM", "AS"}


def test_an_index_table_as_people_write_it_counts_and_prints_words_of_an_encoder_that_it_lacks() -> None:
    text = (FOLDER / "mdi_indexer.mxt").read_text()
    device = load(text, "MDI", home=0, inputs=((1.0, 1, 1), (2.0, 1, 0), (4.0, 1, 1)))
    begin(device)
    assert printed(device, 6.0) == [f"INDEX {n} AT {n * 51200} ENC 0 STALL 0" for n in (1, 2)]


def test_a_capture_on_point_13_as_people_write_it() -> None:
    device = load((FOLDER / "mdix_print_mark.mxt").read_text(), "MDIX", inputs=((1.0, 13, 1), (1.1, 13, 0)))
    say(device, "EX AA")
    first, second = printed(device, 5.0)
    assert re.fullmatch(r"M=[1-9]\d+", first) and re.fullmatch(r"RUNOUT [1-9]\d*", second)
    assert say(device, "PR MV", "PR ER") == ["0", "0"]
