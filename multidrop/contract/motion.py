"""Motion and the stop: what each family promises of them."""

from __future__ import annotations

import asyncio
import re
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, DriveError, MotionFailed, Stopped
from multidrop.contract.desk import Desk, Opened, in_virtual_time
from multidrop.contract.lines import OfFamily
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.motions import NO_SIGNS
from multidrop.drives.events import Sample
from multidrop.shell.events import By, OnBus

FAR = 900_000
"""A place that takes long to reach."""


class Motions(OfFamily):
    """Moves, waits, telemetry, and which lines can start a motion."""

    async def places(self, opened: Opened) -> list[tuple[int, int]]:
        """Position and velocity of the first axis of each drive."""
        found = [await opened.motions(address) for address in self.sample.addresses]
        return [(axes[0].position, axes[0].velocity) for axes in found]

    async def far(self, opened: Opened) -> None:
        """Let the first drive move for long."""
        await opened.say(*self.sample.setup, self.sample.far)
        await asyncio.sleep(0.5)
        assert (await self.places(opened))[0][1] != 0

    @in_virtual_time
    async def test_a_wait_ends_where_the_move_ends_and_other_drives_stay(self, desk: Desk) -> None:
        async with desk.session() as opened:
            await opened.say(*self.sample.setup, self.sample.moves.line, "/wait stopped")
            assert await self.places(opened) == [(self.sample.moves.place, 0), *[(0, 0)] * (len(desk.names) - 1)]
            assert not [text for text in opened.told() if "stopped at" in text]

    @in_virtual_time
    async def test_lines_that_move_it_are_those_that_programs_send(self, desk: Desk) -> None:
        family, place = FAMILIES[self.sample.family], self.sample.moves.place
        async with desk.session() as opened:
            axis = (await opened.motions(self.sample.addresses[0]))[0].axis
            for lines in (family.move_to(axis, place), family.move_to("", place)):
                await opened.say(*self.sample.setup, *lines, "/wait stopped")
                assert (await self.places(opened))[0] == (place, 0)
                assert any(opened.drive.starts(line) for line in lines)

    @in_virtual_time
    async def test_an_endless_motion_goes_on_until_it_is_ended(self, desk: Desk) -> None:
        async with desk.session() as opened:
            await self.far(opened)
            with pytest.raises(DriveError, match="still"):
                await opened.run("/wait stopped 2")
            if self.sample.ends is not None:
                await opened.say(self.sample.ends, "/wait stopped")
                assert (await self.places(opened))[0][1] == 0

    @in_virtual_time
    async def test_a_limit_fails_the_wait_and_the_next_line_is_not_sent(self, desk: Desk) -> None:
        if (limit := self.sample.limit) is None:
            self.without("signs of how a motion ended")
        async with desk.again(self.sample.limited).session() as opened:
            lines = (*self.sample.setup, self.sample.far, "/wait stopped", self.sample.reads.line)
            with pytest.raises(MotionFailed) as failure:
                await opened.automation(*lines)
            assert self.said(limit, str(failure.value)), failure.value
            assert opened.last == "/wait stopped" and failure.value.outcome == "limit"
            assert (failure.value.position, 0) == (await self.places(opened))[0]

    @in_virtual_time
    async def test_a_limit_short_of_the_target_fails_the_wait_with_both_places(self, desk: Desk) -> None:
        if (limit := self.sample.limit) is None:
            self.without("signs of how a motion ended")
        async with desk.again(self.sample.limited).session() as opened:
            await opened.say(*self.sample.setup, *FAMILIES[self.sample.family].move_to("", FAR))
            with pytest.raises(MotionFailed) as failure:
                await opened.run("/wait stopped")
            place = (await self.places(opened))[0][0]
            assert (failure.value.outcome, failure.value.position, failure.value.target) == ("limit", place, FAR)
            reason = limit.partition(": ")[2]
            assert re.search(f"stopped at {place} of {FAR}: {reason}$", str(failure.value)), failure.value

    @in_virtual_time
    async def test_a_stop_by_another_host_fails_the_wait(self, desk: Desk) -> None:
        if self.sample.limit is None or self.sample.ends is None:
            self.without("signs of how a motion ended")
        async with desk.session() as opened:
            await self.far(opened)
            waiting = asyncio.ensure_future(opened.run("/wait stopped"))
            await asyncio.sleep(0.3)
            drive = opened.drive
            await drive.run(drive.family.perform(self.sample.ends))  # past everything that the session records
            with pytest.raises(MotionFailed) as failure:
                await waiting
            assert (failure.value.outcome, failure.value.reason) == ("stopped", "not by this script")

    @in_virtual_time
    async def test_a_relative_move_has_the_target_that_it_had_at_its_beginning(self, desk: Desk) -> None:
        if self.sample.limit is None or self.sample.ends is None:
            self.without("signs of how a motion ended")
        family, place = FAMILIES[self.sample.family], self.sample.moves.place
        async with desk.session() as opened:
            await opened.say(*self.sample.setup, self.sample.moves.line, "/wait stopped", *family.move("", -place // 2))
            await opened.say("/wait stopped")
            assert (await self.places(opened))[0] == (place - place // 2, 0)
            await opened.say(*family.move("", FAR))
            await asyncio.sleep(0.3)
            await opened.drive.run(opened.drive.family.perform(self.sample.ends))
            with pytest.raises(MotionFailed) as failure:
                await opened.run("/wait stopped")
            assert (failure.value.outcome, failure.value.target) == ("stopped", place - place // 2 + FAR)

    @in_virtual_time
    async def test_an_automation_that_ends_early_stops_what_it_moved(self, desk: Desk) -> None:
        async with desk.session() as opened:
            with pytest.raises(DriveError):
                await opened.automation(*self.sample.setup, self.sample.far, "/sleep 0.5", self.sample.refused.line)
            await asyncio.sleep(5.0)
            assert [velocity for _, velocity in await self.places(opened)] == [0] * len(desk.names)

    @in_virtual_time
    async def test_an_automation_that_only_reads_stops_nothing_at_its_early_end(self, desk: Desk) -> None:
        async with desk.session() as opened:
            await self.far(opened)
            with pytest.raises(Diagnostic):
                await opened.automation(self.sample.reads.line, "/use nowhere")
            await asyncio.sleep(1.0)
            assert (await self.places(opened))[0][1] != 0

    @in_virtual_time
    async def test_telemetry_has_samples_of_position_and_velocity(self, desk: Desk) -> None:
        async with desk.session() as opened:
            await self.far(opened)
            looking = opened.bus.telemetry.subscribe([*desk.names], 0.1)
            await asyncio.sleep(2.0)
            looking.close()
            found = [event.event for event in opened.events if isinstance(event, OnBus)]
            samples = [each for each in found if isinstance(each, Sample)]
            axes = [each.axis for each in await opened.motions(desk.names[0])]
            own = [sample for sample in samples if (sample.address, sample.axis) == (desk.names[0], axes[0])]
            assert len(own) > 5 and own[-1].velocity != 0
            assert len({each.position for each in own}) == len(own)
            seen = {(sample.address, sample.axis) for sample in samples}
            assert seen == {(name, axis) for name in desk.names for axis in axes}
            assert {sample.position for sample in samples if sample not in own} <= {0}

    @in_virtual_time
    async def test_it_is_known_which_lines_can_start_something(self, desk: Desk) -> None:
        family = FAMILIES[self.sample.family]
        async with desk.session() as opened:
            starts = {line for line in (*self.sample.starts, *self.sample.harmless) if opened.drive.starts(line)}
            assert starts == {*self.sample.starts}
            lines = (*self.sample.starts, *self.sample.harmless)
            assert {line for line in lines if family.only_reads(line)} == {*self.sample.only_reads}
            assert {line for line in lines if family.only_ends(line)} == {*self.sample.ended_only}
            motions = opened.drive.family.motions
            for axis in ("", "x", "0"):
                assert motions.place(NO_SIGNS, axis) is None and not motions.runs(NO_SIGNS)


class Stopping(Motions):
    """The stop: its bytes go first, nothing that was queued is sent, and it is confirmed."""

    @in_virtual_time
    async def test_the_stop_goes_first_and_what_was_queued_is_never_sent(self, desk: Desk) -> None:
        async with desk.session() as opened:
            await self.far(opened)
            opened.wire.hold()
            waiting = [
                asyncio.ensure_future(opened.run(line))
                for line in (self.sample.reads.line, self.sample.reads_other.line, self.sample.moves.line)
            ]
            await asyncio.sleep(0.05)
            opened.begin()
            opened.session.stop()
            assert opened.written.startswith(self.sample.stop), opened.written
            opened.wire.release()
            for each in await asyncio.gather(*waiting, return_exceptions=True):
                assert isinstance(each, Stopped | DriveError), each
            await opened.bus.stopped()
            assert (await self.places(opened))[0][1] == 0
            moved = await self.places(opened)
            await asyncio.sleep(5.0)
            assert await self.places(opened) == moved

    @in_virtual_time
    async def test_the_stop_reaches_each_drive_and_is_confirmed(self, desk: Desk) -> None:
        async with desk.session() as opened:
            for name in desk.names:
                lines = (*self.sample.setup, self.sample.far, *self.sample.far_others)
                await opened.say(*(f"@{name} {line}" if name else line for line in lines))
            await asyncio.sleep(0.5)
            opened.begin()
            opened.session.stop()
            await opened.bus.stopped()
            await asyncio.sleep(3.0)
            told = [text for text in opened.told() if "stopped, velocity 0" in text]
            assert len(told) == len(desk.names), opened.told()
            assert not [text for text in opened.told() if "not known" in text or "STILL" in text]
            for part in self.sample.stop_all:
                assert part in opened.written
            stood = [await opened.motions(name) for name in desk.names]
            assert not any(axis.velocity for axes in stood for axis in axes)
            assert all(sum(axis.position != 0 for axis in axes) == 1 + len(self.sample.far_others) for axes in stood)
            await asyncio.sleep(5.0)
            assert [await opened.motions(name) for name in desk.names] == stood

    @in_virtual_time
    async def test_after_a_stop_a_person_goes_on_and_automation_waits_for_resume(self, desk: Desk) -> None:
        async with desk.session() as opened:
            opened.session.stop()
            await opened.bus.stopped()
            await asyncio.sleep(3.0)
            with pytest.raises(Stopped):
                await opened.run(self.sample.moves.line, replace(opened.session.origin, by=By.MACRO))
            assert await opened.say(self.sample.reads.line) == [self.sample.reads.printed]
            await opened.say(*self.sample.setup, self.sample.moves.line, "/wait stopped", "/resume")
            assert (await self.places(opened))[0] == (self.sample.moves.place, 0)

    @in_virtual_time
    async def test_the_bytes_of_a_stop_are_heard_by_every_drive(self, desk: Desk) -> None:
        async with desk.session() as opened:
            codec, names = opened.drive.codec, [*desk.names]
            for sure in (True, False):
                again = b"".join(piece.data for piece in codec.stop_again(names, sure))
                for name in names:
                    assert codec.hears_stop(codec.stop(names, sure) + again, name, sure)
