"""The groups of words that code asks for: queries of the table, each named by what its words have in common.

A word is in a group because its row says so, in the table of a Lexium or of an MDrivePlus. Groups of which one product
lacks some words serve every product: a drive that lacks a word refuses it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from multidrop.families.lexium.manual.mnemonic import (
    AllowedUse,
    Alone,
    AtZero,
    FormKind,
    Leads,
    MemoryEffect,
    Mnemonic,
    MotionEffect,
    MotionWait,
    NameEffect,
    PositionEffect,
    PrintedValue,
    Retention,
    WireSetting,
)
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS

ROWS = (*MNEMONICS.values(), *(row for name, row in MDRIVE.items() if name not in MNEMONICS))
"""A row for each word of any product: the Lexium's, if a Lexium has the word."""


def those(fact: Callable[[Mnemonic], bool]) -> frozenset[str]:
    """The words for which a fact holds in the table of any product."""
    return frozenset(row.name for table in (MNEMONICS, MDRIVE) for row in table.values() if fact(row))


# The language

FUNCTIONS = those(lambda row: row.kind == "math" and row.syntax == f"F1={row.name} F2")
"""Words that precede their operand (5.2.15 to 5.2.25)."""
JOINED = those(lambda row: row.joined)
"""Instructions whose first argument may be a name, so that the name may follow without a space."""
CONDITIONAL = those(lambda row: row.leads in (Leads.BRANCH, Leads.CALL))
"""The words whose second argument is a condition."""
DECLARING = those(lambda row: row.variable is NameEffect.DECLARE)
LABELLING = those(lambda row: row.variable is NameEffect.DECLARE and row.use is AllowedUse.STORED)
STEPPING = those(lambda row: row.variable is NameEffect.STEP)
"""Instructions that add or subtract 1."""
CHANGING = those(lambda row: row.variable in (NameEffect.STEP, NameEffect.INPUT))
"""Instructions that write the variable after them."""
PLACES: Mapping[str, int] = {
    row.name: row.place for row in ROWS if row.leads in (Leads.BRANCH, Leads.CALL, Leads.ROUTINE)
}
"""Words that go to a place or name one that is gone to, and the position of that place among their arguments."""
EVERY_PLACE: Mapping[str, int] = {row.name: row.place for row in ROWS if row.place >= 0}
"""All words with a place, and its position among their arguments."""
LAST_LINES = those(lambda row: row.leads in (Leads.BRANCH, Leads.RETURN, Leads.END))
"""The words that a program ends with."""

# What PR prints

PRINTS_LINES = those(lambda row: row.lines)
"""The words whose PR prints several lines without an end of their own."""
OPTIONED = those(lambda row: row.prints is PrintedValue.OPTION)
"""Words that take a number as an option."""
SEVERAL = those(lambda row: row.prints in (PrintedValue.OPTION, PrintedValue.SEVERAL, PrintedValue.LINES))
"""Words that print several values."""
SIGNS_OF_FAILURE = those(lambda row: row.sign)
"""Words whose value is the sign of a failure: a line that sets one clears it, and printing one may (5.1.40)."""
READ_BACK: Mapping[str, int] = {row.name: row.read_back for row in ROWS if row.read_back is not None}
"""Words that print the number that was written, until something writes another one; and how much a drive rounds it."""

# Settings

STATES = those(lambda row: row.kept is Retention.STATE)
"""Counters, readings, armed trips and flags, which S does not keep."""
UNIT = those(lambda row: row.kept is Retention.UNIT)
"""Settings of the motor unit itself, which FD keeps (5.1.45)."""
WIRE = those(lambda row: row.wire is not WireSetting.NO)
"""Communication settings."""
FORM_OF_LINES = those(lambda row: row.wire is WireSetting.FORM)
"""Communication settings that the host must know to talk with a drive at all."""
BANKED = those(lambda row: row.default_encoder is not None)
"""Settings with one value for steps and another for encoder counts (7.3.7)."""
COUNTED = BANKED | {"MS"}
"""The same, with the resolution: it is locked while the unit of motion is the encoder count (7.3.7)."""
LISTS: Mapping[str, tuple[int, ...]] = {
    row.name: row.setup.numbers
    for row in sorted(ROWS, key=lambda row: -len(row.setup.numbers))
    if row.setup.form is FormKind.LIST
}
"""The words whose PR prints a line for each number, and those numbers; the longest list first."""
FIELDS: Mapping[str, int] = {row.name: row.setup.numbers[0] for row in ROWS if row.setup.form is FormKind.FIELDS}
"""Set-ups of several numbers, and how many."""
SETUPS = those(lambda row: row.setup.form not in (FormKind.NONE, FormKind.NUMBER) and row.kept is not Retention.STATE)
"""Settings that are not just a number in a range: a drive may refuse one when it executes it."""
TRIPS: Mapping[str, int] = {row.name: row.trip for row in sorted(ROWS, key=lambda row: row.trip) if row.trip}
"""The trips, each with the number by which TE enables it."""
TRIPS_WITH_VALUE = frozenset(word for word in TRIPS if PLACES[word] > 0)
"""Trips whose set-up begins with a number; others have only a target."""
REMOVABLE = those(lambda row: row.setup.removable)
"""Trips that 0 removes."""
RESTORED_LAST = tuple(row.name for row in sorted(ROWS, key=lambda row: row.restored or 0) if row.restored)
"""Settings that are restored after all others, in this order.

First those that can turn the motor, and those that DE or hMT restrict. Then communication.
"""

# Memory

SLOW = those(lambda row: row.memory is not MemoryEffect.NOTHING)
"""Words that write to flash memory; the drive replies late (5.1.113)."""
RESTORING = those(lambda row: row.memory in (MemoryEffect.RESTORES, MemoryEffect.RESETS))
"""Words that change all settings at once."""
GUARDED: Mapping[str, Mnemonic] = {row.name: row for row in ROWS if row.guard}
"""Words whose lines a person must agree to."""

# Positions

SCALES = tuple(row.name for row in sorted(ROWS, key=lambda row: row.turn) if row.position is PositionEffect.SCALES)
"""Settings that give a count its length and its sign, in the order in which they are asked for."""
RECOUNTING = those(lambda row: row.position is not PositionEffect.NOTHING)
"""Words that change what positions count: a counter, the length of a count, or its sign."""

# Motion

MOVES = those(lambda row: row.motion is MotionEffect.MOVE)
"""Instructions that move to a target."""
HOMINGS = those(lambda row: row.motion is MotionEffect.HOMING)
MOTIONS = those(lambda row: row.motion in (MotionEffect.MOVE, MotionEffect.SLEW, MotionEffect.HOMING))
"""Instructions that start one motion. After it nothing moves by itself."""
TURNING = those(
    lambda row: (
        row.motion
        in (MotionEffect.MOVE, MotionEffect.SLEW, MotionEffect.HOMING, MotionEffect.TEST, MotionEffect.RELEASE)
    )
)
"""Instructions with which the motor may turn, other than by a program."""
PROGRAMS = those(lambda row: row.motion is MotionEffect.PROGRAM)
"""Instructions that run a program, or go on in one."""
WITHOUT_TARGET: Mapping[str, int] = {row.name: row.turns_at for row in ROWS if row.turns_at is not None}
"""Words that start, or let inputs start, motion without a target, and the value with which they do."""
FREE = those(lambda row: row.alone not in (Alone.NOTHING, Alone.CORRECTION))
"""What lets a drive move without a line of ours: armed trips, jog inputs, a clock that it follows."""
ENDING_AT_0 = those(lambda row: row.at_zero is AtZero.MOTION)
"""Words whose 0 ends motion and leaves the torque on."""
STOPPING_AT_0 = those(lambda row: row.at_zero in (AtZero.MOTION, AtZero.TORQUE))
"""Words whose 0 ends motion or torque."""
CALM_AT_0 = those(lambda row: row.at_zero in (AtZero.MOTION, AtZero.TRIPS))
"""Words whose 0 starts nothing: no load falls, either."""
NEEDING_REST = those(lambda row: row.rest)
"""Words that a moving drive refuses, or that change what the motion counts."""
WATCHING = those(lambda row: row.waiting is MotionWait.WATCHES)
"""Words by which a program watches the motion."""
HOLDING = those(lambda row: row.waiting is MotionWait.HOLDS)
"""Instructions that wait, or end the motion or the program."""
