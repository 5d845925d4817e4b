"""A session against the simulator, in any order: lines, stops, noise, pulled plugs, power, polls, macros."""

from __future__ import annotations

import asyncio
import itertools
import tempfile
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from multidrop.base.errors import Diagnostic, DriveError, TransportLost
from multidrop.macros import Macro
from multidrop.macros.model import MacroStep
from multidrop.shell.scripts.executor import play
from multidrop.simulator.cell.spec import Faults
from soak.judge import Witness
from soak.languages import MCodeLanguage
from tests.support.cell_session import CellSession, bus, moves, party
from tests.support.examples import examples
from tests.support.faults import disturb
from tests.support.virtual import VirtualLoop

pytestmark = pytest.mark.slow

DRIVES = st.sampled_from("ab")
FAULTS = st.sampled_from(
    [
        Faults(),
        Faults(flip=2e-3, drop=2e-3, double=2e-3, insert=2e-3),
        Faults(late=0.01, late_by=(0.1, 1.5), delay=(0.0, 0.05)),
        Faults(delay=(0.5, 1.5)),
    ]
)
SETTINGS = st.sampled_from(["EM=0", "EM=1", "EM=2", "EM=3", "CK=0", "CK=1", "CK=2", "ES=0", "ES=1", "ES=3"])
LINES = st.sampled_from(["PR P", "L", "PR AL", "S", "ZZ", "PG 1", "E", "PG", "EX 1", "H 5", "PR", "=", "VM=5", "PR ER"])
LONGEST = 200.0
"""Virtual seconds that one line may take."""


class AnyOrder(RuleBasedStateMachine):
    """One line with two drives, and what must hold whatever happens on it."""

    @initialize(em=st.integers(0, 3), check=st.integers(0, 2))
    def begin(self, em: int, check: int) -> None:
        self.runner = asyncio.Runner(loop_factory=VirtualLoop)
        self.folder = tempfile.TemporaryDirectory()
        drives = (party(name, EM=em, CK=check) for name in "ab")
        self.shop = CellSession(Path(self.folder.name), bus("w", *drives))
        self.run(self.shop.__aenter__())
        self.floor = self.shop.floor
        self.devices = {placed.spec.name: placed.device for placed in self.floor.floor.drives}
        self.witnesses = {
            name: Witness(device, MCodeLanguage.asks, MCodeLanguage.refused) for name, device in self.devices.items()
        }
        self.numbers = itertools.count(1000)
        self.plugged, self.faults = True, Faults()

    def run(self, work):
        """Do it; what a person may read is no defect."""

        async def limited():
            async with asyncio.timeout(LONGEST):
                return await work

        try:
            return self.runner.run(limited())
        except (DriveError, Diagnostic, TransportLost) as error:
            assert str(error) and "\n" not in str(error)

    @property
    def session(self):
        return self.shop.session

    @rule(drive=DRIVES, form=st.sampled_from(["R1={}", "MR {}", "MA {}", "SL {}", "R2={}", "VM={}"]))
    def command(self, drive, form):
        self.run(self.session.run(f"@{drive} {form.format(next(self.numbers))}"))

    @rule(drive=DRIVES, line=st.one_of(SETTINGS, LINES))
    def line(self, drive, line):
        self.run(self.session.run(f"@{drive} {line}"))

    @rule(lines=st.lists(st.tuples(DRIVES, st.sampled_from(["R1={}", "PR R1", "MR {}"])), min_size=2, max_size=4))
    def lines_at_once(self, lines):
        async def all_of_them():
            typed = [f"@{drive} {form.format(next(self.numbers))}" for drive, form in lines]
            ended = await asyncio.gather(*map(self.session.run, typed), return_exceptions=True)
            assert all(isinstance(each, (DriveError, Diagnostic, TransportLost, type(None))) for each in ended), ended

        self.run(all_of_them())

    @rule(faults=FAULTS, seed=st.integers(0, 99))
    def noise(self, faults, seed):
        self.faults = faults
        disturb(self.floor.floor.wires["w"], faults, seed)

    @rule(drive=DRIVES)
    def power_cycle(self, drive):
        async def cycle():
            self.shop.world(f"/sim power {drive} off")
            await asyncio.sleep(0.5)
            self.shop.world(f"/sim power {drive} on")

        self.run(cycle())

    @rule()
    def poll(self):
        async def look():
            for each in self.session.buses.values():
                subscription = each.telemetry.subscribe(tuple(each.drives), 0.05)
                await asyncio.sleep(1.0)
                subscription.close()

        self.run(look())

    @rule(drive=DRIVES)
    def macro(self, drive):
        lines = (f"@{drive} MR {next(self.numbers)}", "/wait stopped 5", f"@{drive} PR P")
        self.run(
            play(self.session, self.session.origin, Macro("m", tuple(MacroStep(0.05, line) for line in lines)), {})
        )

    @rule(wait=st.floats(0.0, 0.1))
    def stop_amid_a_line(self, wait):
        async def amid():
            typed = asyncio.ensure_future(self.session.run(f"@a MR {next(self.numbers)}"))
            await asyncio.sleep(wait)
            self.session.stop()
            await asyncio.gather(typed, return_exceptions=True)
            for each in self.session.buses.values():
                await each.stopped()
            await asyncio.sleep(2.0)
            await self.session.run("/resume")

        self.run(amid())
        if self.faults == Faults() and self.plugged:
            now = self.floor.now()
            assert not any(moves(device, now) for device in self.devices.values())

    @precondition(lambda self: self.plugged)
    @rule()
    def unplug(self):
        self.plugged = False
        self.run(self._world("/sim unplug w"))

    @precondition(lambda self: not self.plugged)
    @rule()
    def plug(self):
        async def again():
            self.shop.world("/sim plug w")
            await asyncio.sleep(2.0)
            for name in list(self.session.buses):
                await self.session.forget(self.session.bus(name))
            await self.session.open(self.shop.url)

        self.plugged = True
        self.faults = Faults()
        disturb(self.floor.floor.wires["w"])
        self.run(again())

    async def _world(self, line):
        self.shop.world(line)
        await asyncio.sleep(0.1)

    @invariant()
    def nothing_was_executed_twice(self):
        for name, witness in getattr(self, "witnesses", {}).items():
            numbered = Counter(line for line in witness.executed if line[-4:].isdigit())
            assert all(times == 1 for times in numbered.values()), (name, numbered)

    def teardown(self):
        if hasattr(self, "runner"):
            self.runner.run(self.shop.__aexit__())
            self.runner.close()
            self.folder.cleanup()


def test_a_session_survives_any_order_and_executes_nothing_twice():
    how = settings(examples(6, 400), stateful_step_count=14)
    run_state_machine_as_test(AnyOrder, settings=how)
