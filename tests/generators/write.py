"""Write rooms of a generator as capture files, for ``tests/bench/rooms.py``.

    python -m tests.generators.write hard-rooms rooms/own --seed 7001 --count 12
    python -m tests.generators.write facets rooms/facets --seed 1000 --count 12

``hard-rooms`` is the dataset of that name, with rooms 1, 2 ... of one seed; ``facets`` has a seed for each room.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.generators import facet_rooms
from uwbbench import open_dataset
from uwbbench.api import Capture, write_capture


def rooms(generator: str, seed: int, count: int) -> Iterator[Capture]:
    """Rooms of a generator, one after the other.

    Parameters
    ----------
    generator : {"hard-rooms", "facets"}
    seed : int
        Of the rooms, or of the first of them.
    count : int
    """
    if generator == "facets":
        yield from (facet_rooms.made(each) for each in range(seed, seed + count))
        return
    dataset = open_dataset("hard-rooms", {"seed": seed, "count": count})
    yield from (dataset.open(name) for name in dataset.names())


def main() -> None:
    """Write the files, and name each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("generator", choices=["hard-rooms", "facets"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=12)
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    for capture in rooms(asked.generator, asked.seed, asked.count):
        target = asked.folder / f"{capture.name.replace('/', '-')}.h5"
        write_capture(target, capture)
        sys.stderr.write(f"{target}: {len(capture)} frames\n")


if __name__ == "__main__":
    main()
