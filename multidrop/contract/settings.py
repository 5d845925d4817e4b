"""Settings, units, values, programs and snapshots: what each family promises of them, or says that it lacks."""

from __future__ import annotations

import asyncio
import csv

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.base.registry import with_word
from multidrop.contract.desk import LINE, Desk, Opened, in_virtual_time
from multidrop.contract.motion import Motions
from multidrop.dialects.values import Value
from multidrop.drives import telemetry
from multidrop.drives.events import Valued
from multidrop.shell.events import OnBus
from multidrop.shell.plots.series import parse_series
from multidrop.shell.roles import Series


def there(word: str) -> bool:
    """Whether multidrop has the feature that answers to a word."""
    try:
        return with_word(word) is not None
    except Diagnostic:
        return False


class Settings(Motions):
    """What is read of a drive and kept of it."""

    async def lacks(self, opened: Opened, line: str, said: str) -> None:
        """A line for what the family does not have: one line that says so, and nothing is sent."""
        text = await opened.refusal(line)
        assert text.startswith(self.named(said)) and opened.written == b"", text

    def named(self, said: str) -> str:
        """What is said, with the name of the first drive."""
        return said.replace("{}", self.sample.name)

    @in_virtual_time
    async def test_its_state_is_said_in_words(self, desk: Desk) -> None:
        async with desk.session() as opened:
            if self.sample.state is None:
                await self.lacks(opened, "/status", "{}: drives of this family do not report their state")
            else:
                assert (await opened.say("/status"))[0] == self.sample.state

    @in_virtual_time
    async def test_settings_are_kept_compared_and_restored(self, desk: Desk) -> None:
        setting, file = self.sample.setting, desk.folder / "kept.toml"
        async with desk.session() as opened:
            if setting is None:
                no_settings = "{}: no settings of such drives are known; nothing was sent"
                await self.lacks(opened, f"/params backup {file}", no_settings)
                assert not file.exists()
                return
            assert await opened.say(f"/params backup {file}") == []
            assert setting.name in file.read_text()
            assert await opened.say(f"/params diff {file}") == []
            assert f"{self.sample.name}: nothing differs" in opened.told()
            await opened.say(setting.line)
            assert await opened.say(f"/params diff {file}") == [setting.differs]
            if setting.defaults:
                assert setting.differs in await opened.say("/params diff --defaults")
            else:
                said = await opened.refusal("/params diff --defaults")
                assert said == f"{self.sample.name}: the defaults of its settings are not known; compare with a file"
            opened.session.questions.agreed = False
            said = await opened.refusal(f"/params restore {file}")
            assert "will be written" in said and said.endswith("nothing was sent; --yes agrees to it"), said
            opened.session.questions.agreed = True
            assert await opened.say(f"/params restore {file}") == [f"{self.sample.name}: {setting.restored}"]
            assert any("1 setting restored and read back" in text for text in opened.told())
            assert not any("home before a move" in text for text in opened.told())
            assert await opened.say(f"/params diff {file}") == []

    @in_virtual_time
    async def test_a_twin_follows_it_or_it_is_said_that_none_can(self, desk: Desk) -> None:
        if not there("/twin"):
            pytest.skip("the feature was deleted")
        async with desk.session() as opened:
            twin = " ".join(f"/twin on {desk.names[0]}".split())
            if self.sample.setting is None:
                await self.lacks(opened, twin, "{}: no settings of such drives are known; nothing was sent")
            else:
                await opened.say(twin)
                await opened.say("/twin off")

    @in_virtual_time
    async def test_settings_are_saved_or_it_is_said_that_none_can_be(self, desk: Desk) -> None:
        saves = self.sample.setting.saves if self.sample.setting is not None else None
        async with desk.session() as opened:
            if saves is None:
                await self.lacks(opened, "/params save", "{}: such drives keep no settings, as far as is known")
            else:
                await opened.say("/params save")
                assert saves in opened.written and opened.told() == [f"{self.sample.name}: its settings are saved"]

    @in_virtual_time
    async def test_a_scale_counts_in_both_directions(self, desk: Desk) -> None:
        scaled, axis = self.sample.scaled, self.sample.measured
        async with desk.session() as opened:
            if self.sample.turn is not None:
                said = await opened.refusal(" ".join(f"/units {axis} 5 mm/turn".split()))
                assert said.startswith(f"/units: the scale 5 mm/turn is by the motor's turn: {self.sample.turn}; "), (
                    said
                )
            if scaled is None:
                return
            printed = await opened.say(" ".join(f"/units {axis} {scaled.scale}".split()))
            assert printed == [f"{axis or self.sample.name}: {scaled.said}"]
            await opened.say(*self.sample.setup, scaled.line, "/wait stopped")
            assert (await self.places(opened))[0] == (scaled.place, 0)

    @in_virtual_time
    async def test_a_word_is_read_for_plots_and_no_other(self, desk: Desk) -> None:
        async with desk.session() as opened:
            values = opened.drive.family.values
            if (word := self.sample.word) is not None:
                found = await opened.drive.run(values.first(values.check(word.line)))
                assert found == float(word.printed)
                assert parse_series(opened.session, [word.line]) == (Series(LINE, desk.names[0], word.line),)
                reading = opened.bus.telemetry.read([telemetry.DriveValue(desk.names[0], word.line)], 0.1)
                await asyncio.sleep(2.0)
                reading.close()
                events = [event.event for event in opened.events if isinstance(event, OnBus)]
                read = [event.value for event in events if isinstance(event, Valued)]
                assert len(read) > 10 and {*read} == {float(word.printed)}
            with pytest.raises(Exception, match="QQQQQQ") as failure:
                await opened.drive.run(values.first(values.check("QQQQQQ")))
            assert "\n" not in str(failure.value)

    def test_a_word_is_polled_by_a_command(self, desk: Desk) -> None:
        if (word := self.sample.word) is None:
            self.without("a value to poll")
        done = desk.command(
            "poll", desk.url, word.line, "--drive", desk.names[0] or "all", "--every", "1", "--rows", "1"
        )
        head, row = done.out.splitlines()
        named = f"{desk.names[0] or LINE}.{word.line}"
        assert (done.code, head.split(), row.split()[1:]) == (0, ["time", named], [word.printed]), done

    @in_virtual_time
    async def test_its_conditions_are_read_in_parts_and_move_nothing(self, desk: Desk) -> None:
        async with desk.session() as opened:
            values, facts = opened.drive.family.values, dict[str, Value]()
            before = await self.places(opened)
            asked = set[str]()
            while left := [each for each in values.parts(facts) if each.name not in asked]:
                asked.add(left[0].name)
                facts |= await opened.drive.run(left[0].read())
            assert len(values.fold(facts)) <= max(1, len(await opened.motions(desk.names[0])))
            assert await self.places(opened) == before

    @in_virtual_time
    async def test_registers_are_read_or_it_is_said_that_there_are_none(self, desk: Desk) -> None:
        async with desk.session() as opened:
            if self.sample.registers:
                assert (await opened.say("/register 5"))[0].startswith("0x0005 = ")
            else:
                for line in ("/register 5", "/coil 1", "/device"):
                    await self.lacks(opened, line, f"{{}}: no registers; {line.split()[0]} is valid on ")

    @in_virtual_time
    async def test_a_snapshot_is_the_same_drive_in_the_simulator(self, desk: Desk) -> None:
        file, setting = desk.folder / "s.toml", self.sample.setting
        async with desk.session() as opened:
            if not self.sample.snapshot or setting is None:
                no_settings = "{}: no settings of such drives are known; nothing was sent"
                assert (await opened.refusal(f"/snapshot {file}")).startswith(self.named(no_settings))
                return
            await opened.say(*self.sample.setup, setting.line, self.sample.moves.line, "/wait stopped")
            place = (await self.places(opened))[0]
            await opened.say(f"/snapshot {file}")
            await opened.say(f"/params backup {desk.folder / 'kept.toml'}")
        async with desk.again(cell=file.read_text()).session() as opened:
            assert (await self.places(opened))[0] == place
            assert await opened.say(f"/params diff {desk.folder / 'kept.toml'}") == []

    def test_a_plot_in_a_file_has_a_row_for_each_value(self, desk: Desk) -> None:
        if not there("plot"):
            pytest.skip("the feature was deleted")
        word, file = self.sample.word, desk.folder / "x.csv"

        async def plotted() -> None:
            async with desk.session() as opened:
                if word is None:
                    await self.lacks(
                        opened, f"/plot SPEED --to {file}", "{}: no value SPEED; valid: position, velocity"
                    )
                    return
                await opened.say(f"/plot {word.line} --to {file}")
                await asyncio.sleep(0.4)
                await opened.say("/plot off")

        desk.really(plotted)
        if word is None:
            assert not file.exists()
            return
        with file.open(newline="") as rows:
            found = list(csv.DictReader(rows))
        assert {"time", "elapsed", "bus", "drive", "axis", "name", "value", "unit", "text"} <= {*found[0]}
        own = [row for row in found if row["name"] == word.line]
        assert own and {(row["bus"], row["drive"]) for row in own} == {(LINE, desk.names[0])}
        assert {float(row["value"]) for row in own} == {float(word.printed)}


class Programs(Settings):
    """Programs in a drive, or what is said where there are none."""

    @in_virtual_time
    async def test_a_program_is_downloaded_listed_run_and_ended(self, desk: Desk) -> None:
        program = self.sample.program
        if program is None:
            self.without("programs")
        file = desk.folder / program.file
        file.write_text(program.text)
        async with desk.session() as opened:
            await opened.say(*self.sample.setup)
            before = (await self.places(opened))[0]
            await opened.say(f"/download {file}")
            assert any(
                text.startswith(f"{self.sample.name}: verified, {program.stored} line") for text in opened.told()
            )
            assert (await self.places(opened))[0] == before, "a download moves nothing"
            assert program.listed in await opened.say("/list")
            await opened.say(f"/download {file} --run {program.label}")
            assert f"{self.sample.name}: started ({program.started})" in opened.told(), opened.told()
            await asyncio.sleep(1.0)
            drive = opened.drive
            assert await drive.run(drive.family.busy())
            opened.begin()
            opened.session.stop()
            await opened.bus.stopped()
            await asyncio.sleep(3.0)
            assert any("stopped, velocity 0" in text for text in opened.told())
            assert not await drive.run(drive.family.busy())
            stood = await self.places(opened)
            await asyncio.sleep(5.0)
            assert await self.places(opened) == stood
            await opened.say(f"/upload {desk.folder / ('back-' + program.file)}")
            assert (desk.folder / f"back-{program.file}").read_text() == program.text
            opened.begin()
            await opened.say(f"/download {desk.folder / ('back-' + program.file)} --only-changed")
            assert any("already; nothing was sent" in text for text in opened.told()), opened.told()

    def test_a_program_file_is_checked_and_run_without_a_drive(self, desk: Desk) -> None:
        if (program := self.sample.program) is None:
            self.without("programs")
        (desk.folder / program.file).write_text(program.text)
        done = desk.command("program", "check", program.file)
        assert (done.code, done.err) == (0, "") and done.out.startswith(f"{program.file}: nothing wrong, "), done
        done = desk.command("program", "test", program.file, "--until", "2", "--json")
        assert done.code == 0 and '"ended": "until"' in done.out, done
        (desk.folder / program.file).write_text(program.wrong)
        done = desk.command("program", "check", program.file)
        assert done.code == 1 and self.said(f"{program.file}:{program.fault}", done.err.splitlines()[0]), done

    @in_virtual_time
    async def test_what_it_has_no_programs_for_is_one_line_and_sends_nothing(self, desk: Desk) -> None:
        async with desk.session() as opened:
            if self.sample.program is None:
                (desk.folder / "a.mxt").write_text("PG 1\nE\nPG\n")
                for line in ("/list", f"/download {desk.folder / 'a.mxt'}"):
                    await self.lacks(opened, line, f"{{}}: {self.sample.no_programs}")
                assert not await opened.drive.run(opened.drive.family.busy()) or self.sample.state is not None
            if not self.sample.traced:
                await self.lacks(opened, "/trace G1", "{}: programs of its family cannot be observed")
