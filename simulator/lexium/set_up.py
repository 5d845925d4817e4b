"""What a cell file puts into a simulated drive: its identity, variables, program and settings, and its counters.

Lines are carried out as if they were sent.
"""

from __future__ import annotations

from collections.abc import Callable

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import split_lines
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.lexium.state.memory import Memory

WORDS = {"position": "P"}
"""Words by the key of a counter in `identity`; the other keys are words."""
PASSES = 3
"""Times that `set` is carried out: until nothing is refused any more, and what that has scaled is set again."""
Execute = Callable[[str], str]
"""Carries out a line; returns the reason for a refusal, empty for none."""


def memory_of(spec: DriveSpec) -> Memory:
    """Make the working memory of a drive with this identity."""
    memory, own = Memory(spec.personality), spec.identity
    memory.model = memory.model._replace(
        part=own.part or memory.model.part, version=own.version or memory.model.version
    )
    return memory


def serial_of(spec: DriveSpec) -> str:
    """The serial number; one made from the name where the cell gives none."""
    return spec.identity.serial or f"0401{ord(spec.name[:1] or '!'):05d}"


def load(spec: DriveSpec, execute: Execute) -> None:
    """Declare the variables, and store the program. Raises Diagnostic."""
    for name, value in spec.variables.items():
        _accepted(f"VA {name}={value}", f"drive {spec.name}: variables", execute)
    for number, line in enumerate(split_lines(spec.program), 1):
        _accepted(line, f"{spec.program_name or 'program'}:{number}", execute)


def assign(spec: DriveSpec, execute: Execute) -> None:
    """Carry out `set`. One line may need another first, and MS and EE change speeds. Raises Diagnostic.

    A line that was accepted once may be refused later and be in force all the same: MF, when VM is below it.

    AS comes last, as the motor may turn from there on; EE just before it, so that speeds in steps stay in steps.
    """
    lines = [*spec.assignments(), *([("PY", "1")] if spec.party else [])]
    last = ("EE", "AS") if spec.set.get("AS") else ("AS",)
    late = [each for name in last for each in lines if each[0] == name]
    early = [each for each in lines if each not in late]
    refused = early
    for _ in range(PASSES):
        again = [each for each in early if execute("=".join(each))]
        refused = [each for each in refused if each in again]
    for each in (*late, *refused):
        _accepted("=".join(each), f"drive {spec.name}: set", execute)


def begin_counters(spec: DriveSpec, execute: Execute) -> None:
    """Let the counters begin where a snapshot found them: P first, then what P does not say. Raises Diagnostic."""
    counters = {WORDS.get(key, key): value for key, (value,) in spec.identity.counters.items()}
    for word in sorted(counters, key=lambda word: word != "P"):
        _accepted(f"{word}={counters[word]}", f"drive {spec.name}: identity", execute)


def _accepted(line: str, where: str, execute: Execute) -> None:
    if why := execute(line):
        raise Diagnostic(f"{line.strip()}: {why}", where)
