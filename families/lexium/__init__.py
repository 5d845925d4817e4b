"""Lexium MDrive, Lexium Motion Module and MDrivePlus: MCode on a serial line or TCP, and Modbus/TCP."""

from __future__ import annotations

from multidrop.base.feature import Feature
from multidrop.dialects.checksums import LineChecksum
from multidrop.dialects.families import Dialect
from multidrop.dialects.program_files import ProgramFiles
from multidrop.families.lexium.scheme import ModbusScheme
from multidrop.shell.operations.operation import Examples
from multidrop.simulator.declared import Demo, Simulated

HERE = __name__
FAMILY = Feature(
    "lexium",
    "Lexium MDrive, Lexium Motion Module, MDrivePlus",
    adds=(
        Dialect(
            "mcode",
            f"{HERE}.host.mcode.family:MCodeFamily",
            files=ProgramFiles(
                "MCode",
                (".mxt", ".txt"),
                f"{HERE}.manual.program_checker",
                f"{HERE}.manual.editing:EDITING",
                ("mcode", "mxt"),
                {"lexium": f"{HERE}.manual.conversion"},
                f"{HERE}.manual.supported:unsupported",
            ),
        ),
        Dialect("modbus", f"{HERE}.host.modbus.family:ModbusFamily", scheme="modbus"),
        Simulated(
            "mcode",
            f"{HERE}.simulator.family:SimulatedLexium",
            ("LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM", "MDI", "MDIE", "MDIX"),
            f"{HERE}.simulator.program_run:MCodeRun",
            own_port="modbus",
        ),
        Demo(f"{HERE}.simulator"),
        ModbusScheme(),
        LineChecksum("mcode", "MCode with CK=1 or CK=2", f"{HERE}.host.checksums:mcode"),
        LineChecksum("modbus-rtu", "Modbus RTU", f"{HERE}.host.checksums:rtu"),
        LineChecksum("modbus-ascii", "Modbus ASCII", f"{HERE}.host.checksums:ascii_frame"),
        Examples("program convert", ("program convert shuttle.mxt --to lexium -o shuttle-lmd.mxt",)),
        Examples("rescue", ("rescue COM3 --baud 9600 --dialect mcode",)),
    ),
)
