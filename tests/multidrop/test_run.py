"""`multidrop run` as a process: a script from standard input, roles, and both reports."""

import json
import subprocess
import sys
from xml.etree import ElementTree

import pytest

from tests.support.processes import environment
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

SCRIPT = """@gantry:a PR "at ",P
/expect "at {x}"
/assert @gantry:a P == {x}
/assert @gantry:a P == {x} + 1
"""


def test_a_script_from_standard_input_reports_its_checks(tmp_path):
    command = [sys.executable, "-m", "multidrop", "run", "-", "--role", "gantry=sim:#press"]
    options = ["--set", "x=0", "--json", "--junit", "report.xml"]
    done = subprocess.run(
        [*command, *options],
        input=SCRIPT,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=environment(tmp_path),
        timeout=PATIENCE,
        check=False,
    )
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
