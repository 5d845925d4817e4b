"""Shared by the tests: simulated MCode drives that are their own witnesses, and what a host knows of them."""

from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from tests.support.faults import disturb

MODES = [(em, party, check) for em in range(4) for party in (False, True) for check in range(3)]


class Witness:
    """What one simulated drive carried out: lines, whether it refused them, whether it stored them."""

    def __init__(self, device):
        self.lines, self.device, execute = [], device, device.execute

        def seen(text, now):
            stored = device.programming is not None
            answer = execute(text, now)
            self.lines.append((text.strip(), answer.refused, stored))
            return answer

        device.execute = seen

    def executed(self, text):
        return [line for line in self.lines if line[0] == text.strip() and not line[1] and not line[2]]


def one_drive(bench, em=0, party=False, check=0, product="", baud=0, **table):
    """A drive in that mode on a bench, and what is known of it."""
    name = "a" if party else "!"
    settings = {"EM": em, **({"CK": check} if check else {}), **table.pop("set", {})}
    desk = bench([{"name": name, "party": party, "set": settings, **table}], baud=baud)
    desk.wire.receive(b"\n\n", 0.0)  # two line feeds make party mode effective
    desk.wait(0.5)
    desk.line.events(desk.now)
    desk.strays.clear()
    codec = MCode(em=em, party=party, checksum=check, escape=1)
    return desk, MCodeState(codec, name if party else "", name, product)


class Desk:
    """Drives on a bench with what is known of each, and their witnesses."""

    def __init__(self, bench, *modes, party=False, baud=0, faults=None, seed=0, **more):
        names = "abc"[: len(modes)] if party else "!"
        tables = [
            {
                "name": name,
                "party": party,
                "personality": more.get("personality", "LMDCM"),
                "set": {"EM": em, "CK": check, **more.get("set", {})},
            }
            for name, (em, check) in zip(names, modes, strict=True)
        ]
        self.bench = bench(tables, baud=baud)
        self.bench.wire.receive(b"\n\n", 0.0)
        self.bench.wait(0.5)
        self.bench.line.events(self.bench.now)
        self.bench.strays.clear()
        self.devices = [placed.device for placed in self.bench.floor.drives]
        self.witnesses = [Witness(device) for device in self.devices]
        self.knowns = [
            MCodeState(MCode(em=em, party=party, checksum=check, escape=1), name if party else "", name, "LMDCM")
            for name, (em, check) in zip(names, modes, strict=True)
        ]
        if faults:
            disturb(self.bench.wire, faults, seed)

    @property
    def state(self):
        return self.knowns[0]

    @property
    def device(self):
        return self.devices[0]

    @property
    def witness(self):
        return self.witnesses[0]

    def type(self, text, drive=0):
        return self.bench.type(self.knowns[drive], text)

    def restart(self, drive=0):
        device, bench = self.devices[drive], self.bench
        device.power(False, bench.now)
        bench.wait(0.1)
        device.power(True, bench.now)
        bench.wait(0.3)
        if device.memory.party:
            bench.wire.receive(b"\n\n", bench.now)
            bench.wait(0.2)

    def agrees(self, drive=0):
        """Whether what is known is how the drive is set."""
        state, device = self.knowns[drive], self.devices[drive]
        mode = state.codec
        return (mode.em, mode.party, mode.checksum, mode.escape, state.programming) == (
            device.memory.echo_mode,
            device.memory.party,
            device.memory.checksum,
            device.memory.escape_mode,
            device.programming is not None,
        ) and (not mode.party or state.address == device.memory.name)
