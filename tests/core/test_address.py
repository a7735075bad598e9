"""HOST:PORT, read and written."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.core.address import Address

NAMES = st.text("abcxyz019.-", min_size=1, max_size=30)
LITERALS = st.ip_addresses(v=6).map(str) | st.just("fe80::1%eth0")


@given(NAMES | LITERALS, st.integers(0, 65535))
def test_what_is_written_is_read(host: str, port: int) -> None:
    text = str(Address(host, port))
    assert Address.parse(text) == (host, port)
    assert text.startswith("[") == (":" in host)


@pytest.mark.parametrize(
    "text",
    ["", "here", ":9000", "here:", "here:-1", "here:65536", "here:000001", "here:٣", "::1:9000", "[::1]", "[]:9000",
     "[::1:9000", "::1]:9000", "[[::1]]:9000", "a b:9000", "a/b:9000", "here:9000\n", "osc://here:9000"],
)  # fmt: skip
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="HOST:PORT"):
        Address.parse(text)
