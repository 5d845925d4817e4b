"""A refused target of `publish` does not quote its password."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.features.publishing.broker import parse_target

SECRET = "xyzzy"


@given(st.text(alphabet="abz/@:?#&=%\\ '\"[]{},", max_size=12), st.text(alphabet="abz/@:?#&=% ", max_size=12))
def test_no_refusal_of_a_broker_quotes_its_password(before: str, after: str) -> None:
    password = f"{before}{SECRET}{after}"
    for scheme in ("mqtt", "mqtts", "ftp"):
        url = f"{scheme}://me:{password}@10.0.0.5:503/proxy"
        with pytest.raises(Diagnostic) as refused:
            parse_target(url)
        assert SECRET not in str(refused.value), url
