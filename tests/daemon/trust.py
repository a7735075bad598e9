"""The tests' own small models are taken at their word.

A model that does not ship is first tried in a process of its own, which takes a fifth of a daemon's start.
"""

from importlib import import_module
from typing import Any

from gestured.model.model import Model
from gestured.model.process import try_out

MAKER = "gestured tests"  # stands at the head of the file as its producer


def trust() -> None:
    """From now on this process tries models of `tiny_model.make` and `small_model.build` itself, and others as ever."""
    opening: Any = import_module("gestured.model.opening")

    def tried(data: bytes) -> object:
        return Model(data, "").report() if MAKER.encode() in data[:100] else try_out(data)

    opening.try_out = tried
