"""How often verdicts are wrong: false differences, power, and how often intervals hold the true value.

Run ``python tests/bench/verdicts.py [--quick] [--captures N] [--counts FILE] [--seed N]``. It prints the tables of
``docs/explanation/intervals.md``: studies from models, and studies drawn from captures of the simulator (SIMULATED) on
which no rule was chosen. ``--counts`` keeps what was found on those captures, so that a study can be repeated.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from verdict_models import MODELS, Model, correlated, equal_board, shifted
from verdict_scenes import FAMILIES, Counts, counted

from uwbbench.api import FloatArray
from uwbbench.measure.accuracy.boards import SIGNIFICANCE, board
from uwbbench.measure.accuracy.intervals import (
    CONFIDENCE,
    INNER_UNITS,
    Blocks,
    Interval,
    delete_one,
    quantile,
    ratio,
    share,
)

SCENES = (3, 4, 6, 8, 12, 20, 40)
DETECTORS = (2, 3, 8, 15, 50)
GAP = 0.03
CAPTURES = 400
STUDIES = 1000


@dataclass(frozen=True)
class Line:
    """One row of a table, in per cent."""

    title: str
    cells: tuple[float, ...]

    def text(self) -> str:
        """Row of a Markdown table."""
        cells = ["–" if np.isnan(cell) else f"{cell:.1f}" for cell in self.cells]
        return f"| {' | '.join([self.title, *cells])} |"


def false_differences(model: Model, detectors: int, scenes: int, boards: int, rng: np.random.Generator) -> float:
    """Boards of equal detectors that hold any false difference, in per cent."""
    return _differing(*equal_board(model, detectors, (boards, scenes), rng))


def power(model: Model, gap: float, scenes: int, boards: int, rng: np.random.Generator) -> float:
    """Pairs that differ by a gap and are found to, in per cent."""
    return _differing(*shifted(model, gap, (boards, scenes), rng))


def regressions(model: Model, gap: float, scenes: int, gates: int, rng: np.random.Generator) -> float:
    """Gates that call the second of two installations worse: the whole interval of the loss is above 0; in per cent."""
    num, den = shifted(model, gap, (gates, scenes), rng)
    low, _ = board(num.sum(-1) / den.sum(-1), delete_one(num, den), den).ends(CONFIDENCE)
    return 100 * float(np.mean(low[:, 0, 1] > 0))


def _differing(num: FloatArray, den: FloatArray) -> float:
    """Boards (boards, detectors, scenes) on which any pair differs, in per cent; the first step of Holm decides it."""
    first, second = np.triu_indices(num.shape[1], 1)
    p_values = board(num.sum(-1) / den.sum(-1), delete_one(num, den), den).p_value[:, first, second]
    least = np.nanmin(p_values, axis=-1) * len(first)
    return 100 * float(np.mean(least < SIGNIFICANCE))


def covered(found: Interval, true: FloatArray, *, outer: bool = False) -> float:
    """Intervals that hold the true value, in per cent of those that are given."""
    low, high = (found.outer_low, found.outer_high) if outer else (found.low, found.high)
    given = ~np.isnan(low)
    inside = (low <= true + 1e-12) & (true - 1e-12 <= high)
    return 100 * float(inside[given].mean()) if given.any() else np.nan


# From models -----------------------------------------------------------------------------------------------------


def of_models(effort: int, rng: np.random.Generator) -> Iterator[str]:
    """Tables from models."""
    yield from _head("False differences: boards of equal detectors with any (%)", SCENES)
    for detectors in DETECTORS:
        boards = min(effort, 400) if detectors > 15 else effort
        rates = np.array([[false_differences(m, detectors, n, boards, rng) for n in SCENES] for m in MODELS])
        yield Line(f"{detectors} detectors", tuple(rates.mean(axis=0))).text()
        yield Line(f"{detectors} detectors, worst of {len(MODELS)} models", tuple(rates.max(axis=0))).text()
    yield from _head(f"Power: pairs that differ by {GAP:g} and are found to (%)", SCENES)
    for model in MODELS:
        yield Line(model.title, tuple(power(model, GAP, scenes, effort, rng) for scenes in SCENES)).text()
    columns = tuple(scenes for scenes in SCENES if scenes > 3)
    yield from _head("Gates between two installations: regressions found (%)", columns)
    for title, gap in (("no worse on average", 0.0), (f"worse by {GAP:g}", GAP)):
        rates = np.array([[regressions(m, gap, n, effort, rng) for n in columns] for m in MODELS])
        yield Line(f"{title}, mean of {len(MODELS)} models", tuple(rates.mean(axis=0))).text()
        yield Line(f"{title}, most", tuple(rates.max(axis=0))).text()
    yield from _head("Coverage of F1, which is said to be 95 (%)", SCENES)
    for model in MODELS:
        found = []
        for scenes in SCENES:
            num, den, true = model.studies(effort, scenes, rng)
            found.append((share(num, den), true))
        yield Line(f"{model.title}, outer", tuple(covered(f, t, outer=True) for f, t in found)).text()
        inner = [covered(f, t) if n >= INNER_UNITS else np.nan for n, (f, t) in zip(SCENES, found, strict=True)]
        yield Line(f"{model.title}, inner", tuple(inner)).text()
    yield from _within(effort, rng)


def _within(effort: int, rng: np.random.Generator) -> Iterator[str]:
    """Coverage within one to three recordings, of the share that the same recordings would have if they went on."""
    captures, lengths_s = (1, 2, 3), (10, 30)
    columns = tuple(f"{count} x {length} s" for length in lengths_s for count in captures)
    yield from _head("Coverage within recordings (%)", columns)
    for correlation_s in (0.2, 1.0, 3.0):
        cells = []
        for length_s in lengths_s:
            for count in captures:
                num, den, true = correlated(effort, count, length_s, correlation_s, rng)
                cells.append(covered(share(num, den, blocks=Blocks(count, length_s / 4)), true))
        yield Line(f"frames correlated over {correlation_s:g} s", tuple(cells)).text()


# From the simulator ----------------------------------------------------------------------------------------------

Study = Callable[[int], tuple[Interval, FloatArray]]


def of_scenes(counts: Counts, effort: int, rng: np.random.Generator) -> Iterator[str]:
    """Coverage on studies that are drawn from captures of the simulator: least and largest over the detectors."""
    columns = tuple(scenes for scenes in SCENES if scenes >= 4)
    sums = np.array([[part.sum() for part in row] for row in counts.errors_m])
    sizes = np.array([[float(len(part)) for part in row] for row in counts.errors_m])
    largest = np.array([[part.max(initial=0.0) for part in row] for row in counts.errors_m])
    shares = {"F1": counts.f1, "recall": (counts.tp, counts.tp + counts.fn)}
    shares |= {"precision": (counts.tp, counts.tp + counts.fp)}
    for outer in (True, False):
        word = "outer" if outer else "inner"
        for name, (num, den) in shares.items():
            cells = [_of_share(num, den, scenes, effort, rng, outer=outer) for scenes in columns]
            yield _ends(f"{name}, {word}", columns, cells, outer=outer)
        cells = [_of_error(sums, sizes, largest, scenes, effort, rng, outer=outer) for scenes in columns]
        yield _ends(f"MAE, {word}", columns, cells, outer=outer)
        cells = [_of_quantile(counts, scenes, max(effort // 8, 50), rng, outer=outer) for scenes in columns]
        yield _ends(f"P95, {word}", columns, cells, outer=outer)


def _ends(title: str, columns: tuple[int, ...], cells: list[list[float]], *, outer: bool) -> str:
    texts = []
    for scenes, per_detector in zip(columns, cells, strict=True):
        there = outer or scenes >= INNER_UNITS
        texts.append(f"{np.nanmin(per_detector):.1f}-{np.nanmax(per_detector):.1f}" if there else "–")
    return f"| {' | '.join([title, *texts])} |"


def _of_share(
    num: FloatArray, den: FloatArray, scenes: int, effort: int, rng: np.random.Generator, *, outer: bool
) -> list[float]:
    drawn = rng.integers(num.shape[1], size=(effort, scenes))
    return [
        covered(share(n[drawn], d[drawn]), np.asarray(n.sum() / d.sum()), outer=outer)
        for n, d in zip(num, den, strict=True)
    ]


def _of_error(
    sums: FloatArray,
    sizes: FloatArray,
    largest: FloatArray,
    scenes: int,
    effort: int,
    rng: np.random.Generator,
    *,
    outer: bool,
) -> list[float]:
    drawn = rng.integers(sums.shape[1], size=(effort, scenes))
    rows = zip(sums, sizes, largest, strict=True)
    return [
        covered(ratio(s[drawn], n[drawn], most=m[drawn].max(-1)), np.asarray(s.sum() / n.sum()), outer=outer)
        for s, n, m in rows
    ]


def _of_quantile(counts: Counts, scenes: int, effort: int, rng: np.random.Generator, *, outer: bool) -> list[float]:
    cells = []
    for errors_m in counts.errors_m:
        true = np.quantile(np.concatenate(errors_m), 0.95)
        drawn = rng.integers(len(errors_m), size=(effort, scenes))
        found = [quantile([errors_m[at] for at in row], 0.95) for row in drawn]
        together = Interval(*(np.array(part) for part in zip(*found, strict=True)))
        cells.append(covered(together, true, outer=outer))
    return cells


def boards_of_scenes(counts: Counts, effort: int, rng: np.random.Generator) -> Iterator[str]:
    """False differences of detectors that are equal: as they swap names scene by scene, or only on average.

    The latter are shifted to the same F1 over all captures. One that is a little better in most scenes and fails in a
    few is then equal to another, which no study sees whose scenes hold no such failure.
    """
    num, den = counts.f1
    level = (num.sum(1) / den.sum(1)).mean()
    even = num + (level - num.sum(1, keepdims=True) / den.sum(1, keepdims=True)) * den
    columns = [scenes for scenes in SCENES if scenes >= 4]
    swapped, shifted_ = [], []
    for scenes in columns:
        drawn = rng.integers(num.shape[1], size=(effort, scenes))
        boards = [np.moveaxis(part[:, drawn], 0, 1) for part in (num, den)]
        names = np.argsort(rng.random(boards[0].shape), axis=1)
        swapped.append(_differing(*(np.take_along_axis(part, names, axis=1) for part in boards)))
        shifted_.append(_differing(*(np.moveaxis(part[:, drawn], 0, 1) for part in (even, den))))
    title = f"boards of {len(num)} with any false difference"
    yield Line(f"{title}: equal, as names are swapped scene by scene", tuple(swapped)).text()
    yield Line(f"{title}: equal on average only, some by rare failures", tuple(shifted_)).text()


def _head(title: str, columns: tuple[object, ...]) -> Iterator[str]:
    yield f"\n**{title}**\n"
    yield f"| | {' | '.join(map(str, columns))} |"
    yield f"| --- |{' --- |' * len(columns)}"


def counts_of(asked: argparse.Namespace, family: str) -> Counts:
    """Counts on captures of a family: those of the file, or made and kept there."""
    kept = None if asked.counts is None else asked.counts.with_suffix(f".{family}.npz")
    if kept is not None and kept.is_file():
        return Counts.load(kept)
    counts = counted(asked.captures // len(FAMILIES), asked.seed, family, spoken=True)
    if kept is not None:
        counts.save(kept)
    return counts


def main() -> int:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few studies, and 24 captures: that everything runs")
    parser.add_argument("--captures", type=int, default=CAPTURES, metavar="N", help="captures of the simulator")
    parser.add_argument(
        "--counts", type=Path, metavar="FILE", help="keep what was found on them, or take it from there"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the scenes and of all studies")
    parser.add_argument("--studies", type=int, default=STUDIES, metavar="N", help="simulated studies of each cell")
    asked = parser.parse_args()
    asked.captures = 24 if asked.quick else asked.captures
    effort = 60 if asked.quick else asked.studies
    say = partial(print, flush=True)
    for line in of_models(effort, np.random.default_rng([asked.seed, 0])):
        say(line)
    for number, family in enumerate(FAMILIES, start=1):
        rng = np.random.default_rng([asked.seed, number])
        counts = counts_of(asked, family)
        columns = tuple(scenes for scenes in SCENES if scenes >= 4)
        title = f"{counts.tp.shape[1]} SIMULATED scenes, {family}: coverage over {len(counts.detectors)} detectors (%)"
        for line in (*_head(title, columns), *of_scenes(counts, effort, rng), *boards_of_scenes(counts, effort, rng)):
            say(line)
    return 0


if __name__ == "__main__":
    sys.exit(main())
