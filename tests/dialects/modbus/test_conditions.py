"""The conditions of an Ethernet drive over Modbus, from the registers and points of the simulated one."""

from __future__ import annotations

from typing import Any

from multidrop.dialects import Kind, Procedure
from multidrop.dialects.modbus.family import MODBUS
from multidrop.dialects.modbus.host.codec import Modbus, ModbusState
from multidrop.simulator.lexium.ports.modbus import ModbusPort
from tests.support.lexium import drive
from tests.support.procedure import ProcedureRunner


def carried(port: Any, procedure: Procedure[Any]) -> Any:
    runner = ProcedureRunner(procedure)
    while (request := runner.request) is not None:
        assert request.kind is Kind.PRINT
        found = request.codec.decode(request, port.receive(request.codec.encode(request), 0.0))
        assert found is not None
        runner.answer(found.reply)
    return runner.result


def test_flags_points_settings_and_set_ups_make_the_conditions() -> None:
    device = drive("IS=1,1,0", "OS=2,18,1", "OS=1,16,1", "O1=1", "RC=60", personality="LMDCE")
    port = ModbusPort(device)
    state = ModbusState(Modbus(), product="LMDCE", version="LMDCE 6.002")
    reader = MODBUS.values
    facts: dict[str, Any] = {}
    for part in reader.parts(state, facts):
        facts |= carried(port, part.read(state))
    (found,) = reader.fold(state, facts)
    shown = [(lamp.name, lamp.function, lamp.on) for lamp in found.lamps]
    assert shown[0] == ("1", "home", False)
    assert shown[-3:] == [("1", "", True), ("2", "error", False), ("3", "", False)]
    assert (found.error, found.program, found.run_current, found.hold_current) == (0, "", 60, 5)
    assert not device.memory.error_flag


def test_a_disabled_drive_is_read_with_its_flags() -> None:
    port = ModbusPort(drive("DE=0", personality="LMDCE"))
    state = ModbusState(Modbus(), product="LMDCE", version="LMDCE 6.002")
    reader = MODBUS.values
    quick = next(part for part in reader.parts(state, {}) if part.name == "flags")
    assert not quick.slow
    assert reader.fold(state, carried(port, quick.read(state)))[0].disabled == "DE=0"
