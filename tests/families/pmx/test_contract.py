"""PMX in the suite that all families pass."""

from multidrop.contract import (
    Absent,
    Error,
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

SHUTTLE = "PRG 0\nWHILE 1=1\nX1000\nWAITX\nX0\nWAITX\nENDWHILE\nEND\n"


class TestPmx(FamilyContract):
    sample = FamilySample(
        family="pmx",
        drive='personality = "PMX"',
        addresses=("00", "01"),
        product="PMX-2ED-SA",
        name="00",
        setup=("HSPD=2000", "ACC=50", "ABS"),
        absent=Absent("55", "55 does not reply: it is not known whether 'PX' was executed; it was sent once; "),
        reads=Read("PX", "0"),
        reads_other=Read("ID", "Performax-2ED-SA"),
        writes=Written("V1=7", "V1", "0", "7", ("V1", 9)),
        refused=Wrong(
            "hspd=5", r"{} refused 'hspd=5': .hspd=5: it does not know that command .*capitals only: HSPD=5\)"
        ),
        unsent=None,
        moves=Moved("X1000", 1000),
        far="JX+",
        far_others=("JY-",),
        ends="STOPX",
        limited='personality = "PMX"\n[bus.drive.world.x]\nlimit_plus = 3000',
        limit="{} X stopped at 3000: plus limit; CLRX clears the error",
        starts=("X1000", "JX+", "HX-", "SR0=1", "EO=3", "GS0", "SR0=0"),
        harmless=("PX", "V1=7", "STOPX", "ABORT", "HSPD=500"),
        ended_only=("SR0=0",),
        only_reads=("PX",),
        stop=b"@00ABORT\r",
        stop_all=(b"@01ABORT\r", b"@00SR0=0\r", b"@01SR1=0\r"),
        word=Read("V1", "0"),
        state="X: at rest; StepNLoop off",
        axis="x",
        scaled=Scaled("0.01 mm/step", "0.01 mm/step, one step is 0.01 mm, SLX=0, POLX=0", "X{5 mm}", 500, (5.0, "mm")),
        turn="the controller does not report the steps of a turn",
        setting=Setting(
            "HSPD", "HSPD=600", "HSPD: here 600, there 1000 pulses/s", "HSPD=1000 (was 600)", b"STORE", False
        ),
        program=Program("shuttle.prg", SHUTTLE, "0", "SR0=1", 13, "X1000", "FROB\n", "1:1: .*"),
        guarded="STORE",
        help=Read("HSPD", "HSPD: high speed: what a move runs at; an axis's own counts unless it is 0"),
        completes=Read("HS", "HSPDX"),
        position="PX",
        runs=Ran(-20000, ("HSPDX=20000", "JX-"), ("STOPX",)),
        homes=Homed('personality = "PMX"\nworld.x = { home = -2000 }', "HX-"),
        output="DO1=1",
        current="EO1",
        inputs=frozenset({*range(1, 9), "home", "lim+", "lim-", "Z"}),
        error=Error(".*plus limit.*", ".*plus limit.*"),
    )
