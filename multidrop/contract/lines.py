"""Opening, typed lines and their replies: what each family promises of them."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar, NoReturn

import pytest

from multidrop.base.errors import DriveError, Inexpressible, NoAnswer, Refused, TransportLost
from multidrop.contract.desk import LINE, TIMEOUT, Desk, in_virtual_time
from multidrop.contract.sample import FamilySample
from multidrop.dialects.codec import Procedure
from multidrop.dialects.families import FAMILIES, dialects, family_of
from multidrop.shell.connect.urls import parse
from multidrop.shell.prompt.complete import complete
from multidrop.simulator.cell.table import Folder, Table
from multidrop.simulator.declared import simulated
from multidrop.simulator.families import PROGRAMS
from multidrop.simulator.families import family_of as simulated_family_of
from multidrop.simulator.family import Place


class OfFamily:
    """The base of the suite's classes."""

    sample: ClassVar[FamilySample]

    @pytest.fixture
    def desk(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
        """A line with the drives of the sample."""
        yield Desk(self.sample, tmp_path, monkeypatch)

    def without(self, what: str) -> NoReturn:
        """Leave out a test: the sample has nothing for it."""
        pytest.skip(f"{self.sample.family}: its sample leaves out {what}")

    def said(self, pattern: str, text: str) -> bool:
        """Whether a text is as the sample has it."""
        return re.fullmatch(pattern.replace("{}", re.escape(self.sample.name)), text) is not None


class Opening(OfFamily):
    """The table of families, the URL, and the search for drives."""

    def test_its_row_leads_to_its_class_and_its_state(self) -> None:
        row, family = dialects()[self.sample.family], FAMILIES[self.sample.family]
        state = family.new_state(family.codec, "a")
        assert (row.name, family.name, family.codec.family) == (self.sample.family,) * 3
        assert (state.address, state.codec, type(family_of(state))) == ("a", family.codec, family)
        assert (row.files is None) == (self.sample.program is None)
        if row.files is not None:
            assert callable(row.files.language.check) and callable(row.files.language.measure)

    def test_a_url_names_it_by_its_scheme_or_by_dialect(self) -> None:
        scheme = dialects()[self.sample.family].scheme
        url = f"{scheme}://host" if scheme else f"tcp://host?dialect={self.sample.family}"
        assert parse(url).hints.family == self.sample.family

    def test_the_endings_of_its_files_are_its_own(self) -> None:
        own = dialects()[self.sample.family].files
        others = [each.files for name, each in dialects().items() if each.files and name != self.sample.family]
        assert own is None or not {end for each in others for end in each.endings} & set(own.endings)

    def test_each_simulated_product_is_built_with_power_and_says_nothing_by_itself(self) -> None:
        row = simulated().get(self.sample.family)
        for personality in row.personalities if row else ():
            family = simulated_family_of(personality)
            assert family.name == self.sample.family
            spec = family.read_drive(Table({"personality": personality}, "cell"), Folder(Path(".")))
            unit = family.build(spec, Place())
            assert unit.device.powered and unit.port.sent(0.0) == []
            assert (unit.connect is not None) == (personality in family.ethernet)
            assert len(unit.worlds) == len(spec.further) + 1
        if row and row.programs:
            tests = PROGRAMS[self.sample.family]
            assert tests.drive.personality in row.personalities
            assert tests.by_product == ("refusals" in vars(tests))

    @in_virtual_time
    async def test_each_drive_is_found_and_nothing_moves(self, desk: Desk) -> None:
        async with desk.session() as opened:
            assert [*opened.bus.drives] == [*self.sample.addresses]
            for address, drive in opened.bus.drives.items():
                assert drive.product == self.sample.product
                assert all(each.position == each.velocity == 0 for each in await opened.motions(address))

    @in_virtual_time
    async def test_a_silent_line_is_one_line_of_reasons(self, desk: Desk) -> None:
        desk.deaf = True
        with pytest.raises(NoAnswer, match="nothing was received; check power") as failure:
            async with desk.session():
                raise AssertionError("it was opened")
        assert "\n" not in str(failure.value)

    @in_virtual_time
    async def test_an_address_that_no_drive_has_is_one_line(self, desk: Desk) -> None:
        async with desk.session() as opened:
            said = await opened.refusal(f"@{self.sample.absent.address} {self.sample.reads.line}")
            assert re.match(self.sample.absent.said, said), said

    def test_a_search_finds_each_drive(self, desk: Desk) -> None:
        scan = FAMILIES[self.sample.family].scan()
        assert (scan is not None) == self.sample.scanned
        if scan is not None:
            done = desk.command("scan", f"tcp://{LINE}", "--dialect", self.sample.family, "--all", "--json", "--yes")
            found = [json.loads(line) for line in done.out.splitlines()]
            assert [each["address"] for each in found if "address" in each] == [*self.sample.addresses], done


class Lines(OfFamily):
    """A typed line, its reply, and what goes wrong with it."""

    @in_virtual_time
    async def test_a_line_prints_the_value_that_it_reads(self, desk: Desk) -> None:
        sample = self.sample
        async with desk.session() as opened:
            assert await opened.say(sample.reads.line) == [sample.reads.printed]
            assert await opened.say(sample.reads_other.line) == [sample.reads_other.printed]

    @in_virtual_time
    async def test_a_value_that_is_set_prints_nothing_and_is_read_back(self, desk: Desk) -> None:
        if (written := self.sample.writes) is None:
            self.without("a value to set")
        async with desk.session() as opened:
            assert await opened.say(written.read) == [written.before]
            assert await opened.say(written.line) == []
            assert await opened.say(written.read) == [written.after]
            for other in self.sample.addresses[1:]:
                assert await opened.say(f"@{other} {written.read}") == [written.before]

    @in_virtual_time
    async def test_a_line_to_all_is_carried_out_by_each_drive(self, desk: Desk) -> None:
        written = self.sample.writes
        if written is None or len(self.sample.addresses) < 2 or not self.sample.broadcasts:
            self.without("a line to all drives")
        async with desk.session() as opened:
            assert await opened.say(f"@* {written.line}") == []
            read = [await opened.say(f"@{address} {written.read}") for address in self.sample.addresses]
            assert read == [[written.after]] * len(self.sample.addresses)

    @in_virtual_time
    async def test_a_refusal_is_a_failure_in_one_line_and_changes_nothing(self, desk: Desk) -> None:
        async with desk.session() as opened:
            before = await opened.motions(self.sample.addresses[0])
            with pytest.raises(Refused):
                await opened.run(self.sample.refused.line)
            said = await opened.refusal(self.sample.refused.line)
            assert self.said(self.sample.refused.said, said), said
            assert await opened.say(self.sample.reads.line) == [self.sample.reads.printed]
            assert await opened.motions(self.sample.addresses[0]) == before

    @in_virtual_time
    async def test_a_line_that_is_wrong_in_the_language_is_not_sent(self, desk: Desk) -> None:
        async with desk.session() as opened:
            if (wrong := self.sample.unsent) is not None:
                said = await opened.refusal(wrong.line)
                assert self.said(wrong.said, said) and opened.written == b"", said
                with pytest.raises(Inexpressible):
                    await opened.run(wrong.line)
            for line in (self.sample.reads.line, self.sample.moves.line, *self.sample.harmless):
                opened.drive.check_line(line)

    @pytest.mark.parametrize("beside", [False, True], ids=["before the next line", "while the next line is out"])
    @in_virtual_time
    async def test_a_late_reply_is_not_taken_for_the_reply_to_the_next_line(self, desk: Desk, beside: bool) -> None:
        reads, other = self.sample.reads, self.sample.reads_other
        async with desk.session() as opened:
            opened.wire.hold()
            with pytest.raises(NoAnswer) as failure:
                await opened.run(reads.line)
            assert "\n" not in str(failure.value)
            if not beside:
                opened.wire.release()
            asking = asyncio.ensure_future(opened.say(other.line))
            await asyncio.sleep(TIMEOUT / 5)
            opened.wire.release()
            assert await asking == [other.printed]
            assert await opened.say(reads.line) == [reads.printed]

    @in_virtual_time
    async def test_a_move_whose_reply_is_lost_is_sent_once_and_its_fate_is_reported(self, desk: Desk) -> None:
        moves = self.sample.moves
        async with desk.session() as opened:
            await opened.say(*self.sample.setup)
            sent = list[str]()

            def losing() -> Procedure[object]:
                procedure = opened.drive.family.perform(moves.line)
                request = next(procedure)
                while True:
                    sent.append(request.text)
                    opened.wire.lossy |= request.text == moves.line
                    reply = yield request
                    try:
                        request = procedure.send(reply)
                    except StopIteration:
                        return None

            with pytest.raises(DriveError) as failure:
                await opened.drive.run(losing())
            assert sent.count(moves.line) == 1, sent
            said = str(failure.value)
            assert f"'{moves.line}'" in said and re.search("not known|sent once|no reply", said), said
            opened.wire.lossy = False
            await asyncio.sleep(20.0)
            assert (await opened.motions(self.sample.addresses[0]))[0].position == moves.place

    @in_virtual_time
    async def test_a_line_that_was_lost_comes_back_with_its_drives(self, desk: Desk) -> None:
        reads = self.sample.reads
        async with desk.session() as opened:
            await opened.say(*self.sample.setup, self.sample.moves.line, "/wait stopped")
            desk.floor.command(f"/sim unplug {LINE}")
            with pytest.raises(TransportLost) as failure:
                await opened.run(self.sample.moves.line)
            assert "\n" not in str(failure.value)
            await asyncio.sleep(5.0)
            desk.floor.command(f"/sim plug {LINE}")
            await asyncio.sleep(60.0)
            assert [*opened.bus.drives] == [*self.sample.addresses]
            (place, *_) = await opened.motions(self.sample.addresses[0])
            assert (place.position, place.velocity) == (self.sample.moves.place, 0)
            assert len(await opened.say(reads.line)) == 1

    @in_virtual_time
    async def test_a_drive_that_is_silent_once_the_line_is_back_is_named_and_kept(self, desk: Desk) -> None:
        if len(self.sample.addresses) < 2:
            self.without("several drives on a line")
        silent = self.sample.addresses[-1]
        async with desk.session() as opened:
            desk.floor.command(f"/sim unplug {LINE}")
            await asyncio.sleep(5.0)
            desk.silence(silent)
            opened.events.clear()
            desk.floor.command(f"/sim plug {LINE}")
            await asyncio.sleep(60.0)
            assert [*opened.bus.drives] == [*self.sample.addresses]
            assert any(re.fullmatch(f"{LINE}: .*{silent} does not reply", text) for text in opened.told()), (
                opened.told()
            )

    @in_virtual_time
    async def test_a_guarded_line_waits_for_a_yes(self, desk: Desk) -> None:
        async with desk.session(agreed=False) as opened:
            if (line := self.sample.guarded) is not None:
                said = await opened.refusal(line)
                assert said.endswith("nothing was sent; --yes agrees to it") and opened.written == b"", said
                guard = opened.drive.family.guard(line)
                assert guard is not None and guard.name in FAMILIES[self.sample.family].guards
                opened.session.questions.agreed = True
                await opened.say(line)
            assert opened.drive.family.guard(self.sample.reads.line) is None

    @in_virtual_time
    async def test_help_and_completion_are_in_its_words(self, desk: Desk) -> None:
        async with desk.session() as opened:
            if (help_ := self.sample.help) is not None:
                assert (await opened.say(f"/help {help_.line}"))[0] == help_.printed
            said = await opened.refusal("/help QQQQQQ")
            assert said.startswith("/help: no verb or command QQQQQQ")
            if (completes := self.sample.completes) is not None:
                offered = [each.text for each in complete(opened.session, completes.line)]
                assert completes.printed in offered
                if len(self.sample.addresses) > 1:
                    other = f"@{self.sample.addresses[1]} {completes.line}"
                    assert completes.printed in [each.text for each in complete(opened.session, other)]

    def test_sent_lines_end_with_an_exit_code_and_one_line_of_reason(self, desk: Desk) -> None:
        sample = self.sample
        reads, other, refused = map(sample.to_first, (sample.reads.line, sample.reads_other.line, sample.refused.line))
        done = desk.command("send", desk.url, reads, other)
        assert done == (0, f"{sample.reads.printed}\n{sample.reads_other.printed}\n", ""), done
        done = desk.command("send", desk.url, refused, reads)
        assert (done.code, done.out, done.err.count("\n")) == (1, "", 1), done
        assert self.said(sample.refused.said, done.err.strip()), done.err
        if sample.unsent is not None:
            done = desk.command("send", desk.url, reads, sample.to_first(sample.unsent.line))
            assert (done.code, done.err.count("\n")) == (1, 1), done
        if len(sample.addresses) > 1:
            line = f"@{sample.absent.address} {sample.reads.line}"
            assert desk.command("send", desk.url, line)[0] == 1

    def test_sent_lines_are_objects_with_json(self, desk: Desk) -> None:
        sample = self.sample
        lines = [*map(sample.to_first, (sample.reads.line, sample.refused.line))]
        done = desk.command("send", desk.url, *lines, "--json")
        read, refused, last = map(json.loads, done.out.splitlines())
        assert done.code == 1 and last["summary"]["failed"] == 1
        assert (read["sent"], read["printed"], read["ok"]) == (lines[0], [sample.reads.printed], True)
        assert (refused["sent"], refused["ok"]) == (lines[1], False)
