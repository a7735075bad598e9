"""The nature of a simulated sensor: all its parameters."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Nature:
    """The parameters of a sensor; `seed` fixes its taxels. Strengths are shares of `gain`."""

    seed: int = 0
    rows: int = 9
    columns: int = 9
    pitch_mm: float = 8.0
    rate_hz: float = 15.0
    scan: float = 0.6  # share of a frame's time in which the rows are read one after the other
    gain: float = 900.0  # counts of a normal touch
    gain_spread: float = 0.06
    force_exponent: float = 1.0  # 1 for a pressure matrix; about 0.2 for a touchscreen, which hardly measures force
    exponent: float = 0.9  # of the response curve, see textile.compress
    knee: float = 3.0
    offset: float = 0.4  # the idle level
    offset_spread: float = 0.05
    preload: float = 0.02  # added by the stretch of the textile at another inclination
    noise: float = 0.012
    row_noise: float = 0.004
    column_noise: float = 0.004
    common_noise: float = 0.002
    slow_noise: float = 0.0  # correlated over eight frames
    signal_noise: float = 0.01  # share of the signal itself
    hum: float = 0.0  # of the mains, which beats with the scan
    drift: float = 0.03  # size of a slow wander with periods from 20 s to 8 min
    spread: float = 0.45  # taxels, one standard deviation of the textile's Gaussian blur
    tail: float = 0.06  # share that a touch loses; `sampling.sample` says why three times as much spreads
    tail_taxels: float = 1.0
    row_crosstalk: float = 0.012
    column_crosstalk: float = 0.01
    ghost: float = 0.0  # at the crossings of touched rows and columns
    relaxation: tuple[float, ...] = (0.25, 0.08)  # shares of the response that lag with the time constants `taus_s`
    taus_s: tuple[float, ...] = (0.03, 0.9)
    hysteresis: float = 0.012
    saturation: int = 4095
    dtype: str = "uint16"
    clipped: bool = False  # the firmware subtracts the baseline and sends no negatives
    dead_zone: float = 0.0  # smaller values are sent as 0
    dead: int = 0  # number of taxels that show no touch
    stuck: int = 0  # number of taxels that show the same, mostly high value all the time
    bursts_per_minute: float = 0.0
    line_bursts_per_minute: float = 0.0  # bursts that hit a whole row or column for one frame
    jitter_s: float = 0.003
    loss: float = 0.0  # probability that a frame is lost; `duplicates` and `late` are probabilities, too
    loss_run: int = 4  # the most frames that are lost in a row
    loss_every: int = 0  # one of so many frames is lost, as with another sender on the channel; 0: none
    duplicates: float = 0.0
    late: float = 0.0
    touch_noise: float = 0.1  # taxels, error of the reported fingers; NaN if the sensor reports none

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of the pad in millimetres."""
        return self.columns * self.pitch_mm, self.rows * self.pitch_mm
