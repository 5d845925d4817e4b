"""Programs: flow, labels, variables, printing (MCode reference 3.2, 3.3, section 5)."""

from __future__ import annotations

from multidrop.dialects.mcode.manual.mnemonic import NOT_STEPPABLE, Mnemonic, flag, status

CONDITIONS = (
    "beyond one comparison it is read from left to right: R1=1&MV as (R1=1)&MV, KF&12=12 as (KF&12)=12, "
    "P<R1+100 as P<(R1+100)"
)

PROGRAM: tuple[Mnemonic, ...] = (
    Mnemonic(
        "BP", "Break point", "in trace or single step, break at a place after some passes", "5.1.13",
        "BP <label/address>,<count>, BP",
        note="BP=0 removes it; BP alone breaks a running program where it is",
    ),
    Mnemonic(
        "BR", "Branch", "go on at a label or address, if the condition holds", "5.1.14",
        "BR <label/address>[,<condition>]", starts=True,
        note=CONDITIONS,
    ),
    status("BY", "Busy", "1 while a program runs", "5.1.15", syntax="PR BY"),
    Mnemonic(
        "CL", "Call", "run a subroutine up to its RT, if the condition holds", "5.1.22",
        "CL <label/address>[,<condition>]", immediate=False, starts=True,
        note=CONDITIONS,
    ),
    Mnemonic(
        "CP", "Clear program", "ERASES program memory, all of it or from a label on", "5.1.23",
        "CP, CP <0/1>, CP <label/address>, CP <0/1>,<label/address>", program=False,
        note="0 keeps global variables, 1 deletes them; S makes it last; not while moving (error 74)",
    ),
    Mnemonic(
        "DC", "Decrement", "takes 1 from a variable", "5.1.29", "DC <variable>",
        note="read only is error 25, a mode or a setting error 26",
    ),
    Mnemonic(
        "E", "End", "ends the program, after the move that is under way", "5.1.35", "E",
        note="in a program: its last line",
    ),
    Mnemonic(
        "EX", "Execute", "runs a program: 0 normally, 1 traced, 2 step by step", "5.1.42",
        "EX <label/address>[,<0-2>]", program=False, starts=True, note="stepping: space one line, Enter runs on",
    ),
    Mnemonic(
        "H", "Hold", "waits until motion is over, or so many milliseconds", "5.1.50", "H, H <time>",
        immediate=False, low=1, high=65000, unit="ms",
    ),
    Mnemonic(
        "IC", "Increment", "adds 1 to a variable", "5.1.60", "IC <variable>",
        note="read only is error 25, a mode or a setting error 26",
    ),
    flag(
        "IF", "Input pending", "1 while IV waits for a number", "5.1.61", 0, access="RC", step=NOT_STEPPABLE,
        syntax="IF=0, BR <label/address>,IF=<0/1>", note="may be cleared, not set",
    ),
    Mnemonic(
        "IV", "Input to variable", "takes the next number from the line into a variable", "5.1.68",
        "IV <variable>",
        immediate=False, note="wait for it with BR on IF=1",
    ),
    Mnemonic(
        "L", "List", "prints program memory from a label or address on", "5.1.70", "L, L <label/address>",
        program=False, note="error 44 while locked",
    ),
    Mnemonic(
        "LB", "Label", "names a place in the program", "5.1.71", "LB <name>", immediate=False,
        note="a letter, then nothing, a letter or digit, or two digits; in any case; LB SU runs at power-up",
    ),
    flag(
        "LK", "Lock", "1 hides program memory from listing, tracing and changing (error 44)", "5.1.75", 0,
        note="once saved, only CP of everything or FD opens it",
    ),
    Mnemonic(
        "OE", "On error", "subroutine to run after an error", "5.1.91", "OE <label/address>", access="RW", starts=True,
        note="it runs on errors of immediate commands too",
    ),
    Mnemonic(
        "PG", "Program mode", "with an address begins to store lines, alone ends that", "5.1.98",
        "PG <address>, PG",
        note="between the two every line is stored, none executed",
    ),
    Mnemonic(
        "PR", "Print", "prints values and texts; a last `;` leaves out the line end", "5.1.102",
        'PR <name>, PR "<text>",<name>', note="a line holds 64 characters at most",
    ),
    Mnemonic(
        "PS", "Pause", "pauses the program, and its move with a ramp", "5.1.103", "PS", note="RS goes on",
    ),
    Mnemonic("RS", "Resume", "goes on with a paused program and its move", "5.1.111", "RS", starts=True),
    Mnemonic(
        "RT", "Return", "ends a subroutine and continues after its call", "5.1.112", "RT", immediate=False,
    ),
    Mnemonic(
        "SU", "Start up", "the label of a program that runs at power-up and after a reset", "5.1.121",
        "LB SU",
        kind="keyword", note="what it starts may MOVE at power-up",
    ),
    Mnemonic(
        "UV", "User variables", "with PR: prints user variables, their scope and values", "5.1.134", "PR UV",
        access="RO", kind="keyword", lines=True,
    ),
    Mnemonic(
        "VA", "User variable", "declares a variable; inside a program it is that program's own", "5.1.136",
        "VA <name>[=<value>]", note="192 names together with labels; a mnemonic is not a name (error 29)",
    ),
)  # fmt: skip
