"""JSON schemas of the two messages for which Foxglove has no word: a frame's end and a step."""

from typing import Any

_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}

_FRAME: dict[str, Any] = {
    "type": "object",
    "properties": {
        "index": {"type": "integer"},
        "kind": {"enum": ["rest", "shape", "way"]},
        "time": {"type": "number"},
    },
    "required": ["index", "kind", "time"],
}

_PLAN: dict[str, Any] = {
    "type": ["object", "null"],
    "properties": {
        "status": {"enum": ["straight", "rrt_connect", "partial", "failed"]},
        "requested": _VECTOR,
        "achieved": _VECTOR,
        "reason": {"type": "string"},
        "checks": {"type": "integer"},
    },
    "required": ["status", "requested", "achieved", "reason", "checks"],
}

_STEP: dict[str, Any] = {
    "type": "object",
    "properties": {
        "index": {"type": "integer"},
        "time": {"type": "number"},
        "chamfer": {"type": "number"},
        "motion": _VECTOR,
        "plan": _PLAN,
    },
    "required": ["index", "time", "chamfer", "motion", "plan"],
}

JSON_SCHEMAS = {"/frame": ("dnet.Frame", _FRAME), "/step": ("dnet.Step", _STEP)}
"""Schema name and JSON schema by topic."""
