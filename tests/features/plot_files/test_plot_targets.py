"""Any text is a target of a plot, or is refused in a line that has no password."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.features.plot_files.request import parse_target

SECRET = "xyzzy"


@pytest.mark.slow
@given(st.text(max_size=40))
def test_any_text_is_a_target_of_a_plot_or_none(text: str) -> None:
    for to, serve in ((text, None), (None, text), (f"rerun+http://{text}/proxy", None), (f"{text}.rrd", None)):
        try:
            parse_target(to, serve)
        except Diagnostic as problem:
            assert str(problem)


@given(st.text(alphabet="abz/@:?#&=%\\ '\"[]{},", max_size=12), st.text(alphabet="abz/@:?#&=% ", max_size=12))
def test_no_refusal_of_a_viewer_quotes_its_password(before: str, after: str) -> None:
    password = f"{before}{SECRET}{after}"
    for scheme in ("rerun+http", "http"):
        url = f"{scheme}://me:{password}@10.0.0.5:503/proxy"
        with pytest.raises(Diagnostic) as refused:
            parse_target(url, None)
        assert SECRET not in str(refused.value), url


@pytest.mark.parametrize(
    ("to", "serve", "about"),
    [
        ("run.rrd", None, "rerun: plotting to run.rrd"),
        ("run.csv", None, "table: plotting to run.csv"),
        ("rerun+http://desk:9876/proxy", None, "rerun: plotting to rerun+http://desk:9876/proxy"),
        (None, "9877", "rerun: plotting to rerun+http://127.0.0.1:9877/proxy"),
    ],
)
def test_a_target_says_what_takes_the_samples(to: str | None, serve: str | None, about: str) -> None:
    assert parse_target(to, serve).about == about
