"""docs/events.schema.json and what docs/wire.md shows, held against the daemon's own lines."""

import inspect
import json
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

import pytest

from gestured.core.events import Cancelled, Event, Gesture, Touch, Unknown
from gestured.core.messages import error_json, parse_subscription
from gestured.daemon.explain import explain
from tests.daemon.parts import settings_of
from tests.documents.blocks import ROOT, Block, blocks
from tests.test_fields import LINES

SCHEMA = json.loads((ROOT / "docs" / "events.schema.json").read_text())
GESTURES = ("swipe_left",)
TYPES = ("provisional", "onset", "gesture", "unknown", "cancelled", "release", "touch", "status")


@pytest.fixture(scope="module")
def valid() -> Any:
    """Says whether a line is one that the schema allows; unknown keys are an error here."""
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    strict = json.loads(json.dumps(SCHEMA))
    for part in strict["$defs"].values():
        if "properties" in part:
            part["additionalProperties"] = False
    return jsonschema.Draft202012Validator(strict).validate


@pytest.mark.parametrize("event", get_args(Event), ids=lambda event: event.__name__)
def test_the_schema_has_each_key_of_each_event(event: type):
    part = SCHEMA["$defs"][event.__name__.lower()]
    keys = {"type", *(field.name for field in fields(event))}
    unsaid = {Gesture: {"own"}, Unknown: {"gates"}, Touch: {"reason"}}.get(event, set())  # said where it says anything
    assert set(part["required"]) == keys - unsaid
    assert set(part["properties"]) - {"test"} == keys


@pytest.mark.parametrize("event", [Unknown, Cancelled], ids=lambda event: event.__name__)
def test_the_schema_has_each_reason(event: type):
    """The list beside the field of the event is the one that others keep true."""
    text = inspect.getsource(event)
    (line,) = [line for line in text.splitlines() if line.strip().startswith("reason: str")]
    reasons = [word.split()[0] for word in line.partition("#")[2].split(",")]  # each may be explained in brackets
    assert SCHEMA["$defs"][event.__name__.lower()]["properties"]["reason"]["enum"] == reasons
    for reason in reasons:
        assert f"| `{reason}` |" in (ROOT / "docs" / "wire.md").read_text()


@pytest.mark.parametrize("line", [*LINES, json.loads(error_json("no"))], ids=lambda line: line["type"])
def test_lines_of_every_kind_are_valid(valid: Any, line: dict[str, Any]):
    valid(line)


@pytest.mark.parametrize("block", blocks("checked", "the schema"), ids=str)
def test_the_lines_in_the_documents_are_valid(valid: Any, block: Block):
    for line in block.text.splitlines():
        valid(json.loads(line))


@pytest.mark.parametrize("block", blocks("checked", "the daemon's own parser"), ids=str)
def test_the_requests_in_the_documents_are_valid(block: Block):
    for line in block.text.splitlines():
        parse_subscription(line.encode(), {"gestures": GESTURES, "zones": ("volume",)})


@pytest.mark.parametrize("block", blocks("checked", "gestured --explain"), ids=str)
def test_the_configurations_in_the_documents_are_valid(block: Block, tmp_path: Path):
    path = tmp_path / "gestured.toml"
    path.write_text(block.text)
    assert explain(*settings_of("--config", path))
