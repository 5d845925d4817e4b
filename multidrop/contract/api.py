"""A drive in a program of the Python API: what each family promises of it."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

import multidrop
from multidrop import Timeout
from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, MotionFailed, Refused
from multidrop.contract.desk import Desk, in_virtual_time
from multidrop.contract.settings import Programs
from multidrop.shell.events import Entered, SessionEvent


class Api(Programs):
    """`multidrop.connect_async`, whose calls are those of `multidrop.connect`."""

    entered: list[str]
    """The lines that the program has sent."""

    @asynccontextmanager
    async def program(self, desk: Desk) -> AsyncIterator[multidrop.AsyncDrive]:
        """The first drive of a line, in a program."""
        self.entered = []

        def take(event: SessionEvent) -> None:
            if isinstance(event, Entered) and event.bus and not event.line.startswith("/"):
                self.entered.append(event.line.partition(" ")[2])

        async with multidrop.connect_async(desk.url) as session:
            session._shell.subscribe(take)
            yield session.drive(desk.names[0])

    @in_virtual_time
    async def test_a_program_reads_moves_waits_and_stops(self, desk: Desk) -> None:
        sample = self.sample
        async with multidrop.connect_async(desk.url) as session:
            axis = session.drive(desk.names[0])
            assert (axis.address, axis.product) == (desk.names[0], sample.product)
            for line in sample.setup:
                await axis.send(line)
            assert await axis.send(sample.reads.line) == [sample.reads.printed]
            assert (await axis.position(), await axis.velocity(), await axis.moving()) == (0, 0, False)
            await axis.move_to(sample.moves.place)
            assert await axis.moving()
            await axis.wait()
            assert (await axis.position(), await axis.velocity()) == (sample.moves.place, 0)
            await axis.send(sample.far)
            await axis.stop()
            assert not await axis.moving()

    @in_virtual_time
    async def test_a_program_reads_and_writes_values(self, desk: Desk) -> None:
        written, word = self.sample.writes, self.sample.word
        async with multidrop.connect_async(desk.url) as session:
            axis = session.drive(desk.names[0])
            if word is not None:
                assert await axis.read(word.line) == float(word.printed)
            if written is not None and written.api is not None:
                await axis.write(*written.api)
                assert await axis.send(written.read) == [str(written.api[1])]
            else:
                with pytest.raises((Diagnostic, DriveError), match="QQ"):
                    await axis.write("QQ", 1)

    @in_virtual_time
    async def test_a_program_moves_by_quantities(self, desk: Desk) -> None:
        if (scaled := self.sample.scaled) is None:
            self.without("lines with quantities")
        async with multidrop.connect_async(desk.url) as session:
            axis, (place, unit) = session.drive(desk.names[0]), scaled.quantity
            await session.send(" ".join(f"/units {self.sample.measured} {scaled.scale}".split()))
            for line in self.sample.setup:
                await axis.send(line)
            await axis.move_to(place, unit)
            await axis.wait()
            assert await axis.position() == scaled.place
            assert await axis.position_in(unit) == pytest.approx(place)

    @in_virtual_time
    async def test_a_refusal_is_an_exception_with_the_same_words(self, desk: Desk) -> None:
        async with multidrop.connect_async(desk.url) as session:
            axis = session.drive(desk.names[0])
            with pytest.raises(Refused) as failure:
                await axis.send(self.sample.refused.line)
            assert self.said(self.sample.refused.said, str(failure.value))
            assert isinstance(failure.value, DriveError)

    @in_virtual_time
    async def test_a_program_homes_it_and_sees_how_that_ended(self, desk: Desk) -> None:
        homes = self.sample.homes
        async with self.program(desk.again(homes.drive) if homes is not None else desk) as axis:
            if homes is None:
                with pytest.raises(Inexpressible, match="homes them; nothing was sent"):
                    await axis.home("-")
                return
            assert await axis.homed() is False
            for line in homes.setup:
                await axis.send(line)
            for wrong in ("left", "-" if homes.direction == "" else ""):
                sends = re.escape(f"home({repr(homes.direction) if homes.direction else ''}) sends {homes.line}")
                with pytest.raises(Diagnostic, match=f"direction.*{sends}"):
                    await axis.home(wrong)
            with pytest.raises(Diagnostic, match="no mode nowhere; valid: "):
                await axis.home(homes.direction, "nowhere")
            assert self.entered == [*homes.setup]
            await axis.home(homes.direction)
            assert self.entered == [*homes.setup, homes.line]
            assert await axis.homed() is False and await axis.moving()
            await axis.wait()
            assert await axis.homed() is True
            await axis.move(10)
            await axis.wait()
            assert await axis.homed() is True

    @in_virtual_time
    async def test_a_program_runs_it_at_a_velocity(self, desk: Desk) -> None:
        async with self.program(desk) as axis:
            if (runs := self.sample.runs) is None:
                with pytest.raises(Inexpressible, match="nothing was sent"):
                    await axis.run_at(1000)
                return
            with pytest.raises(TypeError):
                await axis.run_at(0.5)
            await axis.run_at(runs.velocity)
            assert self.entered == [*runs.lines]
            await asyncio.sleep(0.5)
            assert await axis.velocity() and await axis.moving()
            with pytest.raises(Timeout, match=rf"^wait: {axis.name} still runs after 0.1 s$"):
                await axis.wait(0.1)
            await axis.run_at(0)
            await axis.wait()
            assert self.entered == [*runs.lines, *runs.ends]
            assert await axis.position() * runs.velocity > 0

    @in_virtual_time
    async def test_a_program_switches_output_and_current_and_reads_inputs(
        self, desk: Desk, caplog: pytest.LogCaptureFixture
    ) -> None:
        sample = self.sample
        async with self.program(desk) as axis:
            if sample.output is None:
                with pytest.raises(Inexpressible, match="nothing was sent"):
                    await axis.set_output(1, True)
            else:
                await axis.set_output(1, True)
                assert self.entered == [sample.output]
            if sample.current is None:
                for call in (axis.enable, axis.disable):
                    with pytest.raises(Inexpressible, match=rf"able\(\): {re.escape(sample.no_current)}"):
                        await call()
            else:
                await axis.disable()
                assert f"{axis.name}: no current: nothing holds the load; a load that hangs may drop" in caplog.messages
                assert await axis.read(sample.current) == 0
                await axis.enable()
                assert await axis.read(sample.current) == 1
            if sample.inputs is None:
                with pytest.raises(Inexpressible):
                    await axis.inputs()
            else:
                assert {*await axis.inputs()} == sample.inputs
            assert await axis.position() == 0

    @in_virtual_time
    async def test_a_program_reads_an_error_and_only_one_call_clears_it(self, desk: Desk) -> None:
        error = self.sample.error
        async with self.program(desk.again(self.sample.limited) if self.sample.limited else desk) as axis:
            if error is None:
                for call in (axis.error, axis.read_error):
                    with pytest.raises(Inexpressible, match=re.escape(f"{axis.name}: {self.sample.no_error}")):
                        await call()
                return
            assert await axis.error() is None and await axis.read_error() is None
            for line in (*self.sample.setup, self.sample.far):
                await axis.send(line)
            while await axis.moving():  # a wait would read the error for its reason
                await asyncio.sleep(0.5)
            found = await axis.error()
            assert found is not None and re.fullmatch(error.said, str(found)), found
            assert await axis.error() == found
            try:
                read = await axis.read_error()
            except MotionFailed:  # the motion is judged before its sign is cleared
                read = await axis.read_error()
            assert read is not None and re.fullmatch(error.reading, str(read)), read
            assert await axis.error() is None

    @in_virtual_time
    async def test_a_wait_for_a_value_has_a_limit(self, desk: Desk) -> None:
        word, place = self.sample.position, self.sample.moves.place
        async with self.program(desk) as axis:
            if word is None:
                with pytest.raises((Diagnostic, DriveError)):
                    await axis.wait_for("QQ=1", timeout=0.2)
                return
            for line in self.sample.setup:
                await axis.send(line)
            await axis.move_to(place)
            await axis.wait_for(f"{word}>={place // 2}")
            await axis.wait()
            await axis.wait_for(f"{word}={place}", timeout=0)
            with pytest.raises(
                Timeout, match=rf"^wait_for {word}\S*=7: {axis.name} still reports {place} after 0.2 s$"
            ):
                await axis.wait_for(f"{word}=7", timeout=0.2)
            for wrong in ("nonsense", "@b P=1", ""):
                with pytest.raises(Diagnostic, match="no condition"):
                    await axis.wait_for(wrong)

    @in_virtual_time
    async def test_a_motion_that_fails_is_an_exception(self, desk: Desk) -> None:
        if self.sample.limit is None:
            self.without("signs of how a motion ended")
        limited = desk.again(drive=self.sample.limited)
        async with multidrop.connect_async(limited.url) as session:
            axis = session.drive(desk.names[0])
            assert await axis.limits() == multidrop.Limits(False, False, None)
            for line in (*self.sample.setup, self.sample.far):
                await axis.send(line)
            with pytest.raises(MotionFailed) as failure:
                await axis.wait()
            assert await axis.limits() == multidrop.Limits(False, True, None)
            assert self.said(self.sample.limit, str(failure.value))
            assert failure.value.position == await axis.position()
