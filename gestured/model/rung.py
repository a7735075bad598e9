"""One model of a ladder, opened when it is first needed."""

import math
from pathlib import Path

from gestured.core.errors import ModelError
from gestured.model.model import Model
from gestured.model.opening import look_at, open_model
from gestured.model.shipped import shipped_name


class Rung:
    """What is known of a model before it is opened, and whether it can be used now."""

    def __init__(self, source: str | Path | Model) -> None:
        self.source = source  # a file, a shipped model's name, or a model that is open already
        self.model = None if isinstance(source, str | Path) else source
        self.name = Path(source).stem if isinstance(source, str | Path) else source.name
        self.slow = 0  # runs in a row that took too long
        self.aside_until = -math.inf  # s, on the clock of whoever puts it aside
        self._ships = isinstance(source, str | Path) and shipped_name(source) is not None
        self._tried = ""  # sha256 of the file that was tried and found good
        self._refused: ModelError | None = None  # why the file that was tried is no model

    def open(self) -> Model:
        """The rung's model, at once: a file that does not ship was tried by `gestures` before. Raises ModelError."""
        if self._refused is not None:
            raise self._refused
        if self.model is None:
            assert isinstance(self.source, str | Path)
            self.model = open_model(self.source, self._tried)
        return self.model

    def open_first(self) -> Model:
        """The rung's model, however long it takes to try its file. Raises ModelError."""
        if self.model is None and not self._ships:
            self.gestures()
        return self.open()

    def gestures(self) -> tuple[str, ...]:
        """The gestures that the model knows. A file that ships is not opened for this; any other is tried, once."""
        if self.model is not None:
            return self.model.gestures
        assert isinstance(self.source, str | Path)
        if self._refused is not None:
            raise self._refused
        try:
            gestures, self._tried = look_at(self.source)
        except ModelError as error:
            if not self._ships:
                self._refused = error
            raise
        return gestures

    @property
    def gone(self) -> bool:
        """Whether the rung cannot be used again before a reload."""
        return self._refused is not None
