"""What a refusal says of valid values, against the simulated drive: never a range that contains the refused value."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import NoAnswer, Refused
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState
from multidrop.families.lexium.host.modbus.family import ModbusFamily
from multidrop.families.lexium.manual.modbus.registers import REGISTERS, ROWS
from multidrop.families.lexium.simulator.ports.modbus import ModbusPort
from tests.support.examples import examples
from tests.support.lexium import drive
from tests.support.procedure import ProcedureRunner

WRITABLE = sorted(
    row.name
    for row in ROWS
    if row.writable and row.limits and row.name not in {"MA", "MR", "HM", "HI", "MU", "O1", "O2", "O3"}
)
SETTINGS = (
    "EE=1",
    "MS=1",
    "MS=5",
    "MS=50",
    "AS=1",
    "AS=3",
    "VI=300000",
    "VM=400000",
    "VM=900000",
    "HT=60000",
    "MT=9000",
)


def typed(port: ModbusPort, text: str, product: str) -> str:
    """Carry out a typed line over a port of a simulated drive; the text of its refusal, empty for none."""
    runner = ProcedureRunner(ModbusFamily(ModbusState(Modbus(), product=product, stranger="")).perform(text))
    try:
        while (asked := runner.request) is not None:
            found = Modbus().decode(asked, port.receive(Modbus().encode(asked), 0.0))
            assert found is not None
            runner.answer(found.reply)
    except Refused as refusal:
        return str(refusal)
    except NoAnswer:  # it was accepted, and an error follows: no refusal
        return ""
    return ""


def named(refusal: str) -> list[tuple[int, int]]:
    """The values that a refusal calls valid."""
    text = re.search(r"which takes ([^;(]*)", refusal)
    spans = re.findall(
        r"(-?\d+)(?: to (-?\d+))?", text[1].replace("VI+1", "2").replace("VM-1", "4999999") if text else ""
    )
    return [(int(low), int(high or low)) for low, high in spans]


@st.composite
def writes(draw: st.DrawFn) -> tuple[str, int]:
    row = REGISTERS[draw(st.sampled_from(WRITABLE))]
    low, high = draw(st.sampled_from(row.spans))
    near = st.sampled_from([low - 1, low, low + 1, high - 1, high, high + 1])
    value = draw(near | st.integers(low, high))
    most = 2**31 if row.count == 2 else 2**15
    return row.name, min(max(value, -most), most - 1)


@given(
    write=writes(),
    before=st.lists(st.sampled_from(SETTINGS), max_size=4),
    product=st.sampled_from(["LMDCE", "LMDOE"]),
)
@examples(300, nightly=5000)
def test_no_refusal_names_a_range_that_contains_the_value(
    write: tuple[str, int], before: list[str], product: str
) -> None:
    name, value = write
    device = drive(personality=product)
    for line in (*before, "ER=0"):
        device.execute(line, 0.0)
    refusal = typed(ModbusPort(device), f"{name}={value}", product)
    if "exception 03" not in refusal:
        return
    valid = named(refusal)
    # While the drive counts, it does not print the VM and the MS in steps on which these two rest.
    assert valid or (name in ("MF", "AS") and "EE=1" in before), refusal
    assert not any(low <= value <= high for low, high in valid), refusal
