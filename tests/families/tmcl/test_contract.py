"""TMCL in the suite that all families pass."""

from multidrop.contract import (
    Absent,
    FamilyContract,
    FamilySample,
    Homed,
    Moved,
    Program,
    Ran,
    Read,
    Scaled,
    Setting,
    Written,
    Wrong,
)

SHUTTLE = "Loop: MVP ABS, 0, 20000 // far\n  WAIT POS, 0, 0\n  MVP ABS, 0, 0\n  WAIT POS, 0, 0\n  JA Loop\n"


class TestTmcl(FamilyContract):
    sample = FamilySample(
        family="tmcl",
        drive='personality = "TMCM-1241"',
        addresses=("1", "7"),
        product="TMCM-1241",
        name="1",
        absent=Absent(
            "9", "module 9 does not reply: it is not known whether 'GAP 1, 0' was executed; it was sent once; "
        ),
        reads=Read("GAP 1, 0", "0"),
        reads_other=Read("GAP 4, 0", "51200"),
        writes=Written("SAP 4, 0, 500", "GAP 4, 0", "51200", "500"),
        refused=Wrong("ROR 3, 100", r"module {} refused 'ROR 3, 100': status 3, wrong type \(.*\)"),
        unsent=Wrong(
            "MVP 0, 1", r"'MVP 0, 1': MVP takes 3 fields: MVP ABS\|REL\|COORD, motor, value; nothing was sent"
        ),
        moves=Moved("MVP ABS, 0, 3000", 3000),
        far="ROR 0, 20000",
        ends="MST 0",
        limited='personality = "TMCM-1241"\n[bus.drive.world]\nlimit_plus = 25600',
        limit="{} stopped at 25600: right limit switch is on",
        starts=("ROR 0, 1000", "MVP ABS, 0, 0", "SAP 2, 0, 5", "RFS START, 0", "SAP 4, 0, 500", "ROR 0, 0"),
        harmless=("GAP 1, 0", "MST 0", "RFS STOP, 0", "SGP 0, 2, 5"),
        only_reads=("GAP 1, 0",),
        ended_only=("ROR 0, 0",),
        stop=bytes.fromhex("010300000000000004"),
        stop_all=tuple(map(bytes.fromhex, ("07030000000000000a", "018000000000000081", "078000000000000087"))),
        word=Read("AP4", "51200"),
        state="motor 0: position 0, target 0, velocity 0, left switch off, right switch off, home switch off",
        scaled=Scaled(
            "5 mm/turn",
            "5 mm/turn, 51200 steps a turn, one step is 0.0000977 mm, 140=8, 255=1, 251=0, "
            "200 full steps a turn are assumed",
            "MVP ABS, 0, {1 mm}",
            10240,
            (1.0, "mm"),
        ),
        setting=Setting(
            "4",
            "SAP 4, 0, 600",
            "4: here 600, there 51200 maximum positioning velocity, microsteps/s",
            "SAP 4, 0, 51200 (was 600)",
            b"\x01\x07\x04",
        ),
        program=Program(
            "shuttle.tmc", SHUTTLE, "Loop", "129 1, 0, 0", 5, "0  Loop: MVP ABS, 0, 20000 // far", "FROB\n", "1:.*"
        ),
        guarded="STAP 4, 0",
        help=Read("ROL", "ROL: Rotate left at a velocity; a negative one turns right"),
        completes=Read("MV", "MVP"),
        position="AP1",
        runs=Ran(-20000, ("ROR 0, -20000",), ("ROR 0, 0",)),
        homes=Homed('personality = "TMCM-1241"\nworld.limit_minus = -2000', "RFS START, 0", "", ("SAP 193, 0, 1",)),
        output="SIO 1, 2, 1",
        current=None,
        no_current="direct mode has no command for it",
        inputs=frozenset({0, 1, "home", "lim+", "lim-"}),
        error=None,
        no_error="a module has no error to read: each refusal says its own; read('AP208')",
    )
