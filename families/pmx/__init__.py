"""Arcus PMX-2ED-SA: lines of ASCII with a device number in front, over RS-485 or without a number through a gateway."""

from __future__ import annotations

from multidrop.base.feature import Feature
from multidrop.dialects.checksums import LineChecksum
from multidrop.dialects.families import Dialect
from multidrop.dialects.program_files import ProgramFiles
from multidrop.dialects.usb import UsbModule
from multidrop.shell.operations.operation import Examples
from multidrop.simulator.declared import Demo, Simulated

HERE = __name__
FAMILY = Feature(
    "pmx",
    "Arcus PMX-2ED-SA",
    adds=(
        Dialect(
            "pmx",
            f"{HERE}.host.family:PmxFamily",
            files=ProgramFiles(
                "A-SCRIPT",
                (".prg", ".asc"),
                f"{HERE}.manual.program_file",
                f"{HERE}.manual.editing:EDITING",
                ("ascript", "a-script", "pmx"),
            ),
        ),
        Simulated("pmx", f"{HERE}.simulator.family:SimulatedPmx", ("PMX",), f"{HERE}.simulator.program_run:AScriptRun"),
        UsbModule("pmx", "a PMX controller", "Performax controller", 0x1589, 0xA101, ("Arcus", "Performax USB")),
        Demo(f"{HERE}.simulator"),
        LineChecksum("pmx", "PMX", f"{HERE}.host.checksums:pmx"),
        Examples("program list", ("program list 'sim:#pmx'",)),
        Examples("poll", ("poll 'sim:#pmx' PX --every 0.5 --rows 10",)),
        Examples("help", ("help EX --dialect pmx",)),
    ),
)
