"""Dialogues with MCode drives: each call of the family with its requests, byte for byte, and what comes of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from multidrop.dialects import Hints, Kind, Owed, Priority
from multidrop.dialects.codec import Started
from multidrop.dialects.exchange import Looking
from multidrop.dialects.motions import Ending, Evidence, Move, MoveKind, Outcome
from multidrop.dialects.program_files import Held, Stored
from multidrop.dialects.scanning import Reach
from multidrop.dialects.state import Remembered
from multidrop.dialects.values import ORDINARY, Change, Permission, Plan, Readings
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host import motions as lexium_motions
from multidrop.families.lexium.host import values as lexium_values
from multidrop.families.lexium.host.mcode import (
    before_request,
    codec,
    debugging,
    download,
    exchange,
    family,
    framing,
    identify,
    identity,
    motions,
    operations,
    program_readout,
    programs,
    quiet,
    reply_parser,
    scan,
    settings,
    units,
    values,
)
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.debugging import MCodeDebugging
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.motions import MCodeMotions
from multidrop.families.lexium.host.mcode.state import MCodeState, ReplyPlace, Unconfirmed
from multidrop.families.lexium.host.mcode.units import MCodeUnits
from multidrop.families.lexium.host.mcode.values import MCodeParameters, MCodeValues
from multidrop.families.lexium.manual import program_file
from tests.support.dialogues import dialogue_tests

USED = (
    lexium_motions, lexium_values, MCodeDebugging,
    replace, Hints, Kind, Owed, Priority, Started, Looking, family, MCodeFamily, before_request, classify, codec,
    debugging, download, exchange, framing, identify, identity, motions, operations, program_readout, programs, quiet,
    reply_parser, scan, settings, units, values, MCodeMotions, ReplyPlace, Unconfirmed, MCodeUnits, MCodeParameters,
    MCodeValues, Ending, Evidence, Move, MoveKind, Outcome, Held, Stored, Reach, Remembered, ORDINARY, Change,
    Permission, Plan, Readings,
)  # fmt: skip
"""The names that calls in the files use."""


def drive(em=0, ck=0, name="", product="LMDCM", **known):
    """A drive in a mode; with a name it is in party mode."""
    return MCodeState(MCode(em, bool(name), ck, known.pop("es", 1)), name, name, product, **known)


def type_(state, text):
    return MCodeFamily(state).perform(text)


def asked(text, em=0, ck=0, name="", **more):
    """The request of a line."""
    return replace(MCode(em, bool(name), ck, 1).request(name, text), **more)


def signed(text, em=0, ck=0, name="", **known):
    """The request of a person's print, as the host signs it."""
    return exchange.signed(drive(em, ck, name, **known), asked(text, em, ck, name))


def decoded(request, heard):
    """How a reply is read: the bytes that it needs, then as much at once, after quiet, and when time is up."""
    own = request.codec
    at = next((size for size in range(len(heard) + 1) if own.decode(request, heard[:size]) is not None), None)
    first = own.decode(request, heard[:at]) if at is not None else None
    whole = own.decode(request, heard)
    quiet = own.on_quiet(request, heard)
    late = own.on_timeout(request, heard)
    found = [("decode", at, first)]
    found += [("whole", whole)] if whole != first else []
    found += [("quiet", own.quiet_time(request, heard), quiet)] if whole is None else []
    return [*found, ("timeout", late)] if whole is None and quiet is None else found


def source(text):
    """The lines of a program file."""
    return program_file.read(text, "a.mxt")


def progress(shown):
    """A progress that is kept."""
    return lambda done, total: shown.append((done, total))


def sent(state, text, held=None, shown=None):
    """A download; the lines that were sent, each with its number."""
    lines = yield from programs.MCodePrograms(state).download(
        source(text), held, progress([] if shown is None else shown)
    )
    return [(line.number, line.text) for line in lines]


def held(*lines, names=(), locked=False):
    """What a drive holds: `1  LB G1`, and what it prints for UV."""
    return Held(program_readout.stored(lines), tuple(names), locked)


def searched(found, **reach):
    """A search whose finds are kept; what it shows, and the number of its steps."""
    steps = list[None]()
    outcome = yield from scan.SCAN.search(Reach(**reach), found.append, lambda: steps.append(None))
    return outcome, len(steps)


def expected(place, last=None, stated=False, product="", **known):
    """A drive that is only expected at a place, by the user's word or from last time."""
    codec = MCode(party=place.party) if last is None else MCode(last.em, place.party, last.checksum)
    state = MCodeState(codec, place.address, place.address, product, **known)
    state.expected(Unconfirmed(place, last, stated))
    return state


globals().update(dialogue_tests(Path(__file__).parent, globals()))
