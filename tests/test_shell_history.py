from shell import history
from shell.history import History


def test_lines_are_kept_between_runs_oldest_first(tmp_path):
    kept = History(tmp_path / "new" / "history")
    for line in ("PR P", "  ", "MR 100", "two\nlines"):
        kept.append(line)
    assert History(kept.path).lines() == ["PR P", "MR 100"]
    assert kept.path.stat().st_mode & 0o777 == 0o600


def test_a_history_that_cannot_be_kept_costs_no_line(tmp_path):
    (tmp_path / "file").write_text("")
    kept = History(tmp_path / "file" / "history")
    kept.append("PR P")
    assert kept.lines() == []


def test_a_long_history_is_cut(tmp_path, monkeypatch):
    monkeypatch.setattr(history, "KEPT", 3)
    kept = History(tmp_path / "history")
    for number in range(7):
        kept.append(f"MR {number}")
    assert kept.lines() == ["MR 4", "MR 5", "MR 6"]
    assert kept.path.read_text().splitlines() == ["MR 4", "MR 5", "MR 6"]
