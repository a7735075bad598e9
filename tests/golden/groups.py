"""The groups of golden tapes: each a function that makes its tapes, each a file.

What touches behaviour that is about to change on purpose stands in a group of its own (`stalls_long`, `clock_sensor`,
`one_shot`, `places`), so that its events change alone.
"""

from collections.abc import Callable

from tests.golden.damage import faults, rubbish, silence
from tests.golden.hands import hand, people, settings
from tests.golden.tape import Tape
from tests.golden.ways import clock_sensor, counters, one_shot, places, sources, stalls, stalls_long

GROUPS: dict[str, Callable[[], list[Tape]]] = {
    make.__name__: make
    for make in (
        people, hand, settings, faults, counters, clock_sensor, sources, one_shot, places, stalls, stalls_long,
        rubbish, silence,
    )
}  # fmt: skip
