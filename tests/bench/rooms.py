"""Detectors on folders of simulated rooms: scores by generator, motion and material, and kinds of false detections.

    python tests/bench/rooms.py --captures own=rooms/own --captures other=rooms/other champion cfar-os mine.yaml

Each folder holds the capture files of one generator of rooms. Scoring is ``object``: detections and visible obstacles
of a frame are matched one to one in range. Counts are added up over captures before a ratio is taken. The interval of
F1 is the central 95 % over captures drawn with replacement, from each generator as many as it has; with a dozen
captures it is too narrow rather than too wide. A robot *moves* where it is faster than 1 cm/s, else *turns* where its
heading changes by more than 1 degree/s, and else *stands*. What was found on a file by a detector is kept in a cache,
until the file, the detector with its stages, or the scoring changes.
"""

from __future__ import annotations

import argparse
import hashlib
import inspect
import json
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # two processes leave nothing for threads

import numpy as np

from uwbbench import load_detector, open_capture
from uwbbench.api import FloatArray, IntArray, Trajectory, UwbbenchError, list_receivers
from uwbbench.detect.pipeline import Pipeline
from uwbbench.detect.sources import source_hash
from uwbbench.measure.accuracy.causes import KINDS, causes
from uwbbench.measure.accuracy.judge import judge
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene

MOTIONS = ("moving", "turning", "standing")
SLOWEST_M_S, SLOWEST_RAD_S = 0.01, np.radians(1.0)
RESAMPLES = 2000
GATE_M = 0.2
ALL = "all"
"""Name of all generators together."""

Row = dict[str, Any]
"""Counts of one detector on one receiver of one file, as JSON keeps them."""


@dataclass(frozen=True)
class Unit:
    """One receiver of one file, for all detectors.

    Attributes
    ----------
    generator : str
    file : Path
    receiver : str
    """

    generator: str
    file: Path
    receiver: str


@dataclass(frozen=True)
class Job:
    """A unit, the detectors that nothing is known of there, and where to keep what is found."""

    unit: Unit
    detectors: Mapping[str, Path]
    gate_m: float


def motions(track: Trajectory) -> IntArray:
    """Index into :data:`MOTIONS` of each frame (frames,), from the step that leads to it."""
    seconds = np.maximum(np.diff(track.timestamp_s), 1e-9)
    speed = np.linalg.norm(np.diff(track.position_m, axis=0), axis=1) / seconds
    turn = np.abs(np.angle(np.exp(1j * np.diff(track.yaw_rad)))) / seconds
    state = np.where(speed > SLOWEST_M_S, 0, np.where(turn > SLOWEST_RAD_S, 1, 2))
    return np.concatenate([state[:1], state]) if len(state) else np.full(len(track), 2)


def counted(detector: Pipeline, unit: Unit, gate_m: float) -> Row:
    """Counts of one detector on one unit.

    Parameters
    ----------
    detector : Pipeline
    unit : Unit
    gate_m : float
        Largest error in range of a true detection.

    Raises
    ------
    UwbbenchError
        If the detector cannot run on the capture, or the capture has no truth.
    """
    capture = open_capture(unit.file, receiver=unit.receiver)
    found, rules = detector.run(capture), ScoringRules("object", gate_m)
    scene = Scene.of(found, capture.header)
    verdict = judge(found, scene, rules, "filtering")
    state = motions(capture.trajectory)
    there = scene.visible(rules.region) & scene.scored[:, None]
    tp = np.bincount(np.repeat(state, verdict.found.sum(axis=1)), minlength=3)
    asked = np.bincount(np.repeat(state, there.sum(axis=1)), minlength=3)
    fp = np.bincount(state[verdict.retained.frame[verdict.stray]], minlength=3)
    if (tp.sum(), fp.sum()) != (verdict.outcome.tp.sum(), verdict.outcome.fp.sum()):
        raise AssertionError(f"{unit.file}: {detector.name}: counts by motion do not add up")
    found_of, asked_of = Counter[str](), Counter[str]()
    for column, obstacle in enumerate(capture.truth.objects if capture.truth else ()):
        if scene.obstacle[column]:
            found_of[obstacle.material] += int(verdict.found[:, column].sum())
            asked_of[obstacle.material] += int(there[:, column].sum())
    error_m = verdict.outcome.error_m[verdict.outcome.matched]
    return {
        "tp": tp.tolist(),
        "fp": fp.tolist(),
        "fn": (asked - tp).tolist(),
        "materials": {name: [found_of[name], asked_of[name]] for name in sorted(asked_of)},
        "chance": verdict.chance_recall * int(asked.sum()) if asked.sum() else 0.0,
        "kinds": dict(causes(found, scene, rules, "filtering").false),
        "errors": [float(error_m.sum()), float(np.abs(error_m).sum()), float((error_m**2).sum()), len(error_m)],
    }


def work(job: Job) -> list[str]:
    """Count what is not known yet and keep it; messages of detectors that failed."""
    failed = []
    for name, target in job.detectors.items():
        try:
            row = counted(load_detector(name), job.unit, job.gate_m)
        except UwbbenchError as error:
            failed.append(f"{name} on {job.unit.file} ({job.unit.receiver}): {error}")
            continue
        partial = target.with_suffix(f".{os.getpid()}.part")
        partial.write_text(json.dumps(row))
        partial.replace(target)
    return failed


def units(folders: Sequence[str]) -> list[Unit]:
    """Receivers of all files of folders, each ``NAME=FOLDER``.

    Raises
    ------
    UwbbenchError
        If a folder is not named so or holds no capture file, or a file is damaged.
    """
    every = []
    for text in folders:
        name, sign, folder = text.partition("=")
        files = sorted(Path(folder).glob("*.h5"))
        if not (name and sign and files) or name == ALL:
            raise UwbbenchError(f"--captures {text}: expected NAME=FOLDER, with capture files (*.h5) in the folder")
        every += [Unit(name, file, receiver) for file in files for receiver in list_receivers(file)]
    return every


def gathered(every: Sequence[Unit], detectors: Sequence[str], cache: Path, processes: int, gate_m: float) -> Any:
    """Counts of each detector on each unit, by both, and the messages of what failed.

    Parameters
    ----------
    every : sequence of Unit
    detectors : sequence of str
        Names, or paths of YAML files.
    cache : Path
        Folder of what is known already; made if it is missing.
    processes : int
    gate_m : float
    """
    cache.mkdir(parents=True, exist_ok=True)
    counting = "".join(map(inspect.getsource, (motions, counted)))
    scoring = source_hash("uwbbench.measure.accuracy.causes") + hashlib.sha256(counting.encode()).hexdigest()
    identities = {name: load_detector(name).identity for name in detectors}
    hashes = {file: hashlib.sha256(file.read_bytes()).hexdigest() for file in {unit.file for unit in every}}
    places = {
        (unit, name): cache / f"{hashlib.sha256(text.encode()).hexdigest()}.json"
        for unit in every
        for name in detectors
        if (text := f"{hashes[unit.file]} {unit.receiver} {identities[name]} {gate_m} {scoring}")
    }
    jobs = []
    for unit in every:
        unknown = {name: place for name in detectors if not (place := places[unit, name]).exists()}
        if unknown:
            jobs.append(Job(unit, unknown, gate_m))
    failed: list[str] = []
    with ProcessPoolExecutor(max(1, min(processes, len(jobs)))) as pool:
        for number, messages in enumerate(pool.map(work, jobs), 1):
            failed += messages
            print(f"\r{number} of {len(jobs)} captures ", end="", file=sys.stderr, flush=True)
    if jobs:
        print(file=sys.stderr)
    rows = {key: json.loads(place.read_text()) for key, place in places.items() if place.exists()}
    return rows, failed


def ratios(tp: FloatArray, fp: FloatArray, fn: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Precision, recall and F1 of counts of any shape; NaN where undefined."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return tp / (tp + fp), tp / (tp + fn), 2 * tp / (2 * tp + fp + fn)


def interval(rows: Sequence[tuple[str, Row]]) -> tuple[float, float]:
    """Ends of the interval of F1, for rows with the name of their generator, in the generators' order."""
    rng = np.random.default_rng(0)
    total = np.zeros((RESAMPLES, 3))
    for _, group in groupby(rows, key=lambda pair: pair[0]):
        counts = np.array([[sum(row[name]) for name in ("tp", "fp", "fn")] for _, row in group], float)
        total += rng.multinomial(len(counts), np.full(len(counts), 1 / len(counts)), RESAMPLES) @ counts
    low, high = np.nanpercentile(ratios(*total.T)[2], [2.5, 97.5])
    return float(low), float(high)


def summary(detector: str, generator: str, rows: Sequence[tuple[str, Row]]) -> Row:
    """One line of the tables: everything of one detector on one generator.

    Parameters
    ----------
    detector, generator : str
    rows : sequence of (str, Row)
        The generator's name and counts of each unit.
    """
    counts = {name: np.sum([row[name] for _, row in rows], axis=0) for name in ("tp", "fp", "fn")}
    precision, recall, f1 = (float(one) for one in ratios(*(counts[name].sum() for name in ("tp", "fp", "fn"))))
    low, high = interval(rows)
    moved = zip(*ratios(counts["tp"], counts["fp"], counts["fn"]), strict=True)
    materials: dict[str, IntArray] = {}
    for _, row in rows:
        for name, pair in row["materials"].items():
            materials[name] = materials.get(name, np.zeros(2, np.int64)) + np.asarray(pair)
    total, absolute, squares, matched = np.sum([row["errors"] for _, row in rows], axis=0)
    kinds = sum((Counter(row["kinds"]) for _, row in rows), Counter[str]())
    each = [float(ratios(*(np.sum(row[name]) for name in ("tp", "fp", "fn")))[2]) for _, row in rows]
    bias_m = total / max(matched, 1)
    return {
        "detector": Path(detector).stem,
        "generator": generator,
        "captures": len(rows),
        "precision": precision,
        "recall": recall,
        "chance_recall": sum(row["chance"] for _, row in rows) / max(int((counts["tp"] + counts["fn"]).sum()), 1),
        "f1": f1,
        "f1_low": low,
        "f1_high": high,
        "f1_worst": float(np.nanmin(each)) if not np.all(np.isnan(each)) else float("nan"),
        "motion": {name: [float(one) for one in three] for name, three in zip(MOTIONS, moved, strict=True)},
        "recall_of": {name: float(one[0] / one[1]) for name, one in sorted(materials.items()) if one[1]},
        "kinds": {kind: kinds[kind] for kind in KINDS if kinds[kind]},
        "bias_m": float(bias_m),
        "sd_m": float(np.sqrt(max(squares / max(matched, 1) - bias_m**2, 0.0))),
        "mae_m": float(absolute / max(matched, 1)),
    }


def lines(summaries: Sequence[Row]) -> Iterator[str]:
    """The tables as Markdown."""
    columns = ["detector", "generator", "n", "P", "R", "(chance)", "F1", "95 %", "worst", *MOTIONS]
    columns += ["recall of", "bias", "SD", "MAE"]
    yield "| " + " | ".join([*columns, "false detections"]) + " |"
    yield "|" + " --- |" * (len(columns) + 1)
    for one in summaries:
        parts = [one["detector"], one["generator"], str(one["captures"])]
        parts += [f"{one[name]:.3f}" for name in ("precision", "recall", "chance_recall", "f1")]
        parts += [f"{one['f1_low']:.2f}-{one['f1_high']:.2f}", f"{one['f1_worst']:.2f}"]
        parts += ["/".join(f"{number:.2f}" for number in one["motion"][name]) for name in MOTIONS]
        parts += [", ".join(f"{name} {number:.2f}" for name, number in one["recall_of"].items())]
        parts += [f"{100 * one[name]:.1f}" for name in ("bias_m", "sd_m", "mae_m")]
        parts += [", ".join(f"{kind} {count}" for kind, count in one["kinds"].items())]
        yield "| " + " | ".join(parts) + " |"
    yield ""
    yield "(chance): recall of as many random ranges. Columns of motion: P/R/F1. Worst: F1 of the worst capture."
    yield "Bias, SD and MAE of true detections in cm."


def main() -> int:
    """Print the tables; 3 where a detector failed on a capture, 2 where the arguments are wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("detectors", nargs="+", help="names, or paths of YAML files")
    parser.add_argument("--captures", action="append", required=True, metavar="NAME=FOLDER", help="may be repeated")
    usual = Path(tempfile.gettempdir(), "uwbbench-rooms")
    parser.add_argument("--cache", type=Path, default=usual, help="folder of what is known already: %(default)s")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--gate", type=float, default=GATE_M, metavar="METRES", help="largest error in range")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of the table")
    asked = parser.parse_args()
    try:
        every = units(asked.captures)
        rows, failed = gathered(every, asked.detectors, asked.cache, asked.processes, asked.gate)
    except UwbbenchError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    generators = list(dict.fromkeys(unit.generator for unit in every))
    summaries = []
    for name in asked.detectors:
        known = [(unit.generator, rows[unit, name]) for unit in every if (unit, name) in rows]
        groups = {generator: [pair for pair in known if pair[0] == generator] for generator in generators}
        groups |= {ALL: known} if len(generators) > 1 else {}
        summaries += [summary(name, generator, pairs) for generator, pairs in groups.items() if pairs]
    print(json.dumps(summaries, indent=2) if asked.json else "\n".join(lines(summaries)))
    for message in failed:
        print(f"failed: {message}", file=sys.stderr)
    return 3 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
