"""Programs of others that tests start: where one is absent, a test is skipped; where all are promised, it fails."""

from __future__ import annotations

import os
import shutil
from typing import NoReturn

import pytest

PATH = f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin"
PROMISED = "MULTIDROP_ALL_TOOLS"
"""A variable of the environment: this machine has all tools. `.ci/run` installs them and sets it."""


def tool(name: str) -> str:
    """Return the path of a program. Without it, the test is skipped, or fails."""
    return shutil.which(name, path=PATH) or absent(f"{name} is not installed")


def absent(why: str) -> NoReturn:
    """Skip a test for want of a tool; fail where all are promised."""
    if os.environ.get(PROMISED):
        pytest.fail(f"{why}, and {PROMISED} promises it", pytrace=False)
    pytest.skip(why)
