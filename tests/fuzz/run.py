"""``make fuzz``: many damaged copies of every format. Exits with 1 where one is neither read nor refused.

::

    python -m tests.fuzz.run 20000 [--first SEED] [FORMAT...]
"""

from __future__ import annotations

import argparse
import secrets
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.flips import read_all
from tests.fuzz.formats import FORMATS


def main() -> int:
    """Read damaged copies of some formats, all if none is named, and say what became of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("flips", type=int)
    parser.add_argument("--first", type=int, default=secrets.randbelow(2**40))
    parser.add_argument("formats", nargs="*", choices=[*FORMATS, []])
    given = parser.parse_args()
    flips, start, wrong = given.flips, given.first, 0
    print(f"seeds {start} to {start + flips - 1}, for each format")
    for name in given.formats or FORMATS:
        begun = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            counts, faults = read_all(FORMATS[name], range(start, start + flips), Path(folder))
        said = ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))
        print(f"{name}: {said} ({time.monotonic() - begun:.0f} s)", flush=True)
        for fault in faults[:10]:
            print(f"  {fault}")
        wrong += len(faults)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
