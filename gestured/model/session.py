"""The session of a model: its graph, opened and run by onnxruntime, which no other module imports."""

import os
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.model.limit import limited
from gestured.model.metadata import Metadata

FATAL = 4  # onnxruntime's severity below which it logs nothing
LONGEST = 200  # the most characters that are passed on of an error of onnxruntime's


class Session:
    """One graph, whose inputs and outputs have names."""

    def __init__(self, data: bytes) -> None:
        """Open a file's bytes. Raises ValueError if onnxruntime cannot."""
        # Only this variable, set before the import, stops all telemetry of onnxruntime's Linux builds.
        os.environ["ORT_DISABLE_TELEMETRY"] = "1"
        import onnxruntime

        onnxruntime.set_default_logger_severity(FATAL)  # errors are raised, and stderr is for the log
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # else idle threads use up cores
        options.add_session_config_entry("session.load_model_format", "ONNX")  # refuse onnxruntime's own format
        options.enable_mem_reuse = False  # to plan it is slow, and makes no run faster or smaller
        options.log_severity_level = FATAL
        try:
            self._session: Any = onnxruntime.InferenceSession(
                data, options, providers=["CPUExecutionProvider"], enable_fallback=0
            )
        except Exception as error:  # onnxruntime has a dozen error types of its own, and MemoryError
            raise ValueError(f"onnxruntime cannot open it: {_brief(error)}") from error
        self.outputs: list[str] = [output.name for output in self._session.get_outputs()]

    def properties(self) -> dict[str, str]:
        """The file's `metadata_props`. Raises ValueError if they are no text."""
        try:
            found: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        except UnicodeDecodeError:
            raise ValueError("has metadata that is not UTF-8") from None
        return found

    def check(self, metadata: Metadata) -> str:
        """The input's name. Raises ValueError if names, types and shapes do not agree with the metadata."""
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        names = [i.name for i in inputs]
        takes = "frames" if metadata.features is None else "features"
        told = [takes] if metadata.context is None else [takes, "context"]
        if names != told:
            raise ValueError(f"has inputs {names}, expected {told} as its metadata say")
        if self.outputs not in (["scores", "unknown"], ["scores", "unknown", "embedding"]):
            raise ValueError(f"has outputs {self.outputs}, expected 'scores', 'unknown' and perhaps 'embedding'")
        count = len(metadata.gestures)
        own: tuple[int, ...] = (metadata.window.rows, metadata.window.columns)
        if metadata.features is not None:
            own = (len(metadata.features),)
        free = 1 if takes == "features" else 2  # the dimensions that must be open: B, or B and T
        beside = (None, len(metadata.context or ()))
        shapes = {
            takes: (None,) * free + own,
            "context": beside,
            "scores": (None, count),
            "unknown": (None,),
            "embedding": (None, None),
        }
        for value in (*inputs, *outputs):
            expected = shapes[value.name]
            if value.type != "tensor(float)":
                raise ValueError(f"{value.name!r} is {value.type}, expected tensor(float)")
            # A dimension that the file leaves open is a name or None. `Model.run` checks the sizes of outputs.
            loose = value.name not in names
            found = [d if isinstance(d, int) else None for d in value.shape]
            if len(found) != len(expected) or not all(
                f == e or (loose and (f is None or e is None)) for f, e in zip(found, expected, strict=True)
            ):
                raise ValueError(f"{value.name!r} has the shape {_shape(found)}, expected {_shape(expected)}")
        return takes

    def run(
        self, names: Sequence[str], inputs: Mapping[str, NDArray[np.float32]], limit_s: float
    ) -> list[NDArray[np.float32]]:
        """The graph's outputs of these names. Raises ValueError if it fails, or takes longer than `limit_s`."""
        import onnxruntime

        options = onnxruntime.RunOptions()
        options.log_severity_level = FATAL
        try:
            with limited(options, limit_s):
                found: list[NDArray[np.float32]] = self._session.run(names, inputs, options)
        except Exception as error:  # onnxruntime has a dozen error types of its own, and MemoryError
            if options.terminate:
                raise ValueError(f"was ended after {limit_s:g} s, in which it did not answer") from error
            raise ValueError(f"onnxruntime cannot run it: {_brief(error)}") from error
        return found


def _brief(error: BaseException) -> str:
    """What onnxruntime says, in one line of at most LONGEST characters."""
    text = " ".join(str(error).split()) or type(error).__name__
    text = re.sub(r"^\[ONNXRuntimeError\] : \d+ : ", "", text)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _shape(dimensions: Sequence[int | None]) -> str:
    return "(" + ", ".join("any" if d is None else str(d) for d in dimensions) + ")"
