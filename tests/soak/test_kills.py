"""A sample of `make soak`: processes that are killed at random moments, and what the next one finds."""

import os

import pytest

from soak import kills

pytestmark = [pytest.mark.process, pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")]


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_after_a_kill_files_are_whole(tmp_path):
    figures, failures = kills.in_files(6, tmp_path)
    assert failures == [] and figures["log lines"] > 10


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_after_a_kill_in_a_download_the_next_session_restores_the_drive(tmp_path):
    figures, failures = kills.in_downloads(2, tmp_path)
    assert failures == [] and figures["kills in downloads"] == 2


def test_a_log_that_is_not_whole_is_seen(tmp_path):
    whole = '{"time": "2026-11-22T12:05:53.196208+00:00", "kind": "log", "text": "session of process 1", "format": 1}'
    (tmp_path / "session.log").write_text(f"{whole}\nrubbish\nlast")
    assert kills.wrong_files(tmp_path) == ["log: b'rubbish'"]
