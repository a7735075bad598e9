"""What gestured raises on purpose. Any other exception is a bug, and ends every program but the daemon."""


class GesturedError(Exception):
    """Base of the errors that a command line prints as one sentence."""


class ProtocolError(GesturedError):
    """A peer sent nonsense: whoever catches this counts `reason`, drops the packet and goes on.

    `reason` is a short, fixed word (a metric label); the text says what was expected.
    """

    def __init__(self, reason: str, text: str = "") -> None:
        super().__init__(text or reason)
        self.reason = reason


class ModelError(GesturedError):
    """A model file that cannot be used; the text names the file and what is wrong."""


class RecordingError(GesturedError):
    """A recording that cannot be read or written; the text names the file, the field and what was expected."""


class SettingsError(GesturedError):
    """A setting that is not valid; the text names the key, the value and what was expected."""
