"""A sample of `make soak`: a session with eight lines at work, for minutes of virtual time."""

import sys

import pytest

from soak import long_run
from soak.judge import Ledger
from soak.report import Report


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_memory_descriptors_and_rates_are_flat():
    figures, failures = long_run.in_virtual_time(1 / 100)
    assert failures == []
    assert figures["macros played"] > 0 and len(figures["samples a second"]) == long_run.SLICES


def test_growth_and_drift_are_seen():
    run = long_run.LongRun.__new__(long_run.LongRun)
    run.drift, run.played, run.failed = long_run.DRIFT, 1, []
    run.memory = [n * 10_000_000 for n in range(8)]
    run.descriptors, run.rates = [*range(8)], [8.0] * 4 + [6.0] * 4
    assert [each.split(" ")[0] for each in run._failures()] == ["memory", "descriptors", "rates"]


def test_the_report_counts_and_has_a_verdict(tmp_path):
    ledger = Ledger()
    ledger.words["done"] = 3
    ledger.misdeed("twice", "@a 'MR 5'")
    report = Report("short")
    report.noise({"checksum": {"EM=1": ledger}})
    report.add("kills", {"kills": 4}, [])
    text = report.write(tmp_path)
    assert "3 commands, 3 done, 1 twice" in text and "verdict: 1 failures" in text
    assert (tmp_path / "short.json").exists() and (tmp_path / "short.txt").read_text() == f"{text}\n"
