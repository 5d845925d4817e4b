"""`multidrop run` as a process: a script from standard input, roles, and both reports."""

import json
from xml.etree import ElementTree

import pytest

pytestmark = pytest.mark.process

SCRIPT = """@gantry:a PR "at ",P
/expect "at {x}"
/assert @gantry:a P == {x}
/assert @gantry:a P == {x} + 1
"""


def test_a_script_from_standard_input_reports_its_checks(home, tmp_path):
    words = ("run", "-", "--role", "gantry=sim:#press", "--set", "x=0", "--json", "--junit", "report.xml")
    done = home.process(*words, stdin=SCRIPT)
    assert done.returncode == 1
    facts = [json.loads(line) for line in done.stdout.splitlines()]
    assert [each["ok"] for each in facts[:-1]] == [True, True, True, False]
    assert facts[0] | {"time": ""} == {
        **{"file": "-", "line": 1, "sent": '@gantry:a PR "at ",P', "printed": ["at 0"], "ok": True},
        **{"bus": "gantry", "drive": "a", "time": ""},
    }
    assert (facts[-1]["summary"]["lines"], facts[-1]["summary"]["failed"]) == (4, 1)
    said = "/assert @gantry:a P == 0 + 1: wanted == 1, seen 0"
    assert done.stderr == f"-:4: {said}\n"
    (suite,) = ElementTree.parse(tmp_path / "report.xml").getroot()
    assert (suite.attrib["tests"], suite.attrib["failures"], suite.attrib["errors"]) == ("3", "1", "0")
    assert suite.find("testcase/failure").attrib["message"] == said
