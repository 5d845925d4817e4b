"""All that a search and a rescue say and ask, in their order, and the rates at which they open the port."""

import json
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, NoAnswer
from multidrop.shell.connect.urls import parse
from multidrop.shell.finding.rescuing import Rescue
from multidrop.shell.finding.scanning import NothingFound, Scanning
from tests.support.cell_session import bus, drive, party, pmx
from tests.support.tuned_ports import Port

pytestmark = pytest.mark.virtual

TOLD = json.loads((Path(__file__).parent / "told.json").read_text(encoding="utf-8"))
SILENT = bus("b", party("a"), baud=57600)
AT_19200 = bus("b", party("a"), baud=19200)
CASES = {
    "search: nothing replies": (SILENT, "/dev/ttyUSB9", "search", [], "yes"),
    "search: a no": (SILENT, "/dev/ttyUSB9", "search", [], "no"),
    "search: nobody can be asked": (SILENT, "/dev/ttyUSB9", "search", [], "nobody"),
    "search: one language": (SILENT, "/dev/ttyUSB9?dialect=pmx", "search", [], "yes"),
    "search: two rates": (SILENT, "/dev/ttyUSB9?dialect=mcode", "search", [9600, 19200], "yes"),
    "search: drives at the first rate": (bus("b", party("a"), party("b")), "/dev/ttyUSB9", "search", [], "no"),
    "search: drives at another rate": (bus("b", party("a"), baud=19200), "/dev/ttyUSB9", "search", [], "yes"),
    "search: everything": (bus("b", party("a")), "/dev/ttyUSB9?dialect=mcode", "everything", [9600, 19200], "yes"),
    "search: everything, a no": (bus("b", party("a")), "/dev/ttyUSB9?dialect=mcode", "everything", [9600, 19200], "no"),
    "search: a controller": (bus("b", pmx("42"), baud=9600), "/dev/ttyUSB9?dialect=pmx", "search", [9600], "no"),
    "rescue: nothing replies": (SILENT, "/dev/ttyUSB9?dialect=mcode", "rescue", [9600, 19200], "yes"),
    "rescue: agreed": (SILENT, "/dev/ttyUSB9?dialect=mcode", "rescue", [9600], "agreed"),
    "rescue: agreed to erase": (SILENT, "/dev/ttyUSB9?dialect=mcode", "erase", [9600, 19200], "agreed"),
    "rescue: a no": (SILENT, "/dev/ttyUSB9?dialect=mcode", "rescue", [9600], "no"),
    "rescue: nobody can be asked": (SILENT, "/dev/ttyUSB9?dialect=mcode", "rescue", [9600], "nobody"),
    "rescue: a drive that replies": (bus("b", party("a")), "/dev/ttyUSB9?dialect=mcode", "rescue", [9600], "no"),
    "rescue: at another rate": (AT_19200, "/dev/ttyUSB9?dialect=mcode", "rescue", [9600, 19200], "yes"),
    "rescue: a module": (bus("b", drive("TMCM")), "/dev/ttyUSB9?dialect=tmcl", "rescue", [9600], "yes"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
async def test_everything_that_is_said_asked_and_opened(tmp_path, name):
    cell, url, what, bauds, person = CASES[name]
    port, questions, found = Port(tmp_path, cell), [], []

    async def ask(question):
        questions.append(question)
        return person == "yes"

    port.session.questions.agreed = person == "agreed"
    if person in ("yes", "no"):
        port.session.front.ask = ask
    search = Scanning(port.session, port.opener, parse(url), lambda each: found.append(each.facts()["address"]))
    ended = ""
    try:
        if what in ("rescue", "erase"):
            await Rescue(port.session, search).run(bauds, everything=False, erase=what == "erase")
        else:
            await search.run(bauds, what == "everything")
    except (Diagnostic, NoAnswer, NothingFound) as error:
        ended = f"{type(error).__name__}: {error}"
    assert {
        "said": port.told(),
        "asked": questions,
        "opened": " ".join(f"{language}:{baud}" for language, baud in port.opened),
        "found": found,
        "ended": ended,
    } == TOLD[name]
