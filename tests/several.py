"""What fixtures share that start something as often as a test asks for it."""

from collections.abc import Callable, Iterator
from typing import ParamSpec, TypeVar

How = ParamSpec("How")
One = TypeVar("One")


def several(make: Callable[How, One], end: Callable[[One], object]) -> Iterator[Callable[How, One]]:
    """For a fixture: makes one each time it is called, and ends all of them with the test."""
    made: list[One] = []

    def begin(*arguments: How.args, **more: How.kwargs) -> One:
        made.append(make(*arguments, **more))
        return made[-1]

    yield begin
    for one in made:
        end(one)
