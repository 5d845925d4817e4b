"""What a simulated drive keeps without power, and how it begins with it: power-up, reset, factory defaults.

Manual 3.4.4, 5.1.45, 5.1.63, 5.1.113, 5.1.121. What a cell file gives a drive is carried out as the lines that would be
sent to it, then saved.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dialects import Diagnostic
from dialects.mcode.manual.errors import text
from dialects.mcode.manual.grammar import Name
from simulator.lexium.state.memory import KEPT_BY_FD, Memory, Store
from simulator.lexium.state.program_memory import Program

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

PROMPT = ">"
BAUDS = {48: 4800, 96: 9600, 19: 19200, 38: 38400, 11: 115200}


def save(device: MCodeDevice) -> None:
    """Put everything that is kept into NVM."""
    nvm = device.nvm
    device.memory.save(nvm)
    nvm.inputs, nvm.outputs = dict(device.inputs.types), dict(device.output_lines.types)
    nvm.limits = dict(device.limits)
    nvm.trips = dict(device.trips.defined)
    nvm.program = device.program.copy()


def load(device: MCodeDevice) -> None:
    """Take back variables, flags and set-ups; programs stay as they are."""
    was = device.memory.counting, device.memory.values["DE"]
    mode = device.motor.hmt.mode
    device.axis.rescale(device.now)
    device.memory.load(device.nvm)
    device.axis.orient(device.now)
    if was != (device.memory.counting, device.memory.values["DE"]):
        device.axis.align(device.now)
    device.motor.hmt.changed(mode, device.now)
    device.motor.tune()
    device.inputs.defaults()
    device.inputs.types.update(device.nvm.inputs)
    device.output_lines.restore(device.nvm.outputs)
    device.limits.update({0: (0, 0), 1: (0, 0), **device.nvm.limits})
    device.trips.restore(device.nvm.trips)
    device.stale = True


def erase(device: MCodeDevice) -> None:
    """NVM as it leaves the factory, which IP goes back to then, but for what factory defaults leave alone."""
    fresh, kept = Store(program=Program(product=device.product)), device.nvm
    Memory(device.product).save(fresh)
    fresh.values.update({name: value for name, value in kept.values.items() if name in KEPT_BY_FD})
    fresh.texts.update({name: value for name, value in kept.texts.items() if name in KEPT_BY_FD})
    device.nvm = fresh


def boot(device: MCodeDevice) -> None:
    """Begin with what NVM holds: sign on (not in party mode, where nobody speaks unasked), and run SU."""
    device.interpreter.clear()
    device.memory.defaults()
    device.output_lines.defaults()
    load(device)
    device.program = device.nvm.program.copy()
    device.clear_error()
    device.programming, device.pending, device.jogging = None, "", 0
    device.motor.restart(device.now)
    device.inputs.begin(device.now)
    device.baud = BAUDS[int(device.memory.values.get("BD", 96))]
    if not device.party:
        prompts = device.model.prompts_at_start and device.echo_mode == 0 and not device.memory.values["CK"]
        device.announce(device.model.sign_on + (PROMPT if prompts else ""))
    if "SU" in device.program.labels:
        device.interpreter.start(Name("SU"), device.now)


def equip(device: MCodeDevice) -> None:
    """Put the spec's program, settings and name into NVM. Raises Diagnostic for what the drive does not take.

    What its inputs are meanwhile is nothing to react to.
    """
    spec = device.spec
    device.inputs.begin(0.0)
    device.inputs.watched = False
    for number, line in enumerate(spec.program.splitlines(), 1):
        if device.execute(line, 0.0).refused:
            raise _not_taken(device, line, f"{spec.program_name or 'program'}:{number}")
    device.programming = None
    device.interpreter.finish()
    device.motor.stop(0.0)
    device.memory.texts["DN"] = spec.name
    waiting = [*spec.assignments(), *([("PY", "1")] if spec.party else [])]
    waiting.sort(key=lambda each: each[0] == "AS")  # the motor may turn from there on
    for _ in range(2):
        waiting = [each for each in waiting if device.execute("=".join(each), 0.0).refused]
    if waiting:
        raise _not_taken(device, "=".join(waiting[0]), f"drive {spec.name}: set")
    save(device)
    device.inputs.watched = True


def _not_taken(device: MCodeDevice, line: str, where: str) -> Diagnostic:
    code = int(device.memory.values["ER"])
    return Diagnostic(
        f"{line.strip()}: refused by an {device.product}: error {code}, {text(code, device.product)}", where
    )
