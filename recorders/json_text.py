"""Values as JSON, with numpy's numbers and arrays as plain ones."""

import json
from pathlib import Path
from typing import Any

import numpy as np


def to_json(value: Any) -> str:
    """Return `value` as JSON; numpy scalars and arrays become numbers and lists.

    Raises:
        TypeError: If a value is neither JSON's, nor numpy's, nor a path.
    """
    return json.dumps(value, default=_plain)


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"a log cannot hold {value!r} of type {type(value).__name__}; use JSON values")
