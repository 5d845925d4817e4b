"""Dialogues with modules: each call of the family with its requests, byte for byte, and what comes of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from multidrop.dialects import Hints, Kind, Owed, Priority
from multidrop.dialects.codec import Started
from multidrop.dialects.motions import Ending, Evidence, Move, MoveKind, Outcome
from multidrop.dialects.program_files import Held, Stored
from multidrop.dialects.scanning import Reach
from multidrop.dialects.values import ORDINARY, Change, Permission, Plan, Readings
from multidrop.families.tmcl.host import codec, family, motions, operations, programs, scan, units, values
from multidrop.families.tmcl.host.codec import Tmcl, TmclState
from multidrop.families.tmcl.host.family import TmclFamily
from multidrop.families.tmcl.host.motions import TmclMotions
from multidrop.families.tmcl.host.programs import TmclDebugging, TmclPrograms
from multidrop.families.tmcl.host.units import TmclUnits
from multidrop.families.tmcl.host.values import TmclActions, TmclParameters, TmclValues
from multidrop.families.tmcl.manual import commands, program_file
from multidrop.families.tmcl.manual.commands import Command, TmclCall
from multidrop.families.tmcl.manual.modules import module_of
from tests.support.dialogues import dialogue_tests

USED = (
    replace, Hints, Kind, Owed, Priority, Started, Ending, Evidence, Move, MoveKind, Outcome, Held, Stored,
    family, TmclFamily, codec, motions, operations, programs, units, values, TmclMotions, TmclDebugging,
    TmclPrograms, TmclUnits, TmclActions, TmclParameters, TmclValues, TmclCall, Command, module_of, ORDINARY, Change,
    Permission, Plan, Readings,
)  # fmt: skip
"""The names that calls in the files use."""


def module(product="TMCM-1241", motors=1, address="1", **known):
    return TmclState(Tmcl(), address, product=product, motors=motors, **known)


def type_(state, text):
    return TmclFamily(state).perform(text)


def asked(text, address="1", **more):
    """The request of a line."""
    return replace(Tmcl().request(address, text, commands.parse(text)), **more)


def decoded(text, heard, **more):
    """How a reply is read, then what silence makes of the same bytes."""
    request, data = asked(text, **more), bytes.fromhex(heard)
    return Tmcl().decode(request, data), Tmcl().on_timeout(request, data)


def unsolicited(heard):
    return Tmcl().parse_unsolicited(bytes.fromhex(heard))


def pieces(stop):
    """The frames of a stop, each with the quiet before it."""
    return [(piece.data.hex(), piece.quiet) for piece in stop]


def source(text):
    """The lines of a program file."""
    return program_file.read(text, "a.tmc")


def progress(shown):
    """A progress that is kept."""
    return lambda done, total: shown.append((done, total))


def download(state, text, shown=None, held=None):
    return TmclPrograms(state).download(source(text), held, progress([] if shown is None else shown))


def searched(found, **reach):
    """A search whose finds are kept; what it shows, and the number of its steps."""
    steps = list[None]()
    outcome = yield from scan.SCAN.search(Reach(**reach), found.append, lambda: steps.append(None))
    return outcome, len(steps)


globals().update(dialogue_tests(Path(__file__).parent, globals()))
