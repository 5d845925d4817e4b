"""The Lexium's words for motion, encoder, hMT, inputs, outputs and trips (MCode reference 3.4, section 5)."""

from __future__ import annotations

from typing import Unpack

from multidrop.dialects.mcode.manual.mnemonic import (
    CLOSED_LOOP,
    ENCODER,
    INT_HIGH,
    INT_LOW,
    LEXIUM,
    MODULE,
    NOT_STEPPABLE,
    READ_ONLY,
    TOP_SPEED,
    Fields,
    Mnemonic,
    flag,
    mode,
    number,
    status,
)

# Motion, encoder and hMT: moves, velocities, currents, positions (MCode reference, section 5).


MS_VALUES = (1, 2, 4, 5, 8, 10, 16, 25, 32, 50, 64, 100, 108, 125, 127, 128, 180, 200, 250, 256)
"""Microsteps per full step that MS accepts (5.1.85)."""
SA_VALUES = (0.45, 0.72, 0.9, 1.8, 1.875, 2, 2.5, 3.6, 5)
"""Step angles that SA accepts, degrees (5.1.114)."""

_HOMING = "types: 1 minus then plus, 2 minus then minus, 3 plus then minus, 4 plus then plus (VM seeks, VI creeps)"


def _move(name: str, title: str, meaning: str, section: str) -> Mnemonic:
    return Mnemonic(
        name, title, meaning, section, f"{name} <position>[,<0/1>][,<0/1>]", low=INT_LOW, high=INT_HIGH,
        unit="steps", unit_encoder="counts", starts=True,
        note="second 1: sends the device name when it is over; third 1: does not stop there",
    )  # fmt: skip


def _home(name: str, title: str, meaning: str, section: str, **more: Unpack[Fields]) -> Mnemonic:
    fields: Fields = {"low": 1, "high": 4, "unit": "type", "note": _HOMING, "starts": True}
    fields["syntax"] = f"{name} <type>"
    merged: Fields = {**fields, **more}
    return Mnemonic(name, title, meaning, section, **merged)


MOVES: tuple[Mnemonic, ...] = (
    number("A", "Acceleration", "how fast the velocity rises; counts when EE=1", "5.1.1", low=66, high=1100000000,
        unit="steps/s²", default=1000000, low_encoder=6, high_encoder=44000000, unit_encoder="counts/s²",
        default_encoder=78125, syntax="A=<rate>, PR A"),
    mode("AJ", "Acceleration jerk", "linear samples on either side of an S-curve's middle, speeding up", "5.1.3",
        low=0, high=127, default=0, step=0, syntax="AJ=<number>, PR AJ", note="firmware 6; acts with AT=2 or 3"),
    mode("AT", "Acceleration type", "1 linear, 2 triangle S-curve, 3 sinusoidal S-curve", "5.1.7", low=1, high=3,
        default=1, syntax="AT=<type>, PR AT", note="firmware 6"),
    flag("BE", "Backlash enable", "1 makes up for play in the gear, as BL and BM say", "5.1.10", 0,
        note="firmware 6"),
    number("BL", "Backlash amount", "play to make up for; its sign is the loaded direction in BM=1", "5.1.11",
        low=INT_LOW, high=INT_HIGH, unit="steps", unit_encoder="counts", default=0, note="firmware 6"),
    mode("BM", "Backlash mode", "0 adds BL at each reversal, 1 always loads from BL's side", "5.1.12", low=0, high=1,
        default=0, note="firmware 6"),
    number("C1", "Counter 1", "motor steps put out; rolls over at either end", "5.1.16", low=INT_LOW, high=INT_HIGH,
        unit="steps", default=0),
    number("C2", "Counter 2", "encoder counts seen; rolls over at either end", "5.1.17", low=INT_LOW, high=INT_HIGH,
        unit="counts", default=0, products=ENCODER, note="needs an encoder"),
    number("D", "Deceleration", "how fast the velocity falls; counts when EE=1", "5.1.27", low=66, high=1100000000,
        unit="steps/s²", default=1000000, low_encoder=6, high_encoder=44000000, unit_encoder="counts/s²",
        default_encoder=78125, syntax="D=<rate>, PR D"),
    mode("DJ", "Deceleration jerk", "linear samples on either side of an S-curve's middle, slowing down", "5.1.32",
        low=0, high=127, default=0, step=0, syntax="DJ=<number>, PR DJ", note="firmware 6; acts with DT=2 or 3"),
    mode("DT", "Deceleration type", "1 linear, 2 triangle S-curve, 3 sinusoidal S-curve", "5.1.34", low=1, high=3,
        default=1, syntax="DT=<type>, PR DT", note="firmware 6"),
    flag("DE", "Drive enable", "0 switches the output bridges off; a move is then error 94", "5.1.30", 1,
        starts=True),
    number("HC", "Hold current", "current at standstill; 0 holds with none", "5.1.51", low=0, high=100, unit="%",
        default=5, syntax="HC=<percent>, PR HC"),
    _home("HM", "Home to the switch", "seek the home switch, then creep off it", "5.1.54"),
    number("HT", "Hold current delay", "from the end of MT until the current falls to HC", "5.1.55", low=0,
        high=65535, unit="ms", default=500, note="HT and MT together at most 65535"),
    flag("JE", "Jog enable", "1 lets inputs of the jog types move the motor", "5.1.69", 0, starts=True),
    mode("LM", "Limit mode", "at a limit: 1-3 with ramp, 4-6 without; 2, 5 homing too; 3, 6 the program too",
        "5.1.76", low=1, high=6, default=1),
    mode("LS", "Software limits", "positions that act like limit switches", "5.1.78", low=INT_LOW, high=INT_HIGH,
        unit="steps", unit_encoder="counts", lines=True, syntax="LS=<0/1>,<position>,<0/1>, PR LS",
        note="firmware 6; first 0 minus, 1 plus; last 1 enables"),
    _move("MA", "Move absolute", "move to an absolute position; counts when EE=1", "5.1.80"),
    Mnemonic("MD", "Motion mode", "the last kind of move: MA, MR or SL", "5.1.81", "PR MD", access="RO",
        kind="variable", note="NE repeats it"),
    status("MP", "Moving to a position", "1 during MA and MR, and through MT and HT after them", "5.1.83"),
    _move("MR", "Move relative", "move by a distance from here; counts when EE=1", "5.1.84"),
    mode("MS", "Microstep resolution", "microsteps in a full step; A, D, VI and VM are scaled with it", "5.1.85",
        low=1, high=256, unit="steps/full step", default=256, values=MS_VALUES, syntax="MS=<resolution>, PR MS",
        note="10 or more with hMT; on an LMD EE=1 makes it 256 and locks it"),
    number("MT", "Motor settling delay", "rest after a move before it counts as over", "5.1.86", low=0, high=65535,
        unit="ms", default=0, note="HT and MT together at most 65535; 50 or more with EE=1"),
    status("MV", "Moving", "1 while the axis moves, whatever moves it", "5.1.88"),
    flag("NE", "Numeric enable", "1 makes a bare number repeat the last kind of move", "5.1.89", 0),
    number("P", "Position", "position counter: C1, or C2 when EE=1; setting it moves nothing", "5.1.95", low=INT_LOW,
        high=INT_HIGH, unit="steps", unit_encoder="counts", default=0),
    number("PC", "Captured position", "position at the last trip that was not one on position", "5.1.96", access="RO",
        step=READ_ONLY, low=INT_LOW, high=INT_HIGH, unit="steps", unit_encoder="counts", syntax="PR PC"),
    number("RC", "Run current", "current while moving", "5.1.109", low=1, high=100, unit="%", default=25,
        syntax="RC=<percent>, PR RC"),
    mode("RD", "Reverse direction", "1 swaps plus and minus; not while moving (error 95)", "5.1.110", low=0, high=1,
        default=0, syntax="RD=<0/1>, PR RD"),
    mode("SA", "Step angle", "full step of the motor", "5.1.114", low=0.45, high=5, unit="degrees", default=1.8,
        values=SA_VALUES, syntax="SA=<angle>, PR SA", products=MODULE, note="Motion Module only"),
    Mnemonic("SL", "Slew", "turn at this velocity until the next command; 0 stops", "5.1.117", "SL <velocity>",
        low=-5000000, high=5000000, unit="steps/s", low_encoder=-200000, high_encoder=200000, unit_encoder="counts/s",
        starts=True, note="does not heed VM; above MS*10000 it is error 77"),
    number("V", "Velocity", "velocity now, signed; 0 in torque mode", "5.1.135", access="RO", step=READ_ONLY,
        low=-5000000, high=5000000, unit="steps/s", low_encoder=-200000, high_encoder=200000, unit_encoder="counts/s",
        syntax="PR V, BR <label/address>,V=<value>"),
    status("VC", "Velocity changing", "1 while speeding up or slowing down", "5.1.137"),
    number("VI", "Initial velocity", "velocity that moves start and end with, and homing creeps at", "5.1.139", low=1,
        high=TOP_SPEED - 1, unit="steps/s", default=1000, high_encoder=199999, unit_encoder="counts/s",
        default_encoder=78, syntax="VI=<velocity>, PR VI", note="less than VM"),
    number("VM", "Maximum velocity", "velocity that moves go up to", "5.1.140", low=2, high=TOP_SPEED, unit="steps/s",
        default=768000, high_encoder=200000, unit_encoder="counts/s", default_encoder=60000,
        syntax="VM=<velocity>, PR VM", note="more than VI, at most MS*10000; acts from the next move on"),
)  # fmt: skip

ENCODERS: tuple[Mnemonic, ...] = (
    number("DB", "Encoder deadband", "how far from the target a move may end; needs EE=1", "5.1.28", low=0,
        high=65000, unit="counts", default=1, products=ENCODER),
    flag("EE", "Encoder enable", "1 puts positions and velocities in encoder counts", "5.1.36", 0, products=ENCODER,
        starts=True, note="needs an encoder; not with hMT"),
    mode("EL", "Encoder lines", "lines of the encoder; one line is four counts", "5.1.38", low=1, high=2000,
        unit="lines", default=1000, syntax="EL=<lines>, PR EL", products=MODULE, note="Motion Module only"),
    mode("FS", "Index offset", "distance of the shaft flat from the index mark, for HF", "5.1.48", low=-25600,
        high=25600, unit="counts", default=0, syntax="FS=<counts>, PR FS", products=ENCODER,
        note="firmware 6; FD keeps it"),
    _home("HF", "Home to the index offset", "seek the place FS from the index mark, then creep off it", "5.1.52",
        products=ENCODER, note=f"firmware 6; {_HOMING}"),
    _home("HI", "Home to the index mark", "seek the encoder's index mark, then creep off it", "5.1.53",
        products=ENCODER),
    flag("PM", "Position maintenance", "1 goes back when pushed further than DB; needs EE=1", "5.1.100", 0,
        products=ENCODER, starts=True),
    number("SF", "Stall factor", "how far the encoder may lag before it is a stall", "5.1.116", low=0, high=65000,
        unit="counts", default=15, products=ENCODER),
    mode("SM", "Stall mode", "on a stall: 0 stops, 1 tries on", "5.1.118", low=0, high=1, default=0,
        syntax="SM=<0/1>, PR SM", products=ENCODER),
    status("ST", "Stall flag", "1 after a stall, until ST=0", "5.1.120", access="RC", default=0, step=NOT_STEPPABLE,
        syntax="ST=0, PR ST", products=ENCODER, note="reading ER does not clear it"),
)  # fmt: skip

HMT: tuple[Mnemonic, ...] = (
    status("AF", "hMT status", "1 lead, 2 lag, 4 limit, 8 locked, 16 hybrid, 32 fault, 64 zero, 128 ready", "5.1.2",
        kind="variable", high=511, products=CLOSED_LOOP, syntax="PR AF, BR <label/address>,AF=<value>",
        note="the sum of what holds; 256 is a failed initialization"),
    mode("AS", "hMT mode", "0 off, 1 fixed current, 2 variable current, 3 torque", "5.1.6", low=0, high=3, default=0,
        products=CLOSED_LOOP, starts=True, note="3 starts to turn AT ONCE at TS; not while moving (87)"),
    number("AV", "Actual hMT velocity", "velocity of the rotor, smoothed by VF; needs hMT", "5.1.8", access="RO",
        step=READ_ONLY, low=INT_LOW, high=INT_HIGH, unit="steps/s", products=CLOSED_LOOP,
        syntax="PR AV, BR <label/address>,AV><value>", note="firmware 6"),
    mode("CB", "Control bounds", "rotor's leeway: 0 1.1, 1 1.3, 2 1.5, 3 1.7 full steps", "5.1.18", low=0, high=3,
        default=1, products=CLOSED_LOOP, note="0 for torque, 3 for speed; fixed at 0 with AS=3"),
    Mnemonic("CF", "Clear locked rotor", "end a locked-rotor fault and switch the bridges on again", "5.1.20", "CF",
        products=CLOSED_LOOP, starts=True),
    number("LD", "Lead limit", "how far the rotor may lead before error 106", "5.1.72", low=0, high=INT_HIGH,
        unit="steps", default=102400, products=CLOSED_LOOP),
    number("LG", "Lag limit", "how far the rotor may lag before error 107", "5.1.73", low=0, high=INT_HIGH,
        unit="steps", default=102400, products=CLOSED_LOOP),
    number("LL", "Lead or lag", "how far the rotor lags (plus) or leads (minus)", "5.1.74", access="RO",
        step=READ_ONLY, low=INT_LOW, high=INT_HIGH, unit="steps", products=CLOSED_LOOP,
        syntax="PR LL, BR <label/address>,LL><steps>"),
    status("LR", "Locked rotor", "1 after the rotor stood at its full lag for LT; CF clears it", "5.1.77", default=0,
        products=CLOSED_LOOP),
    number("LT", "Locked rotor timeout", "how long a rotor may stay still before it counts as locked", "5.1.79",
        low=2, high=65535, unit="ms", default=2000, products=CLOSED_LOOP),
    number("MF", "Make-up frequency", "velocity at which lost steps are made up when MU=1", "5.1.82", low=92,
        high=TOP_SPEED, unit="steps/s", default=768000, products=CLOSED_LOOP, syntax="MF=<velocity>, PR MF",
        note="at most VM; outside its range it is error 76"),
    mode("MU", "Make-up mode", "lost steps: 0 whenever there is time, 1 at MF, 2 at system speed", "5.1.87", low=0,
        high=2, default=0, syntax="MU=<mode>[,1], PR MU", products=CLOSED_LOOP, starts=True,
        note="a second parameter of 1 clears lead and lag"),
    mode("TD", "Torque direction", "torque mode turns 0 minus, 1 plus", "5.1.124", low=0, high=1, default=1,
        syntax="TD=<0/1>, PR TD", products=CLOSED_LOOP, starts=True),
    number("TQ", "Torque", "greatest torque in torque mode", "5.1.129", low=1, high=100, unit="%", default=25,
        syntax="TQ=<percent>, PR TQ", products=CLOSED_LOOP, starts=True),
    number("TS", "Torque speed", "velocity in torque mode (AS=3)", "5.1.131", low=46512, high=TOP_SPEED,
        unit="steps/s", default=0, syntax="TS=<velocity>, PR TS", products=CLOSED_LOOP, starts=True,
        note="0 until it is set"),
    number("VF", "Velocity filter", "smoothing of AV: 0 none, 1000 most", "5.1.138", low=0, high=1000, unit="counts",
        default=0, products=CLOSED_LOOP),
)  # fmt: skip

MOTION: tuple[Mnemonic, ...] = MOVES + ENCODERS + HMT


# Inputs, outputs and trips (MCode reference 3.4, section 5).


_FILTER = "0 50 ns, 1 150, 2 200, 3 300, 4 500, 5 900, 6 1.7 µs, 7 3.3, 8 6.5, 9 12.9"


def _trip(name: str, title: str, meaning: str, section: str, form: str, **more: Unpack[Fields]) -> Mnemonic:
    """A trip: when it runs which subroutine. TE arms it."""
    fields: Fields = {"access": "RW", "kind": "variable", "step": 26, "syntax": form, "starts": True}
    merged: Fields = {**fields, **more}
    return Mnemonic(name, title, meaning, section, **merged)


INPUTS: tuple[Mnemonic, ...] = (
    *(
        number(
            f"D{n}", f"Filter of input {n}", "how long a new level must last; 0: no filter", "5.1.25",
            low=0, high=255, unit="ms", default=0,
        )
        for n in range(1, 5)
    ),
    number("D5", "Filter of the analog input", "running average over this many readings", "5.1.26", low=0, high=1000,
        unit="counts", default=0),
    mode("FC", "Filter of the capture input", "shortest pulse that counts on a capture input", "5.1.44", low=0,
        high=9, default=0, note=f"modes: {_FILTER}; not on NEMA 17"),
    mode("FM", "Filter of the clock inputs", "shortest pulse that counts on inputs 3 and 4", "5.1.47", low=0, high=9,
        default=0, note=f"modes: {_FILTER}"),
    mode("FL", "Following", "1 follows the clock on inputs 3 and 4, one to one", "5.1.46", kind="flag", low=0, high=1,
        default=0, syntax="FL=<0/1>, PR FL", starts=True,
        note="firmware 6; inputs 3 and 4 must be of types 13 to 15"),
    *((status(
        f"I{n}", f"Input {n}", "1 while the input is active, filtered, as IS sets it", "5.1.56",
        kind="variable",
    )) for n in range(1, 5)),
    number("I5", "Analog input", "reading of the 12-bit analog input", "5.1.57", access="RO", step=READ_ONLY, low=0,
        high=4095, unit="counts", syntax="PR I5, BR <label/address>,I5><value>"),
    status("I6", "Encoder index", "1 while the encoder is at its index mark", "5.1.58", kind="variable",
        products=ENCODER, note="needs an encoder"),
    *(
        Mnemonic(
            f"I{n}", "Reserved", "reserved for the maker; no name for a variable or a label (error 24)",
            "5.1.59",
            "", kind="reserved", immediate=False, program=False,
        )
        for n in range(7, 14)
    ),
    number("IN", "Inputs as a group", "levels of all inputs, input 1 the lowest bit; not filtered", "5.1.62",
        access="RO", step=READ_ONLY, low=0, high=15, syntax="PR IN, BR <label/address>,IN=<0-15>"),
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
    number("AO", "Attention output mask", "sum of the events that light the attention output and LED 2", "5.1.5",
        low=0, high=4294967295, default=0, syntax="AO=<mask>, PR AO", step=NOT_STEPPABLE,
        note="1 error, 4 lead, 8 lag, 512 hold current, 16384 moving, 32768 stall"),
    number("CW", "Clock width", "length of a trip output's pulse", "5.1.24", low=0, high=255, unit="50 ns",
        default=10, syntax="CW=<time>, PR CW"),
    *(
        mode(
            f"O{n}", f"Output {n}", "1 makes the output active, 0 inactive, in either sense", "5.1.90",
            access="WO", low=0, high=1, syntax=f"O{n}=<0/1>",
            note="for an output of type 16" + ("; not on NEMA 17" if n < 3 else ""),
        )
        for n in range(1, 4)
    ),
    number("OF", "Output fault", "overcurrent: 0 none, 1 output 1, 2 output 2, 3 both", "5.1.92", access="RO",
        step=READ_ONLY, low=0, high=3, default=0, syntax="PR OF, BR <label/address>,OF=<status>",
        products=LEXIUM - {"LMM"}),
    mode(
        "OS", "Output setup", "type and active level of an output", "5.1.93",
        syntax="OS=<1-3>,<type>[,<active>], PR OS", lines=True,
        note="types: 16 user, 17 moving, 18 error, 19 stall, 20 velocity changing, "
        "21 locked rotor, 23 moving to a position, 24 hMT active, 25 make-up, "
        "26, 27 encoder A, B (1, 2), 28 trip (3), 29 attention",
    ),
    mode("OT", "Outputs as a group", "sets all outputs at once, output 1 the lowest bit", "5.1.94", access="WO",
        low=0, high=7, syntax="OT=<0-7>"),
)  # fmt: skip

TRIPS: tuple[Mnemonic, ...] = (
    _trip("TA", "Trip on hMT status", "run a subroutine on calibration, hMT, locked rotor, lag or lead", "5.1.122",
        "TA=<mask>,<label/address>, PR TA", low=0, high=31, default=0, products=CLOSED_LOOP,
        note="1 calibrated, 2 active, 4 locked, 8 lag, 16 lead; TE=32 arms it"),
    _trip("TC", "Trip on capture", "run a subroutine when input 1, of type capture, turns active", "5.1.123",
        "TC=<label/address>, PR TC", note="TE=4 arms it"),
    number("TE", "Trip enable", "armed trips: 1 TI, 2 TP, 4 TC, 8 TT, 16 TR, 32 TA, 64 TM", "5.1.125", low=0,
        high=127, default=0, step=NOT_STEPPABLE, syntax="TE=<sum>, PR TE", starts=True,
        note="a trip that is not set up is error 27"),
    _trip("TI", "Trip on input", "run a subroutine when an input turns active", "5.1.126",
        "TI=<input>,<label/address>, PR TI", low=1, high=4, unit="input", note="TE=1 arms it, and is cleared"),
    _trip("TM", "Trip on main power loss", "run a subroutine when +V fails and auxiliary power stays", "5.1.127",
        "TM=<label/address>, PR TM", note="TE=64 arms it"),
    _trip("TP", "Trip on position", "run a subroutine when a position is reached", "5.1.128",
        "TP=<position>,<label/address>, PR TP", low=INT_LOW, high=INT_HIGH, unit="steps", unit_encoder="counts",
        note="TE=2 arms it, and is cleared; not together with TR (error 39)"),
    _trip("TR", "Trip on relative position", "run a subroutine, or pulse the output, every so far", "5.1.130",
        "TR=<distance>,<label/address>[,<repeats>], PR TR", low=INT_LOW, high=INT_HIGH, unit="steps",
        unit_encoder="counts", note="TE=16 arms it; repeats 0 is for ever, else up to 65000; label 0: output only"),
    _trip("TT", "Trip on time", "run a subroutine once, after a time", "5.1.132", "TT=<time>,<label/address>, PR TT",
        low=1, high=65535, unit="ms", note="TE=8 arms it"),
)  # fmt: skip

IO: tuple[Mnemonic, ...] = INPUTS + OUTPUTS + TRIPS
