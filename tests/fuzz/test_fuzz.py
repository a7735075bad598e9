"""The targets of the fuzzer on the kept corpus, and on what Hypothesis makes of it. `make fuzz` goes further."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz import targets

KEPT = [(name, path) for name in targets.TARGETS for path in targets.corpus(name)]


@pytest.mark.parametrize(("name", "path"), KEPT, ids=[f"{name}-{path.name}" for name, path in KEPT])
def test_the_kept_corpus(name: str, path: Path) -> None:
    targets.TARGETS[name](path.read_bytes())


def damaged(name: str) -> st.SearchStrategy[bytes]:
    """Two kept inputs cut and joined, and some bytes changed."""
    seeds = st.sampled_from([path.read_bytes() for path in targets.corpus(name)])
    edits = st.lists(st.tuples(st.integers(0, 1 << 16), st.integers(0, 255)), max_size=8)

    def join(one: bytes, other: bytes, cut: int, begin: int, edits: list[tuple[int, int]]) -> bytes:
        data = bytearray(one[: cut % (len(one) + 1)] + other[begin % (len(other) + 1) :])
        for at, byte in edits if data else ():
            data[at % len(data)] = byte
        return bytes(data)

    places = st.integers(0, 1 << 16)
    return st.binary(max_size=100) | st.builds(join, seeds, seeds, places, places, edits)


@given(damaged("decoder"))
def test_any_packet(data: bytes) -> None:
    targets.decoder(data)


@given(damaged("request"))
def test_any_request_in_any_chunks(data: bytes) -> None:
    targets.request(data)


@given(damaged("model"))
def test_any_model_file(data: bytes) -> None:
    targets.model(data)
