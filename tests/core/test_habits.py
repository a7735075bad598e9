"""What frames say of how a sensor was connected: counts that fall, rows and columns exchanged, silences."""

import numpy as np
import pytest

from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.mounting import Mounting
from gestured.core.vitals import Vitals

RATE_HZ = 15.0


def session(rows: int, columns: int, sign: float = 1.0, contacts: int = 4, seed: int = 0) -> np.ndarray:
    """(T, R, C) counts: an idle second and a half, then swipes across with a quiet second after each."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:rows, :columns]
    frames = [np.zeros((rows, columns))] * 22
    for n in range(contacts):
        row = (n + 1) * (rows - 1) / (contacts + 1)
        for column in np.linspace(1, columns - 2, 7):
            frames.append(sign * 300 * np.exp(-((y - row) ** 2 + (x - column) ** 2) / 1.6))
        frames += [np.zeros((rows, columns))] * 15
    return 500 + np.array(frames) + rng.normal(0, 2, (len(frames), rows, columns))


def played(frames: np.ndarray, **more) -> FrontEnd:
    front_end = FrontEnd("arm", *frames.shape[1:], **more)
    for n, values in enumerate(frames):
        front_end.push(Frame(n / RATE_HZ, values))
    return front_end


@pytest.mark.parametrize("seed", range(3))
def test_counts_that_fall_under_a_finger_are_noticed_and_inverting_them_helps(seed: int) -> None:
    falling = played(session(9, 9, -1.0, seed=seed))
    assert falling.habits.inverted and falling.segments == 0
    assert not played(session(9, 9, 1.0, seed=seed)).habits.inverted
    mended = played(session(9, 9, -1.0, seed=seed), mounting=Mounting(invert=True))
    assert mended.segments == 4 and not mended.habits.inverted


def test_inverted_counts_are_read_as_if_they_rose() -> None:
    for dtype in (np.uint8, np.float32, np.int64):
        sent = np.array([[0, 200], [7, 30]], dtype)
        assert np.array_equal(
            Mounting(90, True, invert=True).frame(sent), -Mounting(90, True).frame(sent).astype(float)
        )


@pytest.mark.parametrize(("rows", "columns"), [(6, 12), (12, 6), (27, 15), (8, 10)])
@pytest.mark.parametrize("mounting", [Mounting(), Mounting(90), Mounting(270, True)])
def test_exchanged_rows_and_columns_are_noticed(rows: int, columns: int, mounting: Mounting) -> None:
    frames = session(rows, columns, contacts=5)
    right = played(frames, mounting=mounting)
    assert right.segments == 5 and not right.habits.exchanged
    wrong = played(frames.reshape(-1, columns, rows), mounting=mounting)
    assert wrong.habits.exchanged


@pytest.mark.parametrize(("rows", "columns"), [(6, 12), (12, 6)])
def test_rows_and_columns_that_are_exchanged_are_noticed_where_counts_fall_as_well(rows: int, columns: int) -> None:
    frames = session(rows, columns, -1.0, contacts=5)
    right, wrong = (played(each).habits for each in (frames, frames.reshape(-1, columns, rows)))
    assert right.inverted and not right.exchanged
    assert wrong.inverted and wrong.exchanged


def test_what_was_noticed_is_forgotten_when_the_sensor_is_learned_anew() -> None:
    falling = played(session(9, 9, -1.0))
    falling.reset()
    assert not falling.habits.inverted


def stretch(vitals: Vitals, begin: float, seconds: float, *, missed: bool = False) -> float:
    """Frames for some seconds, then silence; when the next stretch may begin."""
    for n in range(round(seconds * RATE_HZ)):
        vitals.arrived(begin + n / RATE_HZ, 1, RATE_HZ, missed=missed and n == 0)
    vitals.silent()
    return begin + seconds + 3.0


def test_stretches_of_frames_with_silences_between_are_noticed() -> None:
    vitals, now = Vitals(), 0.0
    for n in range(4):
        assert vitals.intermittent == (n >= 3)
        now = stretch(vitals, now, 0.6)
    stretch(vitals, now, 10.0)
    assert not vitals.intermittent  # it has sent while nobody touched it


def test_a_silence_in_which_this_machine_had_no_room_is_not_the_sensors() -> None:
    vitals, now = Vitals(), 0.0
    for _ in range(8):
        now = stretch(vitals, now, 0.6, missed=True)
        assert not vitals.intermittent
    for _ in range(3):
        now = stretch(vitals, now, 0.6)
    assert vitals.intermittent
