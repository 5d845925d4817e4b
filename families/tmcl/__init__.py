"""Trinamic TMCL in direct mode: binary frames of nine bytes between a host and motion modules."""

from __future__ import annotations

from multidrop.base.feature import Feature
from multidrop.dialects.checksums import LineChecksum
from multidrop.dialects.families import Dialect
from multidrop.dialects.program_files import ProgramFiles
from multidrop.shell.operations.operation import Examples
from multidrop.simulator.declared import Simulated

HERE = __name__
FAMILY = Feature(
    "tmcl",
    "Trinamic motion modules",
    adds=(
        Dialect(
            "tmcl",
            f"{HERE}.host.family:TmclFamily",
            files=ProgramFiles(
                "TMCL",
                (".tmc", ".tmcl"),
                f"{HERE}.manual.program_file",
                f"{HERE}.manual.editing:EDITING",
                ("tmcl",),
            ),
        ),
        Simulated(
            "tmcl",
            f"{HERE}.simulator.family:SimulatedTmcl",
            (
                "TMCM",
                "TMCM-1140",
                "TMCM-1141",
                "TMCM-1161",
                "TMCM-1240",
                "TMCM-1241",
                "TMCM-1260",
                "TMCM-1276",
                "TMCM-3110",
                "TMCM-6110",
                "TMCM-6214",
            ),
            f"{HERE}.simulator.program_run:TmclRun",
        ),
        LineChecksum("tmcl", "TMCL", f"{HERE}.host.checksums:tmcl"),
        Examples("scan", ("scan /dev/ttyUSB0 --dialect tmcl --all",)),
    ),
)
