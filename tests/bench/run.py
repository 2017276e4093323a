"""Every speed target with what is measured here: ``make bench``, or ``python tests/bench/run.py --help``."""

from __future__ import annotations

import argparse
import importlib
import json
import sys

from harness import Disagreement, Effort, heading, line, plain

from uwbbench.measure.latency.machine import load, machine

PARTS = {
    "batch": "bench_batch",
    "stream": "bench_stream",
    "file": "bench_file",
    "dbscan": "bench_dbscan",
    "cfar": "bench_cfar_clutter",
    "tracks": "bench_tracks",
    "particles": "bench_particles",
    "mappers": "bench_mappers",
    "sweep": "bench_sweep",
    "classify": "bench_classify",
    "startup": "bench_startup",
    "gate": "gates",
}


def main() -> int:
    """Run the parts asked for; 0 unless contenders disagree."""
    parser = argparse.ArgumentParser(description=__doc__, epilog="example: python tests/bench/run.py batch stream")
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; all of them if none is named")
    parser.add_argument("--quick", action="store_true", help="few rounds: that everything runs and agrees, no timing")
    parser.add_argument("--paced", type=float, default=5.0, metavar="SECONDS", help="length of the run at 96 Hz")
    parser.add_argument("--gates", type=int, default=10, metavar="N", help="repetitions of each regression gate")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of the table")
    asked = parser.parse_args()
    if unknown := set(asked.parts) - set(PARTS):
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    effort = Effort(
        quick=asked.quick, paced_s=1.0 if asked.quick else asked.paced, gates=2 if asked.quick else asked.gates
    )
    record, busy = machine(), load()
    if not asked.json:
        cpu, cores = record["cpu"], record["usable_cores"]
        print(f"{cpu}, {cores} cores, load {busy}; ratios hold for its kind, times for itself alone\n{heading()}")
    table = []
    for part in asked.parts or PARTS:
        try:
            for row in importlib.import_module(PARTS[part]).rows(effort):
                table.append(row)
                if not asked.json:
                    print(line(row), flush=True)
        except Disagreement as error:
            sys.stderr.write(f"{part}: {error}\n")
            return 1
    if asked.json:
        print(json.dumps({"machine": record, "load": busy, "rows": [plain(row) for row in table]}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
