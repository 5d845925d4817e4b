"""The rescue of a drive that does not reply: step by step, what may do harm only after a question, what erases last.

A drive is free once it replies in a known mode: its name, baud rate and modes are listed. Its settings stay as they are
unless a change of them is asked for.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted
from multidrop.dialects import Procedure
from multidrop.dialects.families import FAMILIES, family_of
from multidrop.drives.events import BusEvent, Traffic
from multidrop.shell.finding.scanning import HAZARD, SO_FAR, FoundDrive, Scanning, Stage, listed
from multidrop.shell.workspace import Workspace

LISTENS = 20.0
"""The time to listen for a sign-on after a question, s: the user walks to a switch."""
PLAIN = {"em": "EM=0", "checksum": "CK=0", "party": "PY=0"}
"""The settings of a drive that needs no knowledge, by the attribute of its codec; party mode last."""
ERASES = (
    "FD is sent in every form to every drive on the line; it erases their programs, variables, parameters and names, "
    "also in memory that outlives the power, and cannot be undone"
)


class Rescue:
    """One rescue on a port. Each step is published before it begins."""

    def __init__(self, workspace: Workspace, scanning: Scanning) -> None:
        self._workspace = workspace
        self._scanning = scanning
        self._step = 0

    async def run(self, bauds: Sequence[int], *, everything: bool, erase: bool) -> None:
        """Free what is stuck. `everything`: take each step although drives reply; `erase`: agree to go as far as FD.

        Raises NothingFound, Diagnostic where a person does not agree, and the failures of a port.
        """
        stages = self._scanning.stages(bauds)
        if not stages[0].scan.clears:
            why = f"a {stages[0].scan.title} drive that does not reply is freed by a pause; rescue has no step for it"
            raise Diagnostic(why, self._scanning.port, f"multidrop scan --dialect {stages[0].family} searches for it")
        async with self._scanning.stopping_all():
            for step in (self._search, self._clear, self._widen, self._power_cycles):
                await step(stages)
                if self._scanning.found and not everything:
                    return
            if not self._scanning.found:
                await self._erase(stages, erase)
        if not self._scanning.found:
            raise self._scanning.nothing(stages)

    async def make_plain(self, drive: FoundDrive) -> None:
        """Set EM=0, CK=0 and PY=0 in a drive that was found, where it is set otherwise. Raises Diagnostic."""
        codec = drive.state.codec
        lines = [line for attribute, line in PLAIN.items() if getattr(codec, attribute, 0)]
        if not lines:
            return
        what = f"{', '.join(lines)} is set in {drive.state.address or 'the drive'}, and is lost at power-off without S"
        await self._workspace.questions.confirm(what, drive.port, SO_FAR)

        def procedure() -> Procedure[None]:
            for line in lines:
                yield from family_of(drive.state).perform(line)

        async with self._scanning.stopping_all():
            await self._scanning.converse(drive.connection, procedure)
        self._say(f"{', '.join(lines)} is set; S saves it")

    async def _search(self, stages: Sequence[Stage]) -> None:
        """Search where the drive is expected; nothing is changed."""
        self._say_step(f"search with {listed(stages[:1])}; this moves and changes nothing")
        await self._scanning.search(stages[:1], False, hasty=True)

    async def _clear(self, stages: Sequence[Stage]) -> None:
        """Clear what keeps a drive from replying, and search again."""
        first = stages[0]
        self._say_step(f"clear the line at {first.words} and search again")
        await self._workspace.questions.confirm(
            f"no drive replies; the next step {first.scan.clears}", self._scanning.port, SO_FAR
        )
        await self._cleared(first)

    async def _widen(self, stages: Sequence[Stage]) -> None:
        """Search at the other baud rates and in the other language, then clear and search there."""
        if not (others := stages[1:]):
            return
        self._say_step(f"search, clear and search again with {listed(others)}")
        hazards = f"the next step goes on with {listed(others)}; {HAZARD}; it stops every drive, and erases nothing"
        await self._workspace.questions.confirm(hazards, self._scanning.port, SO_FAR)
        await self._scanning.search(others, False, hasty=True)
        for stage in others:
            if not self._scanning.found:
                await self._cleared(stage)

    async def _cleared(self, stage: Stage) -> None:
        assert stage.scan.clears
        await self._scanning.converse(self._scanning.connection(stage), stage.scan.clear)
        self._say(f"cleared with {stage.words}; programs that ran are stopped until they are started again")
        await self._scanning.search([stage], False)

    async def _power_cycles(self, stages: Sequence[Stage]) -> None:
        """Have a person switch the drive off and on, and listen for its sign-on at each baud rate."""
        self._say_step(
            "switch the drive off and on: it begins with its saved settings, and outside of party mode it sends a "
            "sign-on; nothing is sent while this listens"
        )
        if self._workspace.front.ask is None or self._workspace.questions.agreed:
            self._say("this step needs a person at a terminal, without --yes; it is left out")
            return
        for stage in stages:
            if not stage.scan.erases:
                continue  # only drives with a sign-on can be heard
            try:
                what = (
                    f"listen with {stage.words} for {LISTENS:g} s; a program labelled SU may start and move the drive"
                )
                await self._workspace.questions.confirm(
                    f"{what}; switch the drive off and on after the answer", "power", SO_FAR
                )
            except Diagnostic:
                return
            self._say(await self._listened(stage))
            await self._scanning.search([stage], False, hasty=True)
            if self._scanning.found:
                return

    async def _listened(self, stage: Stage) -> str:
        """Listen for a sign-on; return what was received, in words."""
        codec, received, signed = FAMILIES[stage.family].codec, bytearray(), asyncio.Event()

        def take(event: BusEvent) -> None:
            if isinstance(event, Traffic) and not event.outgoing:
                received.extend(event.data)
                if any(map(codec.restarted, received.decode("latin-1").split("\n"))):
                    signed.set()

        async with self._scanning.opened(self._scanning.connection(stage)) as bus:
            leave = bus.watch(take)
            try:
                async with asyncio.timeout(LISTENS):
                    await signed.wait()
            except TimeoutError:
                what = f"{counted(len(received), 'byte')} that cannot be read" if received else "nothing"
                return f"received {what} with {stage.words}; a drive in party mode sends no sign-on"
            finally:
                leave()
        return f"a sign-on with {stage.words}: the drive is outside of party mode"

    async def _erase(self, stages: Sequence[Stage], agreed: bool) -> None:
        """Set every drive to factory defaults, after a question of its own."""
        erasing = [stage for stage in stages if stage.scan.erases]
        asks = self._workspace.front.ask is not None and not self._workspace.questions.agreed
        if not erasing or not (agreed or asks):
            self._say("nothing short of erasing is left; multidrop rescue --erase goes as far as FD")
            return
        self._say_step("FD: factory defaults")
        await self._workspace.questions.confirm(ERASES, self._scanning.port, SO_FAR)
        defaults = [stage for stage in erasing if stage.baud in (None, FAMILIES[stage.family].baud)]
        for stage in erasing:
            assert stage.scan.erases
            await self._scanning.converse(self._scanning.connection(stage), stage.scan.erase)
            await self._scanning.search(list(dict.fromkeys([stage, *defaults])), False)
            if self._scanning.found:
                return

    def _say_step(self, text: str) -> None:
        self._step += 1
        self._say(f"step {self._step}: {text}")

    def _say(self, text: str) -> None:
        self._workspace.notify(text, outcome=True)
