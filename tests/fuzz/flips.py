"""Damaged copies of a file, and what becomes of a reader that is given them.

Conventions
-----------
* A seed makes one damage: bits flipped, bytes replaced, a piece blanked or left out, or the end cut off.
* Copies are read in a child, many at a time and without the protection of single files. Where the child dies or hangs,
  its copies are read one by one as a user's files are.
"""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz.formats import Format
from uwbbench.api import CaptureError, UwbbenchError, in_child

TOGETHER = 50


def spoilt(content: bytes, seed: int) -> bytes:
    """Copy of a content with the damage of a seed."""
    rng = np.random.default_rng(seed)
    data = bytearray(content)
    at = [int(place) for place in rng.integers(0, len(data), 16)]
    length = int(rng.integers(1, 64))
    match int(rng.integers(0, 6)):
        case 0:
            data[at[0]] ^= 1 << int(rng.integers(0, 8))
        case 1:
            for place in at[: int(rng.integers(1, 16))]:
                data[place] ^= 1 << int(rng.integers(0, 8))
        case 2:
            data[at[0] : at[0] + length] = rng.bytes(length)
        case 3:
            data[at[0] : at[0] + length] = (b"\x00", b"\xff")[at[1] % 2] * length
        case 4:
            del data[at[0] : at[0] + length]
        case _:
            del data[at[0] :]
    return bytes(data)


def read_all(form: Format, seeds: Sequence[int], folder: Path) -> tuple[Counter[str], list[str]]:
    """What became of the damaged copies.

    Parameters
    ----------
    form : Format
    seeds : sequence of int
    folder : Path
        Empty, to write to.

    Returns
    -------
    counts : Counter of str
        How many were "read", how many "refused" with one message, and how many a child had to be ended for.
    faults : list of str
        Seed and traceback of what is neither.
    """
    path = folder / form.name
    form.make(path)
    form.read(path)
    content = path.read_bytes()
    counts: Counter[str] = Counter()
    faults: list[str] = []
    for first in range(0, len(seeds), TOGETHER):
        some = seeds[first : first + TOGETHER]
        try:
            ended = in_child(path, lambda some=some: [_ending(form, path, content, seed) for seed in some], 100.0)  # type: ignore[misc]
        except CaptureError:
            ended = [_ending(form, path, content, seed) for seed in some]
        for seed, (how, said) in zip(some, ended, strict=True):
            counts[how] += 1
            if how == "fault":
                faults.append(f"seed {seed}: {said}")
    return counts, faults


def _ending(form: Format, path: Path, content: bytes, seed: int) -> tuple[str, Any]:
    path.unlink(missing_ok=True)
    path.write_bytes(spoilt(content, seed))
    try:
        form.read(path)
    except UwbbenchError as error:
        text = str(error)
        if max(map(len, text.splitlines()), default=0) > 4000:
            return "fault", f"a message of {len(text)} characters: {text[:500]}"
        return ("ended" if "damaged: " in text and ("crashed" in text or "given up" in text) else "refused"), text
    except BaseException:  # noqa: BLE001
        return "fault", traceback.format_exc()
    return "read", ""
