"""The Lexium's words for the drive itself, for programs, and its operators (MCode reference, sections 3 to 5)."""

from __future__ import annotations

from multidrop.dialects.mcode.manual.mnemonic import (
    CLOSED_LOOP,
    FLOAT_HIGH,
    INT_HIGH,
    INT_LOW,
    MODULE,
    NOT_STEPPABLE,
    READ_ONLY,
    SERIAL,
    Mnemonic,
    flag,
    mode,
    number,
    status,
)

# The drive itself: communication, errors, identity, memory, health (MCode reference, section 5).


COMMUNICATION_WORDS: tuple[Mnemonic, ...] = (
    mode("BD", "Baud rate", "first digits of the rate: 48, 96, 19, 38, 11 for 4800 to 115200", "5.1.9", low=11,
        high=96, default=96, values=(48, 96, 19, 38, 11), products=SERIAL,
        note="acts after S and a reset; serial drives only"),
    mode("CE", "Reset enable", "Ctrl+C: 0 ignored, 1 resets the drive, 2 with its name in party mode", "5.1.19",
        low=0, high=2, default=1),
    mode("CK", "Checksum", "0 none; 1 always ACK or NAK; 2 fewer while a program runs", "5.1.21", low=0, high=2,
        default=0, products=SERIAL, note="serial drives only"),
    flag("DG", "Quiet on global commands", "0 answers what comes for `*`, 1 keeps quiet; in party mode", "5.1.31", 1,
        products=SERIAL, note="serial drives only; several answers at once garble each other"),
    mode("DN", "Device name", "one letter or digit that addresses the drive in party mode", "5.1.33", default="!",
        syntax='DN="<character>", PR DN', products=SERIAL,
        note='serial drives only; case counts; without quotation marks a Lexium gives error 21; FD restores "!"'),
    mode("EM", "Echo mode", "0 echo and prompt, 1 CRLF only, 2 prints only, 3 echo after the line", "5.1.39", low=0,
        high=3, default=0),
    mode("ES", "Escape mode", "what stops: 0 Ctrl+E, 1 Esc; 2, 3 the same after the device name", "5.1.41", low=0,
        high=3, default=1),
    flag("PY", "Party mode", "1 several drives share the line and each is addressed by its name", "5.1.105", 0,
        products=SERIAL, note="serial drives only; a line feed activates it and ends every command"),
    flag("QD", "Queued", "1 makes the drive answer to `^` too; in party mode", "5.1.106", 0, products=SERIAL,
        note="serial drives only"),
)  # fmt: skip

HEALTH: tuple[Mnemonic, ...] = (
    status("EF", "Error flag", "1 after an error, until ER is read or set to 0 or a program starts", "5.1.37",
        access="RC", note="reading EF itself clears nothing"),
    number("ER", "Error", "number of the last error; READING IT CLEARS it and EF", "5.1.40", access="RC",
        step=NOT_STEPPABLE, low=0, high=111, default=0, syntax="PR ER, ER=<code>, BR <label/address>,ER=<code>",
        note="may also be set; 0 clears"),
    number("IT", "Internal temperature", "temperature of the bridge and of the controller", "5.1.67", access="RO",
        step=READ_ONLY, low=-20, high=100, unit="°C", syntax="PR IT, PR IT,<1/2>",
        note="1 only the bridge, 2 only the controller"),
    Mnemonic("VT", "Voltage", "supply status (0 good, 1 no auxiliary, 2 +V bad, 3 both) and volts", "5.1.142",
        "PR VT, PR VT,<1/2>", access="RO", kind="variable", unit="V", note="1 only auxiliary, 2 only +V"),
    number("WT", "Warning temperature", "temperature above which error 71 comes", "5.1.143", low=0, high=84,
        unit="°C", default=80, syntax="WT=<temperature>, PR WT"),
)  # fmt: skip

MEMORY: tuple[Mnemonic, ...] = (
    Mnemonic("AL", "All parameters", "with PR: prints every variable and flag", "5.1.4", "PR AL", access="RO",
        kind="keyword", program=False, lines=True),
    Mnemonic("FD", "Factory defaults", "ERASES programs, variables and settings, then resets", "5.1.45", "FD",
        note="at once, without asking; PN, SN, PW and FS stay"),
    Mnemonic("IP", "Initialize parameters", "puts every variable and flag back to its saved value", "5.1.63", "IP",
        starts=True, note="not while moving (error 74)"),
    Mnemonic("PN", "Part number", "with PR: the drive's part number", "5.1.101", "PR PN", access="RO",
        kind="keyword"),
    mode("PW", "PWM mask", "mask, period, frequency and control of the current regulator", "5.1.104",
        syntax="PW=<mask>,<period>,<frequency>,<control>, PR PW", products=MODULE, reserved_on=MODULE,
        note="Motion Module only; free as a name elsewhere; FD keeps it"),
    Mnemonic("S", "Save", "keeps variables, flags and programs in non-volatile memory", "5.1.113", "S",
        note="not during MA or MR (error 73)"),
    Mnemonic("SC", "Configuration test", "turns the shaft half a turn to test the encoder; take the load off",
        "5.1.115", "SC 1", low=1, high=1, products=CLOSED_LOOP, starts=True, note="MOVES the motor"),
    Mnemonic("SN", "Serial number", "with PR: the drive's serial number", "5.1.119", "PR SN", access="RO",
        kind="keyword"),
    Mnemonic("UG", "Upgrade firmware", "enters upgrade mode, which must then be completed", "5.1.133", "UG <code>",
        note="for the maker's upgrade program only"),
    Mnemonic("VR", "Version", "with PR: product, firmware and hardware version", "5.1.141", "PR VR", access="RO",
        kind="keyword"),
    *(
        Mnemonic(
            name, "Reserved", "reserved for the maker; no name for a variable or a label (error 24)",
            section, "",
            kind="reserved", immediate=False, program=False,
        )
        for name, section in (("FT", "5.1.49"), ("PK", "5.1.99"))
    ),
)  # fmt: skip

SYSTEM: tuple[Mnemonic, ...] = COMMUNICATION_WORDS + HEALTH + MEMORY


# Programs: flow, labels, variables, printing (MCode reference 3.2, 3.3, section 5).


_CONDITIONS = (
    "beyond one comparison it is read from left to right: R1=1&MV as (R1=1)&MV, KF&12=12 as (KF&12)=12, "
    "P<R1+100 as P<(R1+100)"
)

PROGRAM: tuple[Mnemonic, ...] = (
    Mnemonic("BP", "Break point", "in trace or single step, break at a place after some passes", "5.1.13",
        "BP <label/address>,<count>, BP", note="BP=0 removes it; BP alone breaks a running program where it is"),
    Mnemonic("BR", "Branch", "go on at a label or address, if the condition holds", "5.1.14",
        "BR <label/address>[,<condition>]", starts=True, note=_CONDITIONS),
    status("BY", "Busy", "1 while a program runs", "5.1.15", syntax="PR BY"),
    Mnemonic("CL", "Call", "run a subroutine up to its RT, if the condition holds", "5.1.22",
        "CL <label/address>[,<condition>]", immediate=False, starts=True, note=_CONDITIONS),
    Mnemonic("CP", "Clear program", "ERASES program memory, all of it or from a label on", "5.1.23",
        "CP, CP <0/1>, CP <label/address>, CP <0/1>,<label/address>", program=False,
        note="0 keeps global variables, 1 deletes them; S makes it last; not while moving (error 74)"),
    Mnemonic("DC", "Decrement", "takes 1 from a variable", "5.1.29", "DC <variable>",
        note="read only is error 25, a mode or a setting error 26"),
    Mnemonic("E", "End", "ends the program, after the move that is under way", "5.1.35", "E",
        note="in a program: its last line"),
    Mnemonic("EX", "Execute", "runs a program: 0 normally, 1 traced, 2 step by step", "5.1.42",
        "EX <label/address>[,<0-2>]", program=False, starts=True, note="stepping: space one line, Enter runs on"),
    Mnemonic("H", "Hold", "waits until motion is over, or so many milliseconds", "5.1.50", "H, H <time>",
        immediate=False, low=1, high=65000, unit="ms"),
    Mnemonic("IC", "Increment", "adds 1 to a variable", "5.1.60", "IC <variable>",
        note="read only is error 25, a mode or a setting error 26"),
    flag("IF", "Input pending", "1 while IV waits for a number", "5.1.61", 0, access="RC", step=NOT_STEPPABLE,
        syntax="IF=0, BR <label/address>,IF=<0/1>", note="may be cleared, not set"),
    Mnemonic("IV", "Input to variable", "takes the next number from the line into a variable", "5.1.68",
        "IV <variable>", immediate=False, note="wait for it with BR on IF=1"),
    Mnemonic("L", "List", "prints program memory from a label or address on", "5.1.70", "L, L <label/address>",
        program=False, note="error 44 while locked"),
    Mnemonic("LB", "Label", "names a place in the program", "5.1.71", "LB <name>", immediate=False,
        note="a letter, then nothing, a letter or digit, or two digits; in any case; LB SU runs at power-up"),
    flag("LK", "Lock", "1 hides program memory from listing, tracing and changing (error 44)", "5.1.75", 0,
        note="once saved, only CP of everything or FD opens it"),
    Mnemonic("OE", "On error", "subroutine to run after an error", "5.1.91", "OE <label/address>", access="RW",
        starts=True, note="it runs on errors of immediate commands too"),
    Mnemonic("PG", "Program mode", "with an address begins to store lines, alone ends that", "5.1.98",
        "PG <address>, PG", note="between the two every line is stored, none executed"),
    Mnemonic("PR", "Print", "prints values and texts; a last `;` leaves out the line end", "5.1.102",
        'PR <name>, PR "<text>",<name>', note="a line holds 64 characters at most"),
    Mnemonic("PS", "Pause", "pauses the program, and its move with a ramp", "5.1.103", "PS", note="RS goes on"),
    Mnemonic("RS", "Resume", "goes on with a paused program and its move", "5.1.111", "RS", starts=True),
    Mnemonic("RT", "Return", "ends a subroutine and continues after its call", "5.1.112", "RT", immediate=False),
    Mnemonic("SU", "Start up", "the label of a program that runs at power-up and after a reset", "5.1.121", "LB SU",
        kind="keyword", note="what it starts may MOVE at power-up"),
    Mnemonic("UV", "User variables", "with PR: prints user variables, their scope and values", "5.1.134", "PR UV",
        access="RO", kind="keyword", lines=True),
    Mnemonic("VA", "User variable", "declares a variable; inside a program it is that program's own", "5.1.136",
        "VA <name>[=<value>]", note="192 names together with labels; a mnemonic is not a name (error 29)"),
)  # fmt: skip


# Operators and registers: arithmetic, comparison, logic and trigonometry (MCode reference 4.2, 5.2).


def _operator(name: str, title: str, meaning: str, section: str, syntax: str) -> Mnemonic:
    return Mnemonic(name, title, meaning, section, syntax, kind="math")


def _function(name: str, title: str, meaning: str, section: str) -> Mnemonic:
    """A function of the floating point unit: firmware 6, so not on MDrivePlus."""
    syntax = f"F1={name}" if name == "PI" else f"F1={name} F2"
    return Mnemonic(name, title, meaning, section, syntax, kind="math", note="firmware 6")


MATH: tuple[Mnemonic, ...] = (
    *(
        number(
            f"R{n}", f"User register {n}", "a 32-bit whole number of the user's own", "5.1.107",
            low=INT_LOW, high=INT_HIGH, default=0, syntax=f"R{n}=<integer>, R{n}=R1<operator>R2, PR R{n}",
        )
        for n in range(1, 5)
    ),
    *(
        number(
            f"F{n}", f"Floating point register {n}", "a double precision number of the user's own", "5.1.43",
            low=-FLOAT_HIGH, high=FLOAT_HIGH, default=0.0,
            syntax=f"F{n}=<number>, F{n}=F1<operator>F2, PR F{n}",
            note="firmware 6; the fraction is dropped where a whole number is wanted; printed as PF says",
        )
        for n in range(1, 9)
    ),
    mode("PF", "Print format", "width, decimals, notation and justification of printed F registers", "5.1.97",
        default="10,6,0,0", syntax="PF=<width>,<decimals>,<0/1>,<0/1>, PR PF",
        note="firmware 6; width 0 to 16; third 1 is scientific, fourth 1 is left-justified"),
    flag("RA", "Radians or degrees", "unit of angles for trigonometry: 1 radians, 0 degrees", "5.1.108", 1,
        note="firmware 6"),
    _operator("+", "Add", "sum of the two sides", "5.2.1", "R1=R2+R3"),
    _operator("-", "Subtract", "left side less the right one", "5.2.2", "R1=R2-R3"),
    _operator("*", "Multiply", "product of the two sides", "5.2.3", "R1=R2*R3"),
    _operator("/", "Divide", "left side by the right one; whole numbers lose the fraction", "5.2.4", "R1=R2/R3"),
    _operator("=", "Equal", "assigns; in a condition: both sides are the same", "5.2.5", "BR <label>,R1=R2"),
    _operator("<>", "Not equal", "in a condition: the sides differ", "5.2.6", "BR <label>,R1<>R2"),
    _operator("<", "Less than", "in a condition: left is below right", "5.2.7", "BR <label>,R1<R2"),
    _operator("<=", "Less or equal", "in a condition: left is not above right", "5.2.8", "BR <label>,R1<=R2"),
    _operator(">", "Greater than", "in a condition: left is above right", "5.2.9", "BR <label>,R1>R2"),
    _operator(">=", "Greater or equal", "in a condition: left is not below right", "5.2.10", "BR <label>,R1>=R2"),
    _operator("&", "AND", "bits that both sides have", "5.2.11", "R1=R2&R3"),
    _operator("|", "OR", "bits that either side has", "5.2.12", "R1=R2|R3"),
    _operator("^", "XOR", "bits that one side has and the other has not", "5.2.13", "R1=R2^R3"),
    _operator("!", "NOT", "every bit of the one operand turned over", "5.2.14", "R1=!R2"),
    _function("AB", "Absolute value", "the number without its sign", "5.2.15"),
    _function("CS", "Cosine", "cosine of an angle, in RA's unit", "5.2.16"),
    _function("C_", "Arc cosine", "angle, in RA's unit, of a cosine", "5.2.17"),
    _function("LO", "Logarithm, base 2", "power of 2 that gives the number", "5.2.18"),
    _function("L_", "Logarithm, base 10", "power of 10 that gives the number", "5.2.19"),
    _function("PI", "Pi", "the constant 3.141592654", "5.2.20"),
    _function("SI", "Sine", "sine of an angle, in RA's unit", "5.2.21"),
    _function("S_", "Arc sine", "angle, in RA's unit, of a sine", "5.2.22"),
    _function("SQ", "Square root", "root of a number that is not negative", "5.2.23"),
    _function("TG", "Tangent", "tangent of an angle, in RA's unit", "5.2.24"),
    _function("T_", "Arc tangent", "angle, in RA's unit, of a tangent", "5.2.25"),
)  # fmt: skip
