"""What of the tests is left out under Windows (`make windows`), and why, read from the tests alone."""

import ast
import re

from tests.support.marks import left_out_whole
from tests.support.paths import ROOMS, ROOT, sources
from tests.support.posix import MODULES


def imported(text):
    """Yield the modules that a file imports from its top, where no platform is asked about."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (str(node.module), *(f"{node.module}.{each.name}" for each in node.names))


def test_a_file_that_windows_cannot_import_is_left_out_by_its_mark():
    texts = {name[:-3].replace("/", "."): path.read_text(encoding="utf-8") for name, path in sources("tests")}
    product = {
        "multidrop." + name[:-3].replace("/", ".").removeprefix("multidrop.").removesuffix(".__init__"): path
        for name, path in sources(*ROOMS)
    }
    only_posix = {
        name for name, path in product.items() if '\nassert sys.platform != "win32"' in path.read_text(encoding="utf-8")
    }
    assert "multidrop.transports.relay" in only_posix
    uses, lost = {name: set(imported(text)) for name, text in texts.items()}, only_posix | set(MODULES)
    for _ in range(3):  # support imports support
        lost |= {name for name, modules in uses.items() if modules & lost}
    wrong = {name for name in lost & set(texts) if name.rpartition(".")[2].startswith("test_")}
    left = {name for name in wrong if left_out_whole(ROOT / f"{name.replace('.', '/')}.py")}
    assert wrong - left == set()


def test_what_a_platform_has_not_is_a_mark_and_no_condition():
    asked = re.compile(r'skipif\([^)]*(?:== "win32"|os\.name)')
    assert [name for name, path in sources("tests") if asked.search(path.read_text(encoding="utf-8"))] == [
        "tests/shell/programs/test_edited_file.py"  # which asks for the user, too
    ]


def test_the_number_of_tests_that_pass_there_is_kept():
    assert int((ROOT / "tests" / "windows" / "passed").read_text()) > 1000
