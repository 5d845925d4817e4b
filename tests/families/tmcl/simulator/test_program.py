"""The program of a simulated TMCL module: download, run, waits, stop, autostart, in virtual time."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.tmcl.host.codec import frame_of
from multidrop.families.tmcl.manual.commands import TmclCall
from multidrop.families.tmcl.manual.program_file import compiled, read
from tests.support.cases import for_each
from tests.support.examples import examples
from tests.support.tmcl_module import Module


def loaded(*lines: str, **settings: int) -> Module:
    module = Module(settings={"4": 100_000, "5": 1_000_000, **settings})
    assert module.reply("132 0, 0, 0").status == 100
    for line in lines:
        assert module.reply(line).status == 101
    assert module.reply("133 0, 0, 0").status == 100
    return module


def test_a_download_executes_nothing_not_even_a_stop():
    module = Module()
    module.ask("ROR 0, 5000")
    module.reply("132 0, 0, 0")
    assert module.reply("MST 0").status == 101
    module.wait(1.0)
    module.reply("133 0, 0, 0")
    assert module.ask("GAP 3, 0") == 5000


def test_a_program_moves_waits_and_jumps():
    module = loaded("MVP ABS, 0, 20000", "27 1, 0, 0", "27 0, 0, 100", "MVP ABS, 0, 0", "27 1, 0, 0", "22 0, 0, 0")
    module.ask("129 1, 0, 0")
    module.wait(1.0)
    assert (module.ask("GAP 1, 0"), module.ask("135 0, 0, 0"), module.ask("GGP 128, 0")) == (20000, 1, 1)
    module.wait(1.2)
    assert module.ask("GAP 0, 0") == 20000, "it has begun again"


def test_128_halts_the_program_and_leaves_the_motor():
    module = loaded("ROR 0, 5000", "27 0, 0, 100", "ROR 0, -5000", "28 0, 0, 0")
    module.ask("129 1, 0, 0")
    module.wait(0.5)
    module.ask("128 0, 0, 0")
    module.wait(2.0)
    assert (module.ask("GAP 3, 0"), module.ask("135 0, 0, 0")) == (5000, 0)
    module.ask("129 0, 0, 0")
    module.wait(1.0)
    assert (module.ask("GAP 3, 0"), module.ask("135 0, 0, 0")) == (-5000, 0), "it goes on and ends"


def test_a_step_and_a_reset():
    module = loaded("SAP 4, 0, 7", "SAP 4, 0, 8")
    module.ask("130 0, 0, 0")
    module.wait(1.0)
    assert module.ask("GAP 4, 0") == 7
    module.ask("131 0, 0, 0")
    module.ask("130 0, 0, 0")
    assert module.ask("GAP 4, 0") == 7
    module.ask("130 0, 0, 0")
    assert module.ask("GAP 4, 0") == 8


@pytest.mark.parametrize(("autostart", "speed"), [(0, 0), (1, 5000)])
def test_a_module_starts_its_program_at_power_up_with_parameter_77(autostart, speed):
    module = loaded("ROR 0, 5000", G77=autostart)
    module.device.power(False, module.now)
    module.device.power(True, module.now)
    module.wait(1.0)
    assert module.ask("GAP 3, 0") == speed


def test_a_wait_gives_up_after_its_time():
    module = loaded("MVP ABS, 0, 1000000", "27 1, 0, 50", "MST 0")
    module.ask("129 1, 0, 0")
    module.wait(0.4)
    assert module.ask("GAP 3, 0") == 100_000
    module.wait(0.4)
    assert module.ask("GAP 3, 0") == 0


def test_a_run_from_before_the_first_line_begins_with_the_first_line():
    module = loaded("SAP 4, 0, 7", "28 0, 0, 0")
    module.ask("129 1, 0, -5")
    module.wait(1.0)
    assert (module.ask("GAP 4, 0"), module.ask("135 0, 0, 0")) == (7, 0)
    empty = Module()
    empty.ask("129 1, 0, -5")
    empty.wait(1.0)
    assert empty.ask("135 0, 0, 0") == 0


def executed(*lines: str, seconds: float = 1.0) -> Module:
    """A module that has run a program in mnemonics for a time."""
    module = Module(settings={"4": 100_000, "5": 1_000_000})
    text = "\n".join(lines)
    module.device.program.load({each.at: each.call for each in compiled(read(text, "a.tmc"))})
    module.ask("129 1, 0, 0")
    module.wait(seconds)
    return module


def registers(module: Module) -> tuple[int, int]:
    """The accumulator and the X register, as a host reads them."""
    return module.ask("135 2, 0, 0"), module.ask("135 3, 0, 0")


@for_each(
    "lines, accumulator, x",
    [
        (["CALC LOAD, -7", "CALC DIV, 2"], -3, 0),
        (["CALC LOAD, -7", "CALC MOD, 3"], -1, 0),
        (["CALC LOAD, 2147483647", "CALC ADD, 1"], -(2**31), 0),
        (["CALC LOAD, 6", "CALC NOT, 0"], -7, 0),
        (["CALC LOAD, 6", "CALCX LOAD", "CALC LOAD, 5", "CALCX SWAP"], 6, 5),
        (["CALC LOAD, 6", "CALCX LOAD", "CALCX NOT"], 6, -7),
        (["CALC LOAD, 6", "CALC DIV, 0", "CALC ADD, 1"], 7, 0),
        (["SAP 4, 0, 777", "GAP 4, 0"], 777, 0),
        (["RFS STATUS, 0"], 0, 0),
    ],
)
def test_registers(lines: list[str], accumulator: int, x: int) -> None:
    assert registers(executed(*lines, "STOP")) == (accumulator, x)


@for_each(
    "left, condition, right, met",
    [
        *((left, "EQ", 5, left == 5) for left in (4, 5, 6)),
        *((left, "NE", 5, left != 5) for left in (4, 5, 6)),
        *((left, "GT", 5, left > 5) for left in (4, 5, 6)),
        *((left, "GE", 5, left >= 5) for left in (4, 5, 6)),
        *((left, "LT", 5, left < 5) for left in (4, 5, 6)),
        *((left, "LE", 5, left <= 5) for left in (4, 5, 6)),
        (0, "ZE", 5, True),
        (5, "ZE", 5, False),
        (0, "NZ", 5, False),
        (5, "NZ", 5, True),
        (5, "ETO", 5, False),
    ],
)
def test_conditions(left: int, condition: str, right: int, met: bool) -> None:
    module = executed(
        f"CALC LOAD, {left}", f"COMP {right}", f"JC {condition}, Met", "SAP 4, 0, 1", "STOP", "Met: SAP 4, 0, 2", "STOP"
    )
    assert module.ask("GAP 4, 0") == 1 + met


def test_a_wait_that_gives_up_sets_the_flag_until_it_is_cleared() -> None:
    late = ["MVP ABS, 0, 1000000", "WAIT POS, 0, 10"]
    module = executed(*late, "JC ETO, Late", "STOP", "Late: CLE ETO", "JC ETO, Bad", "SAP 6, 0, 9", "STOP", "Bad: STOP")
    assert module.ask("GAP 6, 0") == 9


def test_the_accumulator_as_a_time_a_speed_and_a_parameter() -> None:
    module = executed(
        "CALC LOAD, 500", "RORA 0", "AAP 6, 0", "CALC LOAD, 50", "WAIT TICKS, 0, -1", "MST 0", "STOP", seconds=0.4
    )
    assert (module.ask("GAP 2, 0"), module.ask("GAP 6, 0"), module.ask("135 0, 0, 0")) == (500, 128, 1)
    module.wait(0.3)
    assert (module.ask("GAP 2, 0"), module.ask("135 0, 0, 0")) == (0, 0)


def test_subroutines_are_eight_deep_and_a_return_without_a_call_goes_on() -> None:
    module = executed("RSUB", "CSUB Deep", "SAP 6, 0, 5", "STOP", "Deep: CALC ADD, 1", "CSUB Deep", "RSUB")
    assert (registers(module)[0], module.ask("GAP 6, 0")) == (8, 5), "the ninth call is passed over, eight go back"


def test_rst_begins_anew_with_nothing_kept() -> None:
    module = executed(
        "JA Begin", "Again: CALC ADD, 1", "AAP 6, 0", "STOP", "Begin: CALC LOAD, 7", "CSUB Sub", "Sub: RST Again"
    )
    assert module.ask("GAP 6, 0") == 1


def test_control_commands_are_executed_in_download_mode_and_128_is_no_line() -> None:
    module = Module()
    module.reply("132 0, 0, 0")
    assert module.ask("135 0, 0, 0") == 4 and module.ask("136 1, 0, 0") == 1241 << 16 | 1 << 8 | 15
    assert module.refusal("129 0, 0, 0") == 6
    assert module.reply("GGP 129, 0").status == 101
    module.ask("133 0, 0, 0")
    assert [call.command for call in module.device.program.memory] == [10]


def test_a_download_leaves_what_is_beyond_it() -> None:
    module = Module()
    for place, line in ((50, "MST 0"), (0, "28 0, 0, 0")):
        module.reply(f"132 0, 0, {place}")
        module.reply(line)
        module.reply("133 0, 0, 0")
    memory = module.device.program.memory
    assert (len(memory), memory[0].command, memory[50].command, memory[1].command) == (51, 28, 3, 0)


def test_a_stored_line_on_the_wire() -> None:
    module = loaded("SAP 4, 0, -2")
    assert module.send(frame_of(1, TmclCall(134))).hex(" ").upper() == "02 05 04 00 FF FF FF FE 06"
    assert module.send(frame_of(1, TmclCall(134, value=1))).hex(" ").upper() == "02 00 00 00 00 00 00 00 02"
    assert module.refusal("134 0, 0, 2048") == 4


def test_the_state_of_a_program_by_its_numbers() -> None:
    module = executed("WAIT TICKS, 0, 500", "STOP")
    assert (module.ask("GGP 128, 0"), module.ask("GGP 129, 0"), module.ask("GGP 130, 0")) == (1, 0, 1)
    assert module.ask("135 1, 0, 0") == 1 << 24 | 1 << 16 | 1
    assert module.refusal("135 4, 0, 0") == 3
    assert module.refusal("SGP 130, 0, 1") == 3
    module.ask("131 0, 0, 0")
    assert (module.ask("GGP 128, 0"), module.ask("GGP 130, 0")) == (0, 0)


def test_a_step_stays_at_a_wait_until_its_event_has_come() -> None:
    module = loaded("MVP ABS, 0, 20000", "27 1, 0, 0", "SAP 6, 0, 9")
    for place in (1, 1):
        module.ask("130 0, 0, 0")
        assert module.ask("GGP 130, 0") == place
    module.wait(1.0)
    for place in (2, 3):
        module.ask("130 0, 0, 0")
        assert module.ask("GGP 130, 0") == place
    assert module.ask("GAP 6, 0") == 9


def test_a_stop_switch_interrupts_the_program_which_then_goes_on() -> None:
    module = Module(settings={"4": 100_000, "5": 1_000_000}, limit_plus=5000)
    text = "VECT 28, Right\nEI 28\nEI 255\nROR 0, 20000\nCALC LOAD, 3\nWAIT TICKS, 0, 100\nAAP 7, 0\nSTOP\n"
    text += "Right: CALC LOAD, 77\nAAP 6, 0\nRETI"
    module.device.program.load({each.at: each.call for each in compiled(read(text, "a.tmc"))})
    module.ask("129 1, 0, 0")
    module.wait(0.9)
    assert module.ask("GAP 6, 0") == 77 and module.ask("135 0, 0, 0") == 1
    module.wait(0.5)
    assert (module.ask("GAP 7, 0"), module.ask("135 0, 0, 0")) == (3, 0), "its accumulator is its own again"


@examples(60, nightly=1000)
@given(
    st.lists(
        st.builds(
            TmclCall, st.integers(0, 127), st.integers(0, 255), st.sampled_from([0, 2, 3, 7]), st.integers(-3, 300)
        ),
        max_size=20,
    )
)
def test_no_memory_breaks_the_module(memory: list[TmclCall]) -> None:
    module = Module()
    module.device.program.load(dict(enumerate(memory)))
    module.ask("129 1, 0, 0")
    module.wait(2.0)
    module.ask("128 0, 0, 0")
    assert module.ask("GGP 128, 0") == 0


def test_user_variables_count_index_and_calculate() -> None:
    module = executed(
        *("SGP 5, 2, 3", "Round: CALCV ADD, 6, 10", "DJNZ 5, Round"),
        *("CALC LOAD, 7", "CALCX LOAD", "SIV 40", "CALCVV SUB, 7, 6", "GIV", "CALCAV MUL, 6", "STOP"),
    )
    assert [module.ask(f"GGP {n}, 2") for n in (5, 6, 7)] == [0, 30, 10]
    assert registers(module) == (300, 7)


def test_a_timer_interrupts_again_and_again_and_its_routine_keeps_the_registers() -> None:
    text = ["VECT 0, Tick", "SGP 0, 3, 100", "EI 0", "EI 255", "CALC LOAD, 5", "WAIT TICKS, 0, 105", "STOP"]
    module = executed(*text, "Tick: CALCV ADD, 9, 1", "CALC LOAD, 0", "RETI", seconds=2.0)
    assert (module.ask("GGP 9, 2"), registers(module)[0]) == (10, 5)
