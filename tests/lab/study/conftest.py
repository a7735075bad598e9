"""What tests of the study's page share."""

from typing import Any

import pytest
from matplotlib.figure import Figure


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are made and not drawn, which is most of a page's work, for tests of words and tables alone."""

    def nothing(self: object, file: Any, **_: object) -> None:
        file.write('<svg viewBox="0 0 1 1"/>')

    monkeypatch.setattr(Figure, "savefig", nothing)
