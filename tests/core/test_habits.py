"""What frames say of how a sensor was connected: counts that fall, rows and columns exchanged, silences."""

import numpy as np
import pytest

from gestured.core.beside.reading import Vitals
from gestured.core.frames import Frame
from gestured.core.mounting import Mounting
from gestured.core.scene import Scene, Setup
from gestured.core.sensor import Sensor
from gestured.record.replay import Mute
from tests.swipes import RATE_HZ, swipes


def played(frames: np.ndarray, mounting: Mounting | None = None) -> Sensor:
    sensors = {"arm": Setup(mounting=mounting or Mounting())}
    sensor = Sensor("arm", Scene(("one_tap",), frames.shape[1:], sensors), Mute(("one_tap",)))
    for n, values in enumerate(frames):
        sensor.push(Frame(n / RATE_HZ, values))
    return sensor


def seen(sensor: Sensor) -> tuple[bool, bool]:
    """Whether its counts fall when it is touched, and whether its rows and columns are exchanged."""
    reading = sensor.reading(0.0)
    return sensor.condition(0.0)[0] == "inverted", reading.exchanged


def test_inverted_counts_are_read_as_if_they_rose() -> None:
    for dtype in (np.uint8, np.float32, np.int64):
        sent = np.array([[0, 200], [7, 30]], dtype)
        assert np.array_equal(
            Mounting(90, True, invert=True).frame(sent), -Mounting(90, True).frame(sent).astype(float)
        )


@pytest.mark.parametrize(("rows", "columns"), [(6, 12), (12, 6), (27, 15), (8, 10)])
@pytest.mark.parametrize("mounting", [Mounting(), Mounting(90), Mounting(270, True)])
def test_exchanged_rows_and_columns_are_noticed(rows: int, columns: int, mounting: Mounting) -> None:
    frames = swipes(rows, columns, contacts=5)
    right = played(frames, mounting=mounting)
    assert right.segments == 5 and not seen(right)[1]
    wrong = played(frames.reshape(-1, columns, rows), mounting=mounting)
    assert seen(wrong)[1]


@pytest.mark.parametrize(("rows", "columns"), [(6, 12), (12, 6)])
def test_rows_and_columns_that_are_exchanged_are_noticed_where_counts_fall_as_well(rows: int, columns: int) -> None:
    frames = swipes(rows, columns, -1.0, contacts=5)
    right, wrong = (seen(played(each)) for each in (frames, frames.reshape(-1, columns, rows)))
    assert right == (True, False)
    assert wrong == (True, True)


def test_what_was_noticed_is_forgotten_when_the_sensor_is_learned_anew() -> None:
    falling = played(swipes(9, 9, -1.0))
    falling.reset()
    assert not seen(falling)[0]


def stretch(vitals: Vitals, begin: float, seconds: float, *, missed: bool = False) -> float:
    """Frames for some seconds, then silence; when the next stretch may begin."""
    for n in range(round(seconds * RATE_HZ)):
        vitals.arrived(begin + n / RATE_HZ, 1, missed=missed and n == 0)
    vitals.silent()
    return begin + seconds + 3.0


def test_a_silence_in_which_this_machine_had_no_room_is_not_the_sensors() -> None:
    vitals, now = Vitals(), 0.0
    for _ in range(8):
        now = stretch(vitals, now, 0.6, missed=True)
        assert not vitals.intermittent
    for _ in range(3):
        now = stretch(vitals, now, 0.6)
    assert vitals.intermittent
