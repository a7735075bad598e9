"""The models that a configuration asks for."""

from gestured.core.errors import ModelError
from gestured.daemon.log import log
from gestured.daemon.settings import Settings
from gestured.model.ladder import Ladder, gestures_in_use, ladder_for, require_gestures


def open_ladder(settings: Settings, *, insist: bool = False) -> Ladder:
    """Open and test them. Raises ModelError, or SettingsError for gestures that they do not know.

    With `insist` a fallback is not good enough: what runs already is better than that.
    """
    early: list[str] = []
    opened = False  # until then a failure may end the start, and the error says it all

    def report(sentence: str) -> None:
        if opened:
            log.warning("model", what=sentence)
        else:
            early.append(sentence)

    ladder = ladder_for(settings.model, settings.fallback or None, report=report)
    if insist and ladder.degraded:
        raise ModelError("; ".join(early))
    opened = True
    for sentence in early:
        report(sentence)
    gestures_in_use(ladder, settings.gestures)
    require_gestures(ladder, settings.per_gesture)
    return ladder
