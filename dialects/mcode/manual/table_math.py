"""Operators and registers: arithmetic, comparison, logic and trigonometry (MCode reference 4.2, 5.2)."""

from __future__ import annotations

from multidrop.dialects.mcode.manual.mnemonic import FLOAT_HIGH, INT_HIGH, INT_LOW, Mnemonic, flag, mode, number


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
    mode(
        "PF", "Print format", "width, decimals, notation and justification of printed F registers", "5.1.97",
        default="10,6,0,0", syntax="PF=<width>,<decimals>,<0/1>,<0/1>, PR PF",
        note="firmware 6; width 0 to 16; third 1 is scientific, fourth 1 is left-justified",
    ),
    flag(
        "RA", "Radians or degrees", "unit of angles for trigonometry: 1 radians, 0 degrees", "5.1.108", 1,
        note="firmware 6",
    ),
    _operator("+", "Add", "sum of the two sides", "5.2.1", "R1=R2+R3"),
    _operator("-", "Subtract", "left side less the right one", "5.2.2", "R1=R2-R3"),
    _operator("*", "Multiply", "product of the two sides", "5.2.3", "R1=R2*R3"),
    _operator("/", "Divide", "left side by the right one; whole numbers lose the fraction", "5.2.4",
    "R1=R2/R3"),
    _operator("=", "Equal", "assigns; in a condition: both sides are the same", "5.2.5", "BR <label>,R1=R2"),
    _operator("<>", "Not equal", "in a condition: the sides differ", "5.2.6", "BR <label>,R1<>R2"),
    _operator("<", "Less than", "in a condition: left is below right", "5.2.7", "BR <label>,R1<R2"),
    _operator("<=", "Less or equal", "in a condition: left is not above right", "5.2.8", "BR <label>,R1<=R2"),
    _operator(">", "Greater than", "in a condition: left is above right", "5.2.9", "BR <label>,R1>R2"),
    _operator(">=", "Greater or equal", "in a condition: left is not below right", "5.2.10",
    "BR <label>,R1>=R2"),
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
