"""Dialogues with a controller: each call of the family with its requests, byte for byte, and what comes of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from multidrop.dialects import Hints, Kind, Priority
from multidrop.dialects.motions import Ending, Evidence, Move, MoveKind, Outcome
from multidrop.dialects.program_files import Held, Stored
from multidrop.dialects.scanning import Reach
from multidrop.dialects.values import ORDINARY, Change, Permission, Plan, Readings
from multidrop.families.pmx.host import codec, family, motions, operations, programs, scan, units, values
from multidrop.families.pmx.host.codec import Pmx, PmxState
from multidrop.families.pmx.host.family import PmxFamily
from multidrop.families.pmx.host.motions import PmxMotions
from multidrop.families.pmx.host.programs import PmxDebugging, PmxPrograms
from multidrop.families.pmx.host.units import PmxUnits
from multidrop.families.pmx.host.values import PmxActions, PmxParameters, PmxValues
from multidrop.families.pmx.manual import program_file
from tests.support.dialogues import dialogue_tests

USED = (
    replace, Hints, Kind, Priority, Ending, Evidence, Move, MoveKind, Outcome, family, PmxFamily, codec, motions,
    operations, programs, scan, units, values, PmxMotions, PmxDebugging, PmxUnits, PmxActions, PmxParameters, PmxValues,
    Held, Stored, Reach, ORDINARY, Change, Permission, Plan, Readings,
)  # fmt: skip
"""The names that calls in the files use."""


def unit(address="00", **known):
    return PmxState(Pmx(), address, product="PMX-2ED-SA", **known)


def alone():
    """A controller that takes no number."""
    return PmxState(Pmx(addressed=False))


def type_(state, text):
    return PmxFamily(state).perform(text)


def decoded(text, heard, **more):
    """How a reply is read, then what silence makes of the same bytes."""
    request = replace(Pmx().request("00", text), **more)
    return Pmx().decode(request, heard), Pmx().on_timeout(request, heard)


def source(text):
    """The lines of a program file."""
    return program_file.read(text, "a.prg")


def progress(shown):
    """A progress that is kept."""
    return lambda done, total: shown.append((done, total))


def download(state, text, shown=None, held=None):
    return PmxPrograms(state).download(source(text), held, progress([] if shown is None else shown))


def searched(found, **reach):
    """A search whose finds are kept; what it shows, and the number of its steps."""
    steps = list[None]()
    outcome = yield from scan.SCAN.search(Reach(**reach), found.append, lambda: steps.append(None))
    return outcome, len(steps)


globals().update(dialogue_tests(Path(__file__).parent, globals()))
