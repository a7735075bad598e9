"""The scene that the settings ask for."""

from gestured.core.mounting import Mounting
from gestured.core.osc_address import Addresses
from gestured.core.scene import Scene, Setup
from gestured.daemon.settings import Settings
from gestured.model.ladder import Ladder, gestures_in_use


def scene_of(settings: Settings, ladder: Ladder) -> Scene:
    """What decides, with the models of `ladder`, which knows all gestures that the settings name."""
    parts = settings.per_gesture
    return Scene(
        gestures=gestures_in_use(ladder, settings.gestures),
        grid=settings.grid or (ladder.rows, ladder.columns),
        sensors={
            name: Setup(own.grid, Mounting(own.rotate, own.mirror, own.invert), own.clock)
            for name, own in settings.sensors.items()
        },
        addresses=Addresses(settings.addresses.pressure, settings.addresses.trajectory),
        clock=settings.clock,
        stale_s=settings.stale_s,
        tap_gap_s=settings.tap_gap_s,
        provisional_taps=settings.provisional_taps,
        max_sensors=settings.max_sensors,
        allow=settings.allow,
        thresholds={name: part.threshold for name, part in parts.items() if part.threshold is not None},
        refractory={name: part.refractory_s for name, part in parts.items()},
    )
