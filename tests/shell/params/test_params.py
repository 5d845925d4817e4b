"""Settings between drives and files in a session: backup, comparison, restore, and what comes in between."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, DriveError, NoAnswer, Refused, Stopped, TransportLost
from multidrop.drives.events import Traffic
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Notified, OnBus, Output
from multidrop.shell.params import file as files
from multidrop.shell.params.file import read
from multidrop.shell.session import Session

pytestmark = pytest.mark.virtual

CELL = """
[[bus]]
name = "press"
baud = 115200
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
set = { EM = 1, CK = 1 }
[[bus.drive]]
personality = "LMDCM"
name = "b"
party = true
set = { EM = 1, CK = 1, VM = 512000 }
program_text = "PG 1\\nLB G1\\nH 1000\\nBR G1\\nE\\nPG\\n"
"""


async def opened(tmp_path, text):
    (tmp_path / "cell.toml").write_text(text)
    made = Session(Settings({}, tmp_path / "config", tmp_path / "state", data=tmp_path / "data"))
    made.questions.agreed, made.events = True, []
    made.subscribe(made.events.append)
    await made.open(f"sim:{tmp_path / 'cell.toml'}")
    return made


@pytest.fixture
async def session(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = await opened(tmp_path, CELL)
    yield made
    await made.close()


async def say(session, *lines):
    """What verbs put out."""
    session.events.clear()
    for line in lines:
        await session.run(line)
    return [event.text for event in session.events if isinstance(event, Output)]


def told(session):
    return [event.text for event in session.events if isinstance(event, Notified)]


def written(session):
    traffic = [each.event for each in session.events if isinstance(each, OnBus)]
    return b"".join(each.data for each in traffic if isinstance(each, Traffic) and each.outgoing)


def device(session, name="b"):
    drives = next(iter(session.cells.values())).floor.drives
    return next(placed.device for placed in drives if placed.spec.name == name)


async def test_two_backups_of_a_drive_are_equal_and_show_units_and_defaults(session, tmp_path):
    await say(session, "/params backup one.toml b", "/params backup two.toml b")
    text = (tmp_path / "one.toml").read_text()
    assert text == (tmp_path / "two.toml").read_text()
    assert "VM = 512000 # steps/s, default 768000" in text and "IS1 = [0, 0]" in text and '[unread]\nOE = "' in text
    loaded = files.load(tmp_path / "one.toml")
    assert (loaded.product, loaded.named["VM"], loaded.section["IS1"]) == ("LMDCM", 512000, "io")


async def test_a_backup_replaces_no_file(session, tmp_path):
    (tmp_path / "kept.toml").write_text("mine")
    with pytest.raises(Diagnostic, match="exists already"):
        await say(session, "/params backup kept.toml")
    assert (tmp_path / "kept.toml").read_text() == "mine" and written(session) == b""


async def test_all_drives_go_into_a_folder(session, tmp_path):
    await say(session, "/params backup kept all")
    assert sorted(path.name for path in (tmp_path / "kept").iterdir()) == ["a.toml", "b.toml"]
    assert await say(session, "/params diff kept all") == []
    assert [line[:5] for line in await say(session, "/params diff --defaults *") if "VM" in line] == ["b: VM"]


async def test_a_silent_drive_is_said_and_the_others_are_done(session, tmp_path):
    session.cells["press"].command("/sim power a off")
    with pytest.raises(DriveError, match="1 of 2 drives failed: a; the others are done"):
        await say(session, "/params backup kept all")
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["b.toml"]
    assert any(text.startswith("a ") for text in told(session))


async def test_a_restore_sends_what_differs_and_reads_it_back(session):
    await say(session, "/params backup kept.toml b", "@b VM=9000", "@b IS=1,1,0", "@b VA Q1=3")
    assert await say(session, "/params diff kept.toml b") == [
        "VM: here 9000, there 512000 steps/s",
        "IS1: here [1, 0], there [0, 0]",
        "Q1: here 3, there none",
    ]
    assert await say(session, "/params restore kept.toml b") == ["b: VM=512000 (was 9000)", "b: IS=1,0,0 (was [1, 0])"]
    assert any("2 settings restored and read back; not saved, so lost" in text for text in told(session))
    assert device(session).memory.values["VM"] == 512000
    await say(session, "/params restore kept.toml b")
    assert told(session)[-1] == "b: nothing differs from kept.toml"


async def test_save_keeps_it_over_a_reset(session):
    await say(session, "/params backup kept.toml b", "@b VM=9000", "@b S", "/params restore kept.toml b --save")
    one = device(session)
    one.reset(one.now)
    assert one.memory.values["VM"] == 512000


async def test_a_dry_run_sends_no_step(session):
    await say(session, "/params backup kept.toml b", "@b VM=9000")
    assert await say(session, "/params restore kept.toml b --dry-run") == ["b: VM=512000 (was 9000)"]
    assert b"VM=512000" not in written(session) and device(session).memory.values["VM"] == 9000


async def test_what_moves_the_motor_waits_for_its_name(session):
    await say(session, "/params backup kept.toml b", "@b DE=0", "/params restore kept.toml b")
    assert device(session).memory.values["DE"] == 0
    assert any("DE is left alone" in text and "--with DE" in text for text in told(session))
    assert await say(session, "/params restore kept.toml b --with de") == ["b: DE=1 (was 0)"]


async def test_without_a_yes_nothing_is_sent(session):
    await say(session, "/params backup kept.toml b", "@b VM=9000")
    session.questions.agreed = False
    with pytest.raises(Diagnostic, match="1 setting of kept.toml will be written: VM; nothing was sent; --yes"):
        await say(session, "/params restore kept.toml b")
    assert device(session).memory.values["VM"] == 9000


async def test_a_change_while_the_question_is_open_is_seen(session):
    await say(session, "/params backup kept.toml b", "@b VM=9000")
    session.questions.agreed = False

    async def answer(question):
        device(session).execute("RC=77", device(session).now)
        return True

    session.front.ask = answer
    with pytest.raises(Refused, match="its settings changed meanwhile"):
        await say(session, "/params restore kept.toml b")
    assert device(session).memory.values["VM"] == 9000


@pytest.mark.parametrize(("line", "said"), [("@b SL 1000", "b moves"), ("@b EX G1", "b runs a program")])
async def test_a_drive_at_work_is_refused(session, line, said):
    await say(session, "/params backup kept.toml b", "@b VM=9000", line)
    await asyncio.sleep(0.5)
    with pytest.raises(Refused, match=said):
        await say(session, "/params restore kept.toml b")
    assert device(session).memory.values["VM"] == 9000


async def test_program_mode_is_refused(session):
    await say(session, "/params backup kept.toml b", "@b PG 500")
    with pytest.raises(Refused, match="program mode"):
        await say(session, "/params restore kept.toml b")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[parameters]\nVN = 5\n", r"kept.toml: \[parameters\] VN: b has no such setting; did you mean V"),
        ("[parameters]\nVM = 5\nVI = 9\n", "kept.toml: VI = 9 and VM = 5: VI must be below VM"),
        ("[parameters]\nVM = true\n", r"kept.toml: \[parameters\] VM: must be a number, a text"),
        ("[parameters]\nVM = 5\nvm = 6\n", "VM is there twice"),
        ("[params]\nVM = 5\n", r"\[params\] is not known"),
        ("parameters = 5\n", "parameters must be a table"),
        ("VM = ", "not TOML"),
        ("", "has no settings"),
        ('[drive]\nproduct = "LMDOM"\n[parameters]\nVM = 5000\n', "has the settings of an LMDOM, and b is an LMDCM"),
        ('[drive]\nlanguage = "PMX"\n[parameters]\nHSPD = 5\n', "has settings of a drive in PMX, and b has MCode"),
        ("[variables]\nG1 = 5\n", "G1: is a label of the program"),
        ("[parameters]\nVM = 99999999999999999999999\n", "number"),
    ],
)
async def test_a_wrong_file_is_one_line_and_changes_nothing(session, tmp_path, text, said):
    (tmp_path / "kept.toml").write_text(text)
    with pytest.raises(Diagnostic, match=said):
        await say(session, "/params restore kept.toml b")
    assert b"=" not in written(session).replace(b"PR ", b"")


async def test_another_products_file_restores_what_both_have(session, tmp_path):
    (tmp_path / "kept.toml").write_text('[drive]\nproduct = "LMM"\n[parameters]\nVM = 5000\nSA = 1.8\n')
    assert await say(session, "/params restore kept.toml b --other-product") == ["b: VM=5000 (was 512000)"]
    assert any("SA is left alone" in text for text in told(session))


async def test_a_name_of_a_neighbour_is_not_restored(session):
    await say(session, "/params backup kept.toml a")
    with pytest.raises(Diagnostic, match="another drive of the line is named a; nothing was sent"):
        await say(session, "/params restore kept.toml b --communication")


async def test_communication_is_restored_when_told(session, tmp_path):
    (tmp_path / "kept.toml").write_text('[parameters]\nDN = "c"\nEM = 0\nCK = 0\nRC = 50\n')
    sent = await say(session, "/params restore kept.toml b --communication")
    assert [line.split(" ")[1] for line in sent] == ["RC=50", "EM=0", 'DN="c"', "CK=0"]
    one = device(session)
    assert (one.memory.name, one.memory.echo_mode, one.memory.checksum, one.memory.values["RC"]) == ("c", 0, 0, 50)
    assert await say(session, "/params diff kept.toml c") == []


async def test_a_name_after_with_that_the_file_lacks_is_wrong(session, tmp_path):
    (tmp_path / "kept.toml").write_text("[parameters]\nRC = 50\n")
    with pytest.raises(Diagnostic, match="kept.toml: has no setting JX; --with takes names of the file"):
        await say(session, "/params restore kept.toml b --with jx,rc")


async def test_what_a_program_prints_meanwhile_is_not_a_setting(session):
    one = device(session)
    for line in ("PG 500", "LB G2", 'PR "VM = 5"', "H 200", "BR G2", "E", "PG", "EX G2"):
        one.execute(line, one.now)
    await say(session, "/params backup kept.toml b")
    assert files.load("kept.toml").named["VM"] == 512000


async def _at_step(session, wanted):
    """Wait until a step is on the wire."""
    while wanted not in written(session):
        await asyncio.sleep(0.001)


async def _interrupted(session, tmp_path, act):
    """Run a restore of three steps, and act once the first is on the wire; what it raised."""
    (tmp_path / "kept.toml").write_text("[parameters]\nVI = 100\nVM = 5000\nRC = 33\n")
    session.events.clear()
    work = asyncio.ensure_future(session.run("/params restore kept.toml b"))
    await _at_step(session, b"VM=5000")
    act()
    with pytest.raises((Stopped, NoAnswer, TransportLost, asyncio.CancelledError)) as caught:
        await work
    assert any("of 3 steps are done" in text and "restore again" in text for text in told(session))
    assert b"RC=33" not in written(session)
    return caught


async def test_a_stop_ends_a_restore(session, tmp_path):
    assert (await _interrupted(session, tmp_path, session.stop)).type is Stopped


async def test_an_unplugged_line_ends_a_restore(session, tmp_path):
    await _interrupted(session, tmp_path, lambda: session.cells["press"].command("/sim unplug press"))


async def test_power_off_ends_a_restore(session, tmp_path):
    await _interrupted(session, tmp_path, lambda: session.cells["press"].command("/sim power b off"))


@pytest.mark.parametrize("save", ["", " --save"])
@pytest.mark.parametrize(
    ("taken", "says"),
    [("RC=44", "RC is 44, not 33; nothing was saved"), ("RC=9999", "b refused 'RC=33'")],
)
async def test_a_value_that_is_not_what_was_sent_is_a_failure_and_is_not_saved(session, tmp_path, taken, says, save):
    (tmp_path / "kept.toml").write_text("[parameters]\nRC = 33\nVM = 512000\n")
    one, executed = device(session), []
    execute, before = one.execute, one.memory.values["RC"]

    def noisy(text, now):
        executed.append(text)
        return execute(text.replace("RC=33", taken), now)

    one.execute = noisy
    with pytest.raises(DriveError, match=says):
        await say(session, f"/params restore kept.toml b{save}")
    assert "RC=33" in executed and "S" not in executed
    one.reset(one.now)
    assert one.memory.values["RC"] == before


@pytest.mark.parametrize(
    "line",
    [
        "/params",
        "/params keep x",
        "/params diff",
        "/params diff a.toml b c",
        "/params backup",
        "/params restore x --all",
    ],
)
async def test_a_wrong_line_shows_its_usage(session, line):
    with pytest.raises(Diagnostic, match="/params"):
        await say(session, line)
    assert written(session) == b""


async def test_a_comparison_with_the_neighbour_leaves_its_name_out(session):
    assert await say(session, "/params diff --against b a") == ["VM: here 768000, there 512000 steps/s"]


async def test_a_setting_that_could_not_be_read_makes_the_restore_fail_at_its_end(session, monkeypatch):
    await say(session, "/params backup kept.toml b", "@b VM=9000")

    async def damaged(workspace, drive, what):
        found = await read(workspace, drive, what)
        rows = tuple(each for each in found.readings if each.name != "RC")
        return replace(found, readings=rows, unread=(*found.unread, ("RC", "the drive refuses the line")))

    monkeypatch.setattr(files, "read", damaged)
    with pytest.raises(NoAnswer, match="b: RC could not be read and is left alone; restore the file again"):
        await say(session, "/params restore kept.toml b")
    assert device(session).memory.values["VM"] == 512000
