"""What a simulated sensor is like, in numbers."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Nature:
    """What a sensor is like; `seed` fixes its taxels. Strengths are shares of `gain`."""

    seed: int = 0
    rows: int = 9
    columns: int = 9
    pitch_mm: float = 8.0
    rate_hz: float = 15.0
    scan: float = 0.6  # share of the frame's time in which the rows are read one after the other
    gain: float = 900.0  # counts of a normal touch
    gain_spread: float = 0.06
    force_exponent: float = 1.0  # a touchscreen hardly sees force (0.2), a pressure matrix does (1)
    exponent: float = 0.9  # of the response curve, see textile.compress
    knee: float = 3.0
    offset: float = 0.4  # the idle level
    offset_spread: float = 0.05
    preload: float = 0.02  # what stretching over another inclination adds
    noise: float = 0.012
    row_noise: float = 0.004
    column_noise: float = 0.004
    common_noise: float = 0.002
    slow_noise: float = 0.0  # correlated over eight frames
    signal_noise: float = 0.01  # share of the signal itself
    hum: float = 0.0  # mains beating with the scan
    drift: float = 0.03  # size of a wander with periods from 20 s to 8 min
    spread: float = 0.45  # taxels, Gaussian
    tail: float = 0.06  # share of a touch that reaches further
    tail_taxels: float = 1.0
    row_crosstalk: float = 0.012
    column_crosstalk: float = 0.01
    ghost: float = 0.0  # where touched rows and columns cross
    relaxation: tuple[float, ...] = (0.25, 0.08)  # shares of the answer that lag, with these time constants
    taus_s: tuple[float, ...] = (0.03, 0.9)
    hysteresis: float = 0.012
    saturation: int = 4095
    dtype: str = "uint16"
    clipped: bool = False  # the firmware subtracts the baseline and sends no negatives
    dead_zone: float = 0.0  # what is smaller is sent as 0
    dead: int = 0
    stuck: int = 0
    bursts_per_minute: float = 0.0
    line_bursts_per_minute: float = 0.0  # that hit a whole row or column for one frame
    jitter_s: float = 0.003
    loss: float = 0.0  # probability of a frame, as `duplicates` and `late`
    loss_run: int = 4  # frames that are lost in a row at most
    loss_every: int = 0  # each so manieth frame is lost, as by another sender on the same channel; 0 = none
    duplicates: float = 0.0
    late: float = 0.0
    touch_noise: float = 0.1  # taxels; NaN where the sensor reports no fingers

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of the pad in millimetres."""
        return self.columns * self.pitch_mm, self.rows * self.pitch_mm
