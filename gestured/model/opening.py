"""The opening of a model's file, and the check of one without opening it in this process.

A file is read once and opened from those bytes. One that ships is compared with its manifest first; any other is tried
in a process of its own first (`process`). Whatever is wrong is a `ModelError`, which names the file, what is wrong and
what was expected.
"""

from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from gestured.model.model import Model
from gestured.model.process import try_out
from gestured.model.shipped import naming, read

# Models of this process by sha256 and name. They have no state, so any number of ladders may share one.
_opened: WeakValueDictionary[tuple[str, str], Model] = WeakValueDictionary()


def open_model(source: str | Path) -> Model:
    """Open and verify a model: a path, or the bare name of a shipped one. Raises ModelError.

    A file that does not ship is tried in a process of its own first, which takes about half a second, at most some
    seconds. A model that is open already is shared.
    """
    path, name, data, sha256 = read(source)
    with naming(path):
        model = _opened.get((sha256, path.stem))
        if model is None:
            if name is None:
                try_out(data)
            model = _opened[sha256, path.stem] = Model(data, path.stem)
        return model


def check(source: str | Path) -> dict[str, Any]:
    """What `gesturectl check` reports of a good model, as JSON values; raises ModelError for any other."""
    path, name, data, _ = read(source)
    with naming(path):
        report = try_out(data) if name is None else Model(data, path.stem).report()
    first = {key: report[key] for key in ("kind", "version")}
    return {"file": str(path), "name": path.stem, **first, "shipped": name is not None} | report
