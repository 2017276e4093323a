"""Identity of things by content: SHA-256 of canonical JSON, never a repr or a file name."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Value made of JSON's types only.

    Keys become text, tuples and arrays lists, NumPy scalars Python's. NaN and infinities, which JSON lacks, become
    null: a number that is undefined.
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def canonical(value: Any) -> str:
    """JSON text that is equal for equal content: sorted keys, no spaces, ASCII only."""
    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(value: Any) -> str:
    """SHA-256 of the canonical JSON of a value, in hexadecimal.

    Examples
    --------
    >>> digest({"b": 1, "a": (2.5, None)}) == digest({"a": [2.5, None], "b": 1})
    True
    """
    return hashlib.sha256(canonical(value).encode()).hexdigest()


def file_id(value: Any) -> str:
    """File name, without suffix, for results about ``value``: safe whatever names it holds."""
    return digest(value)[:20]
