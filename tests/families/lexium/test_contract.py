"""MCode and Modbus in the suite that all families pass."""

from dataclasses import replace

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

SWITCH = 'set = { IS = ["1,2,0", "2,3,0"] }\nworld = { limit_plus = 30000 }'
HOME = 'set = { IS = ["1,1,0"] }\nworld = { home = -2000 }'
SHUTTLE = "PG 1\nLB G1\nMA 20000\nH\nMA 0\nH\nBR G1\nE\nPG\n"
VM = Setting("VM", "VM=600000", "VM: here 600000, there 768000 steps/s", "VM=768000 (was 600000)", saves=b"S")
SCALE = "5 mm/turn, 51200 steps a turn, one step is 0.0000977 mm, MS=256, EE=0, AS=0"
STARTS = ("MA 0", "MR 5", "SL 500", "HM 1", "EX G1")
HARMLESS = ("PR P", "VM=500000", "P=0", "S", "E")


class TestMCode(FamilyContract):
    sample = FamilySample(
        family="mcode",
        drive='personality = "LMDCM"\nparty = true',
        addresses=("a", "b"),
        product="LMDCM",
        name="a",
        absent=Absent("z", "z does not reply: 'PR P' was not sent; no reply came from it so far"),
        reads=Read("PR P", "0"),
        reads_other=Read("PR VM", "768000"),
        writes=Written("VM=500000", "PR VM", "768000", "500000", ("VM", 400000)),
        refused=Wrong("VM=5", r"{} refused 'VM=5': error 23: VM must be above VI \(lower VI or raise VM first\)"),
        unsent=None,
        moves=Moved("MA 20000", 20000),
        far="SL 20000",
        ends="SL 0",
        limited=f'personality = "LMDCM"\nparty = true\n{SWITCH}',
        limit="{} stopped at [0-9]+: error 83: plus limit reached",
        starts=(*STARTS, "SL 0"),
        harmless=HARMLESS,
        only_reads=("PR P",),
        ended_only=("SL 0",),
        stop=b"\x1b",
        word=Read("VM", "768000"),
        state="at rest: P=0",
        scaled=Scaled("5 mm/turn", f"{SCALE}, RD=0", "MA {10 mm}", 102400, (10.0, "mm")),
        setting=VM,
        program=Program(
            "shuttle.mxt",
            SHUTTLE,
            "G1",
            "EX G1",
            7,
            "1   LB G1",
            "PG 1\nXX 5\nE\nPG\n",
            "2:1: .*",
        ),
        guarded="IP",
        help=Read("VM", "VM: Maximum velocity (variable)"),
        completes=Read("VI", "VI"),
        position="P",
        runs=Ran(-20000, ("SL -20000",), ("SL 0",)),
        homes=Homed(f'personality = "LMDCM"\nparty = true\n{HOME}', "HM 1"),
        output="O1=1",
        current="DE",
        inputs=frozenset({1, 2, 3, 4}),
        error=Error("an error is set; read_error.. reads and clears its number", "error 83: plus limit.*"),
    )


OLD = 'personality = "MDIX"\nparty = true'


class TestMDrivePlus(FamilyContract):
    sample = replace(
        TestMCode.sample,
        drive=f'{OLD}\nset = {{ S1 = "16,1,0" }}',
        product="MDIX",
        limited=f'{OLD}\nset = {{ S2 = "2,0,0", S3 = "3,0,0" }}\nworld = {{ limit_plus = 30000 }}',
        scaled=Scaled("5 mm/turn", f"{SCALE.removesuffix(', AS=0')}, EL=512", "MA {10 mm}", 102400, (10.0, "mm")),
        setting=Setting("S4", "S4=17,1", "S4: here [17, 1, 0], there [0, 0, 0]", "S4=0,0,0 (was [17, 1, 0])", b"S"),
        homes=Homed(f'{OLD}\nset = {{ S1 = "1,0,0" }}\nworld = {{ home = -2000 }}', "HM 1"),
        inputs=frozenset({2, 3, 4}),
    )


class TestModbus(FamilyContract):
    sample = FamilySample(
        family="modbus",
        drive='personality = "LMDCE"',
        addresses=("",),
        product="LMDCE",
        name="line",
        absent=Absent("z", "no address z: the drive on line takes none; @line: TEXT goes to it"),
        reads=Read("PR P", "0"),
        reads_other=Read("PR VM", "768000"),
        writes=Written("VM=500000", "PR VM", "768000", "500000", ("VM", 400000)),
        refused=Wrong(
            "HC=101",
            r"the drive refused 'HC=101': "
            r"exception 03 illegal data value at register 0x0029 \(HC\), which takes 0 to 100.*",
        ),
        unsent=Wrong(
            "PR UV",
            r"UV has no Modbus register; MCode/TCP \(tcp://HOST:503\) knows it",
        ),
        moves=Moved("MA 20000", 20000),
        far="SL 20000",
        ends="SL 0",
        limited=f'personality = "LMDCE"\n{SWITCH}',
        limit="{} stopped at [0-9]+: error 83: plus limit reached",
        starts=STARTS,
        harmless=(*HARMLESS, "SL 0"),
        only_reads=("PR P",),
        ended_only=("SL 0",),
        stop=bytes.fromhex("FFFE0000000601412020 2045 FFFF0000000B0110007800020400000000"),
        word=Read("VM", "768000"),
        state="at rest: P=0",
        scaled=Scaled("5 mm/turn", SCALE, "MA {10 mm}", 102400, (10.0, "mm")),
        setting=VM._replace(saves=bytes.fromhex("01100076000102 0001")),
        program=None,
        no_programs="programs are neither listed nor written over Modbus; MCode/TCP (tcp://HOST:503) does both",
        traced=False,
        registers=True,
        scanned=False,
        guarded="IP",
        help=Read("VM", "VM: Maximum velocity (variable)"),
        completes=Read("VI", "VI"),
        position="P",
        runs=Ran(-20000, ("SL -20000",), ("SL 0",)),
        homes=Homed(f'personality = "LMDCE"\n{HOME}', "HM 1"),
        output="O1=1",
        current="DE",
        inputs=frozenset({1, 2, 3, 4}),
        error=Error("an error is set; read_error.. reads and clears its number", "error 83: plus limit.*"),
    )
