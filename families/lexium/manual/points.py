"""A drive's state in words and as lamps, and the lines that the product writes by itself: moves, controls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from multidrop.dialects.controls import Controls, Homing, by_mode, controls_of, homings_of
from multidrop.dialects.state import DriveState
from multidrop.dialects.values import UNREAD, Actions, Conditions, Facts, Lamp, Pace, number
from multidrop.families.lexium.manual.mnemonic import EXPANDED
from multidrop.families.lexium.manual.parameters import counting

INPUTS = (1, 2, 3, 4)
EXPANDED_INPUTS = (*INPUTS, 9, 10, 11, 12)
"""The inputs of IN, lowest bit first."""
SETTINGS = ("EE", "AS", "RC", "HC", "VI", "VM", "A", "D")
"""The settings that `conditions` takes, beside what changes by itself."""
STATUS = ("P", "V", "MV", "BY", "EF", "IN")
"""The words to read for a status, in the order of `in_words`."""


def in_words(
    position: int, velocity: int, moving: int, busy: int, error: int, inputs: int, *, points: Sequence[int] = INPUTS
) -> tuple[str, ...]:
    """Describe P, V, MV, BY, EF and IN, one line for each matter; `points` are the inputs of IN, lowest bit first."""
    return (
        f"moving: V={velocity}, P={position}" if moving or velocity else f"at rest: P={position}",
        "program: running" if busy else "program: none runs",
        "error: set (EF=1); PR ER shows and clears it" if error else "error: none",
        "inputs: " + ", ".join(f"{n} {'high' if inputs >> i & 1 else 'low'}" for i, n in enumerate(points)),
    )


# Inputs, outputs and flags of an MCode drive as lamps, and its conditions from what was read.
#
# An input's lamp follows IN and IS: IN has the raw levels, IS the level that counts as active. No serial drive prints
# its outputs. So the lamp of an output is known only where its type follows a flag that is read. (MCode reference
# 3.4.3, 5.1.2, 5.1.62, 5.1.64, 5.1.78, 5.1.93.)


FUNCTIONS: Mapping[int, str] = {
    0: "", 1: "home", 2: "lim+", 3: "lim-", 4: "go", 5: "stop", 6: "pause", 7: "jog+", 8: "jog-", 11: "reset",
    12: "capture", 13: "clock", 14: "clock", 15: "clock", 16: "", 17: "moving", 18: "error", 19: "stall", 20: "speed",
    21: "locked", 23: "in move", 24: "hMT", 25: "make-up", 26: "enc A", 27: "enc B", 28: "trip", 29: "attention",
}  # fmt: skip
"""One word for each type of input (0 to 15) and output (16 to 29)."""
FIRST_OUTPUT = 16
FOLLOWS: Mapping[int, str] = {17: "MV", 18: "EF", 20: "VC", 23: "MP"}
"""The flags that types of output show."""
LOCKED = 8
HMT: tuple[tuple[int, str], ...] = (
    (256, "failed to initialize"),
    (32, "fault"),
    (LOCKED, "locked rotor"),
    (2, "lags"),
    (1, "leads"),
    (4, "at its bounds"),
    (16, "active"),
)
"""The bits of AF, the most important for a person first."""
SET = "PR ER shows and clears it"
CAUSE = "cause"
"""Among the facts: what caused the error, as far as signs that came with it show that; empty: they do not."""
LIMITS = ("lim+", "lim-")
"""Functions of inputs that end a move, and set an error."""


def conditions(product: str, facts: Facts, target: int | None) -> Conditions:
    rows = [facts.get(name) for name in ("LS0", "LS1")]
    numbers = [int(number(row[0])) for row in rows if isinstance(row, tuple) and len(row) == 2 and row[1]]
    limits = (numbers[0], numbers[1]) if len(numbers) == 2 and numbers[0] < numbers[1] else None
    pace = [number(facts[name]) for name in ("VI", "VM", "A", "D") if name in facts]
    analog = (Lamp("ai", str(facts["I5"])),) if "I5" in facts else ()  # neither on nor off
    locked = facts.get("AS") and int(number(facts.get("AF", 0))) & LOCKED  # (MCode reference 5.1.20, 5.1.30)
    more: tuple[tuple[str, str], ...] = ()
    if "AF" in facts and facts.get("AS"):
        words = [word for bit, word in HMT if int(number(facts["AF"])) & bit]
        more = (("hMT", ", ".join(words) or "ready"),)
    cause = str(facts.get(CAUSE, "")) if facts.get("EF") else ""
    return Conditions(
        lamps=(*_inputs(product, facts), *analog, *_outputs(facts)),
        error=UNREAD if facts.get("EF") else 0,
        error_text="; ".join(filter(None, (cause, SET))) if facts.get("EF") else "",
        cause=cause,
        program="running" if facts.get("BY") else "",
        runs=bool(facts["BY"]) if "BY" in facts else None,
        target=target if facts.get("MV") else None,
        limits=limits,
        disabled="DE=0" if facts.get("DE") == 0 else "locked rotor; CF clears it" if locked else "",
        released="HC=0" if facts.get("HC") == 0 and not facts.get("AS") else "",
        run_current=_whole(facts, "RC"),
        hold_current=_whole(facts, "HC"),
        more=more,
        commanded=facts.get("EE") == 0 and not facts.get("AS"),
        unit="counts" if counting(facts) else "steps",
        pace=Pace(*pace) if len(pace) == 4 else None,
    )


def met(product: str, facts: Facts) -> tuple[str, ...]:
    """The limits whose inputs are active, `limit+`."""
    lamps = _inputs(product, facts)
    return tuple(lamp.function.replace("lim", "limit") for lamp in lamps if lamp.on and lamp.function in LIMITS)


def _whole(facts: Facts, name: str) -> int | None:
    return int(number(facts[name])) if name in facts else None


def _setup(facts: Facts, words: tuple[str, str]) -> tuple[int, int] | None:
    row = next((facts[word] for word in words if word in facts), None)
    return (int(number(row[0])), int(number(row[1]))) if isinstance(row, tuple) and len(row) > 1 else None


def _inputs(product: str, facts: Facts) -> Iterator[Lamp]:
    for bit, n in enumerate(EXPANDED_INPUTS if product in EXPANDED else INPUTS):
        setup = _setup(facts, (f"IS{n}", f"S{n}"))
        if setup is None or setup[0] >= FIRST_OUTPUT:
            continue
        kind, active = setup
        on: bool | None = None
        if f"I{n}" in facts:
            on = bool(facts[f"I{n}"])
        elif "IN" in facts:
            on = (int(number(facts["IN"])) >> bit & 1) == active
        yield Lamp(str(n), FUNCTIONS.get(kind, f"type {kind}"), on)


def _outputs(facts: Facts) -> Iterator[Lamp]:
    for n in (1, 2, 3, 4):
        setup = _setup(facts, (f"OS{n}", f"S{n}"))
        if setup is None or setup[0] < FIRST_OUTPUT:
            continue
        fact = f"O{n}" if f"O{n}" in facts else FOLLOWS.get(setup[0], "")
        on = bool(facts[fact]) if fact in facts else None
        yield Lamp(str(n), FUNCTIONS.get(setup[0], f"type {setup[0]}"), on, output=True)


# Lines that the product writes by itself. The drive has one axis.


def move(axis: str, steps: int | str) -> tuple[str, ...]:
    return (f"MR {steps}",)


def move_to(axis: str, position: int | str) -> tuple[str, ...]:
    return (f"MA {position}",)


def assign(word: str, value: str) -> str:
    return f"{word}={value}"


def controls(state: DriveState, axis: str) -> Controls:
    """The same over Modbus. (MCode reference 5.1.30, 5.1.54, 5.1.80, 5.1.84, 5.1.117.)"""
    return controls_of(__file__)


def homings(axis: str) -> Sequence[Homing]:
    """All types of HM and HI. (MCode reference 5.1.53, 5.1.54.)"""
    return homings_of(__file__)


class LexiumActions(Actions):
    """What a program asks of a Lexium drive."""

    error = "ER"
    no_error = ""

    def homings(self, axis: str) -> Mapping[str, Mapping[str, str]]:
        return by_mode(homings(axis))

    def run(self, axis: str, velocity: int | str) -> tuple[str, ...]:
        return (f"SL {velocity}",)

    def output(self, number: int, on: bool) -> str:
        return f"O{number}={on:d}"
