"""A rung: one model of a ladder, and whether it can be used now."""

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn, TypeVar

from gestured.core.errors import ModelError
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import shipped_gestures, shipped_name

T = TypeVar("T")


class OtherGestures(ModelError):
    """A fallback knows other gestures than the model for which it should answer."""


class Rung:
    """A model: open already, or a file that is opened when it is first needed.

    A file that was refused is not tried again before a reload, since that may take seconds.
    """

    def __init__(self, source: str | Path | Model) -> None:
        self.model = source if isinstance(source, Model) else None
        self.source = source.name if isinstance(source, Model) else source  # a file, or a shipped model's name
        self.name = Path(self.source).stem
        self.slow = 0  # runs in a row that took too long
        self.aside_until = -math.inf  # s, on the ladder's clock
        self.refused: ModelError | None = None

    def open(self) -> Model:
        """The rung's model. Raises ModelError."""
        if self.model is None:
            self.model = self._once(lambda: open_model(self.source))
            if shipped_name(self.source) != str(self.source).removesuffix(".onnx"):  # a path that holds in any folder
                self.source = os.path.abspath(self.source)
        return self.model

    def gestures(self) -> tuple[str, ...]:
        """The gestures that the model knows. A file that does not ship is opened for them. Raises ModelError."""
        if self.model is None and shipped_name(self.source) is not None:
            return self._once(lambda: shipped_gestures(self.source))
        return self.open().gestures

    def refuse(self, why: ModelError) -> NoReturn:
        """Raise the error, now and whenever the model is asked for."""
        self.model, self.refused = None, why
        raise why

    def _once(self, look: Callable[[], T]) -> T:
        if self.refused is not None:
            raise self.refused
        try:
            return look()
        except ModelError as error:
            self.refused = error
            raise
