"""The drive itself: communication, errors, identity, memory, health (MCode reference, section 5)."""

from __future__ import annotations

from multidrop.dialects.mcode.manual.mnemonic import (
    CLOSED_LOOP,
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

COMMUNICATION: tuple[Mnemonic, ...] = (
    mode(
        "BD", "Baud rate", "first digits of the rate: 48, 96, 19, 38, 11 for 4800 to 115200", "5.1.9",
        low=11, high=96, default=96, values=(48, 96, 19, 38, 11), products=SERIAL,
        note="acts after S and a reset; serial drives only",
    ),
    mode(
        "CE", "Reset enable", "Ctrl+C: 0 ignored, 1 resets the drive, 2 with its name in party mode",
        "5.1.19",
        low=0, high=2, default=1,
    ),
    mode(
        "CK", "Checksum", "0 none; 1 always ACK or NAK; 2 fewer while a program runs", "5.1.21",
        low=0, high=2, default=0, products=SERIAL, note="serial drives only",
    ),
    flag(
        "DG", "Quiet on global commands", "0 answers what comes for `*`, 1 keeps quiet; in party mode",
        "5.1.31", 1,
        products=SERIAL, note="serial drives only; several answers at once garble each other",
    ),
    mode(
        "DN", "Device name", "one letter or digit that addresses the drive in party mode", "5.1.33",
        default="!", syntax='DN="<character>", PR DN', products=SERIAL,
        note='serial drives only; case counts; without quotation marks a Lexium gives error 21; FD restores "!"',
    ),
    mode(
        "EM", "Echo mode", "0 echo and prompt, 1 CRLF only, 2 prints only, 3 echo after the line", "5.1.39",
        low=0, high=3, default=0,
    ),
    mode(
        "ES", "Escape mode", "what stops: 0 Ctrl+E, 1 Esc; 2, 3 the same after the device name", "5.1.41",
        low=0, high=3, default=1,
    ),
    flag(
        "PY", "Party mode", "1 several drives share the line and each is addressed by its name", "5.1.105", 0,
        products=SERIAL, note="serial drives only; a line feed activates it and ends every command",
    ),
    flag(
        "QD", "Queued", "1 makes the drive answer to `^` too; in party mode", "5.1.106", 0,
        products=SERIAL, note="serial drives only",
    ),
)  # fmt: skip

HEALTH: tuple[Mnemonic, ...] = (
    status(
        "EF", "Error flag", "1 after an error, until ER is read or set to 0 or a program starts", "5.1.37",
        access="RC", note="reading EF itself clears nothing",
    ),
    number(
        "ER", "Error", "number of the last error; READING IT CLEARS it and EF", "5.1.40",
        access="RC", step=NOT_STEPPABLE, low=0, high=111, default=0,
        syntax="PR ER, ER=<code>, BR <label/address>,ER=<code>", note="may also be set; 0 clears",
    ),
    number(
        "IT", "Internal temperature", "temperature of the bridge and of the controller", "5.1.67",
        access="RO", step=READ_ONLY, low=-20, high=100, unit="°C", syntax="PR IT, PR IT,<1/2>",
        note="1 only the bridge, 2 only the controller",
    ),
    Mnemonic(
        "VT", "Voltage", "supply status (0 good, 1 no auxiliary, 2 +V bad, 3 both) and volts", "5.1.142",
        "PR VT, PR VT,<1/2>", access="RO", kind="variable", unit="V", note="1 only auxiliary, 2 only +V",
    ),
    number(
        "WT", "Warning temperature", "temperature above which error 71 comes", "5.1.143",
        low=0, high=84, unit="°C", default=80, syntax="WT=<temperature>, PR WT",
    ),
)  # fmt: skip

MEMORY: tuple[Mnemonic, ...] = (
    Mnemonic(
        "AL", "All parameters", "with PR: prints every variable and flag", "5.1.4", "PR AL",
        access="RO", kind="keyword", program=False, lines=True,
    ),
    Mnemonic(
        "FD", "Factory defaults", "ERASES programs, variables and settings, then resets", "5.1.45", "FD",
        note="at once, without asking; PN, SN, PW and FS stay",
    ),
    Mnemonic(
        "IP", "Initialize parameters", "puts every variable and flag back to its saved value", "5.1.63", "IP",
        starts=True, note="not while moving (error 74)",
    ),
    Mnemonic(
        "PN", "Part number", "with PR: the drive's part number", "5.1.101", "PR PN", access="RO",
        kind="keyword",
    ),
    mode(
        "PW", "PWM mask", "mask, period, frequency and control of the current regulator", "5.1.104",
        syntax="PW=<mask>,<period>,<frequency>,<control>, PR PW", products=MODULE, reserved_on=MODULE,
        note="Motion Module only; free as a name elsewhere; FD keeps it",
    ),
    Mnemonic(
        "S", "Save", "keeps variables, flags and programs in non-volatile memory", "5.1.113", "S",
        note="not during MA or MR (error 73)",
    ),
    Mnemonic(
        "SC", "Configuration test", "turns the shaft half a turn to test the encoder; take the load off",
        "5.1.115",
        "SC 1", low=1, high=1, products=CLOSED_LOOP, starts=True, note="MOVES the motor",
    ),
    Mnemonic(
        "SN", "Serial number", "with PR: the drive's serial number", "5.1.119", "PR SN", access="RO",
        kind="keyword",
    ),
    Mnemonic(
        "UG", "Upgrade firmware", "enters upgrade mode, which must then be completed", "5.1.133", "UG <code>",
        note="for the maker's upgrade program only",
    ),
    Mnemonic(
        "VR", "Version", "with PR: product, firmware and hardware version", "5.1.141", "PR VR",
        access="RO", kind="keyword",
    ),
    *(
        Mnemonic(
            name, "Reserved", "reserved for the maker; no name for a variable or a label (error 24)",
            section, "",
            kind="reserved", immediate=False, program=False,
        )
        for name, section in (("FT", "5.1.49"), ("PK", "5.1.99"))
    ),
)  # fmt: skip

SYSTEM: tuple[Mnemonic, ...] = COMMUNICATION + HEALTH + MEMORY
