"""A drive in a program of the Python API: what each family promises of it."""

from __future__ import annotations

import pytest

import multidrop
from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, MotionFailed, Refused
from multidrop.contract.desk import Desk, in_virtual_time
from multidrop.contract.settings import Programs


class Api(Programs):
    """`multidrop.connect_async`, whose calls are those of `multidrop.connect`."""

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
            return
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
    async def test_a_program_runs_homes_and_switches_or_is_told_that_it_cannot(self, desk: Desk) -> None:
        async with desk.session() as opened:
            actions = opened.drive.family.values.actions
            axis = (await opened.motions(desk.names[0]))[0].axis
            homings = actions.homings(axis)
            usual = next(iter(homings.values()), {})
            assert usual.get("-", usual.get("")) == self.sample.homes
            for line, made in ((self.sample.runs, actions.run), (self.sample.output, actions.output)):
                given = (axis, 1000) if made == actions.run else (1, True)
                if line is None:
                    with pytest.raises(Inexpressible, match="nothing was sent"):
                        made(*given)
                else:
                    found = made(*given)
                    assert line == (found if isinstance(found, str) else found[-1])

    @in_virtual_time
    async def test_a_motion_that_fails_is_an_exception(self, desk: Desk) -> None:
        if self.sample.limit is None:
            return
        limited = desk.again(drive=self.sample.limited)
        async with multidrop.connect_async(limited.url) as session:
            axis = session.drive(desk.names[0])
            for line in (*self.sample.setup, self.sample.far):
                await axis.send(line)
            with pytest.raises(MotionFailed) as failure:
                await axis.wait()
            assert self.said(self.sample.limit, str(failure.value))
            assert failure.value.position == await axis.position()
