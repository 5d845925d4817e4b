"""Inputs, outputs and trips (MCode reference 3.4, section 5)."""

from __future__ import annotations

from typing import Unpack

from multidrop.dialects.mcode.manual.mnemonic import (
    CLOSED_LOOP,
    ENCODER,
    INT_HIGH,
    INT_LOW,
    LEXIUM,
    NOT_STEPPABLE,
    READ_ONLY,
    Fields,
    Mnemonic,
    mode,
    number,
    status,
)

_FILTER = "0 50 ns, 1 150, 2 200, 3 300, 4 500, 5 900, 6 1.7 µs, 7 3.3, 8 6.5, 9 12.9"


def _trip(name: str, title: str, meaning: str, section: str, form: str, **more: Unpack[Fields]) -> Mnemonic:
    """A trip: when it runs which subroutine. TE arms it."""
    fields: Fields = {"access": "RW", "kind": "variable", "step": 26, "syntax": form, "starts": True}
    merged: Fields = {**fields, **more}
    return Mnemonic(name, title, meaning, section, **merged)


def _input(n: int) -> Mnemonic:
    return status(
        f"I{n}", f"Input {n}", "1 while the input is active, filtered, as IS sets it", "5.1.56",
        kind="variable",
    )  # fmt: skip


INPUTS: tuple[Mnemonic, ...] = (
    *(
        number(
            f"D{n}", f"Filter of input {n}", "how long a new level must last; 0: no filter", "5.1.25",
            low=0, high=255, unit="ms", default=0,
        )
        for n in range(1, 5)
    ),
    number(
        "D5", "Filter of the analog input", "running average over this many readings", "5.1.26",
        low=0, high=1000, unit="counts", default=0,
    ),
    mode(
        "FC", "Filter of the capture input", "shortest pulse that counts on a capture input",
        "5.1.44", low=0, high=9, default=0, note=f"modes: {_FILTER}; not on NEMA 17",
    ),
    mode(
        "FM", "Filter of the clock inputs", "shortest pulse that counts on inputs 3 and 4",
        "5.1.47", low=0, high=9, default=0, note=f"modes: {_FILTER}",
    ),
    mode(
        "FL", "Following", "1 follows the clock on inputs 3 and 4, one to one", "5.1.46",
        kind="flag", low=0, high=1, default=0, syntax="FL=<0/1>, PR FL", starts=True,
        note="firmware 6; inputs 3 and 4 must be of types 13 to 15",
    ),
    *(_input(n) for n in range(1, 5)),
    number(
        "I5", "Analog input", "reading of the 12-bit analog input", "5.1.57", access="RO", step=READ_ONLY,
        low=0, high=4095, unit="counts", syntax="PR I5, BR <label/address>,I5><value>",
    ),
    status(
        "I6", "Encoder index", "1 while the encoder is at its index mark", "5.1.58", kind="variable",
        products=ENCODER, note="needs an encoder",
    ),
    *(
        Mnemonic(
            f"I{n}", "Reserved", "reserved for the maker; no name for a variable or a label (error 24)",
            "5.1.59",
            "", kind="reserved", immediate=False, program=False,
        )
        for n in range(7, 14)
    ),
    number(
        "IN", "Inputs as a group", "levels of all inputs, input 1 the lowest bit; not filtered", "5.1.62",
        access="RO", step=READ_ONLY, low=0, high=15, syntax="PR IN, BR <label/address>,IN=<0-15>",
    ),
    mode(
        "IS", "Input setup", "type and active level of an input; 5 is analog, 6 the index mark",
        "5.1.64 to 5.1.66",
        syntax="IS=<1-4>,<type>,<active>, IS=5,<sense>,<range>, IS=6,<active>, PR IS", lines=True,
        starts=True,
        note="types: 0 user, 1 home, 2 limit +, 3 limit -, 4 go, 5 soft stop, 6 pause, 7 jog +, 8 jog -, "
        "11 reset, 12 capture (input 1), 13 to 15 clocks (inputs 3, 4); 9 voltage, 10 current (input 5)",
    ),
)  # fmt: skip

OUTPUTS: tuple[Mnemonic, ...] = (
    number(
        "AO", "Attention output mask", "sum of the events that light the attention output and LED 2", "5.1.5",
        low=0, high=4294967295, default=0, syntax="AO=<mask>, PR AO", step=NOT_STEPPABLE,
        note="1 error, 4 lead, 8 lag, 512 hold current, 16384 moving, 32768 stall",
    ),
    number(
        "CW", "Clock width", "length of a trip output's pulse", "5.1.24",
        low=0, high=255, unit="50 ns", default=10, syntax="CW=<time>, PR CW",
    ),
    *(
        mode(
            f"O{n}", f"Output {n}", "1 makes the output active, 0 inactive, in either sense", "5.1.90",
            access="WO", low=0, high=1, syntax=f"O{n}=<0/1>",
            note="for an output of type 16" + ("; not on NEMA 17" if n < 3 else ""),
        )
        for n in range(1, 4)
    ),
    number(
        "OF", "Output fault", "overcurrent: 0 none, 1 output 1, 2 output 2, 3 both", "5.1.92",
        access="RO", step=READ_ONLY, low=0, high=3, default=0, syntax="PR OF, BR <label/address>,OF=<status>",
        products=LEXIUM - {"LMM"},
    ),
    mode(
        "OS", "Output setup", "type and active level of an output", "5.1.93",
        syntax="OS=<1-3>,<type>[,<active>], PR OS", lines=True,
        note="types: 16 user, 17 moving, 18 error, 19 stall, 20 velocity changing, "
        "21 locked rotor, 23 moving to a position, 24 hMT active, 25 make-up, "
        "26, 27 encoder A, B (1, 2), 28 trip (3), 29 attention",
    ),
    mode(
        "OT", "Outputs as a group", "sets all outputs at once, output 1 the lowest bit", "5.1.94",
        access="WO", low=0, high=7, syntax="OT=<0-7>",
    ),
)  # fmt: skip

TRIPS: tuple[Mnemonic, ...] = (
    _trip(
        "TA", "Trip on hMT status", "run a subroutine on calibration, hMT, locked rotor, lag or lead",
        "5.1.122",
        "TA=<mask>,<label/address>, PR TA", low=0, high=31, default=0, products=CLOSED_LOOP,
        note="1 calibrated, 2 active, 4 locked, 8 lag, 16 lead; TE=32 arms it",
    ),
    _trip(
        "TC", "Trip on capture", "run a subroutine when input 1, of type capture, turns active", "5.1.123",
        "TC=<label/address>, PR TC", note="TE=4 arms it",
    ),
    number(
        "TE", "Trip enable", "armed trips: 1 TI, 2 TP, 4 TC, 8 TT, 16 TR, 32 TA, 64 TM", "5.1.125",
        low=0, high=127, default=0, step=NOT_STEPPABLE, syntax="TE=<sum>, PR TE", starts=True,
        note="a trip that is not set up is error 27",
    ),
    _trip(
        "TI", "Trip on input", "run a subroutine when an input turns active", "5.1.126",
        "TI=<input>,<label/address>, PR TI", low=1, high=4, unit="input", note="TE=1 arms it, and is cleared",
    ),
    _trip(
        "TM", "Trip on main power loss", "run a subroutine when +V fails and auxiliary power stays",
        "5.1.127",
        "TM=<label/address>, PR TM", note="TE=64 arms it",
    ),
    _trip(
        "TP", "Trip on position", "run a subroutine when a position is reached", "5.1.128",
        "TP=<position>,<label/address>, PR TP", low=INT_LOW, high=INT_HIGH, unit="steps",
        unit_encoder="counts",
        note="TE=2 arms it, and is cleared; not together with TR (error 39)",
    ),
    _trip(
        "TR", "Trip on relative position", "run a subroutine, or pulse the output, every so far", "5.1.130",
        "TR=<distance>,<label/address>[,<repeats>], PR TR", low=INT_LOW, high=INT_HIGH, unit="steps",
        unit_encoder="counts",
        note="TE=16 arms it; repeats 0 is for ever, else up to 65000; label 0: output only",
    ),
    _trip(
        "TT", "Trip on time", "run a subroutine once, after a time", "5.1.132",
        "TT=<time>,<label/address>, PR TT", low=1, high=65535, unit="ms", note="TE=8 arms it",
    ),
)  # fmt: skip

IO: tuple[Mnemonic, ...] = INPUTS + OUTPUTS + TRIPS
