"""The leaderboard cut by channel, material and range, each cut with its own intervals.

Conventions
-----------
* A frame belongs to the range bin of its nearest visible obstacle; frames with nothing in view are in no bin, and only
  in the row of all ranges.
* Bins have one width in a run, so that datasets can be read side by side.
* Channels and materials are those of whole captures. Cuts by more than one of channel, material and range have no
  intervals: there are many of them, and few frames in each.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Metric, Outcome
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.stats import Estimate, estimated, evaluate, samples_behind, subset
from uwbbench.results.results import Scored, errors_in, scenes_of

WIDTHS_M = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
MOST_BINS = 8
"""The narrowest width is taken that needs no more bins than this."""

ALL = ""
"""Value of a cut that takes everything."""

Board = tuple[str, str, str, str]
"""Dataset, source, scoring and table: numbers of different boards are never combined."""


@dataclass(frozen=True)
class Slice:
    """One detector on part of a board.

    Attributes
    ----------
    board : Board
    channel, material, span : str
        The cut; :data:`ALL` where it takes everything.
    detector : str
    captures, frames : int
        Captures that have scored frames in this cut, and those frames.
    hits, errors : int
        True positives, and detections that have an error.
    estimates : mapping of str to Estimate
    """

    board: Board
    channel: str
    material: str
    span: str
    detector: str
    captures: int
    frames: int
    hits: int
    errors: int
    estimates: Mapping[str, Estimate]


def range_edges_m(scored: Sequence[Scored]) -> FloatArray:
    """Edges (bins + 1,) of the range bins; none where nothing is ever visible."""
    known = [one.range_m[np.isfinite(one.range_m)] for one in scored]
    low = min((float(part.min()) for part in known if len(part)), default=math.nan)
    high = max((float(part.max()) for part in known if len(part)), default=math.nan)
    if math.isnan(low):
        return np.empty(0)
    for width in WIDTHS_M:
        first, last = math.floor(low / width), math.floor(high / width) + 1
        if last - first <= MOST_BINS:
            break
    return np.asarray(np.arange(first, last + 1) * width, np.float64)


def span_name(near_m: float, far_m: float) -> str:
    """Name of a range bin.

    Examples
    --------
    >>> span_name(0.5, 1.0)
    '0.5 to 1 m'
    """
    return f"{near_m:g} to {far_m:g} m"


def slices(
    scored: Sequence[Scored],
    metrics: MetricChoice,
    edges_m: FloatArray,
    settings: Mapping[str, Any],
    known: Mapping[tuple[Board, str], Mapping[str, Estimate]],
) -> Iterator[Slice]:
    """Every cut of every board, for every detector.

    Parameters
    ----------
    scored : sequence of Scored
    metrics : MetricChoice
    edges_m : (bins + 1,) array
    settings : mapping
        ``confidence`` of the intervals.
    known : mapping
        Estimates of whole boards, by board and detector, which are there already.
    """
    boards: dict[Board, list[Scored]] = defaultdict(list)
    for one in scored:
        boards[one.dataset, one.source, one.scoring, one.table].append(one)
    for board, members in boards.items():
        parts, scene = {id(one): _spans(one, edges_m) for one in members}, scenes_of(members)
        for (channel, material), (same, chosen) in cuts(members).items():
            if same != (channel, material):
                continue
            groups: dict[tuple[str, str], list[tuple[Outcome, str]]] = defaultdict(list)
            for one in chosen:
                groups[one.detector, ALL].append((one.outcome, scene[one.capture]))
                for span, outcome in parts[id(one)].items():
                    groups[one.detector, span].append((outcome, scene[one.capture]))
            for (detector, span), held in groups.items():
                outcomes, scenes = [outcome for outcome, _ in held], [name for _, name in held]
                several = (channel, material, span).count(ALL) < 2
                if (channel, material, span) == (ALL, ALL, ALL):
                    estimates = known[board, detector]
                else:
                    estimates = {
                        name: _bare(metric, outcomes, scenes)
                        if several
                        else estimated(metric, outcomes, scenes, confidence=settings["confidence"])
                        for name, metric in metrics.of(board[2]).items()
                    }
                frames = sum(len(outcome.group) for outcome in outcomes)
                hits = sum(int(outcome.tp.sum()) for outcome in outcomes)
                counts = (len(outcomes), frames, hits, errors_in(outcomes))
                yield Slice(board, channel, material, span, detector, *counts, estimates)


def _bare(metric: type[Metric], outcomes: Sequence[Outcome], scenes: Sequence[str]) -> Estimate:
    """Value without an interval."""
    value = evaluate(metric, outcomes)
    return Estimate(value, math.nan, math.nan, samples_behind(metric, outcomes, value), len(set(scenes)))


def cuts(members: Sequence[Scored]) -> dict[tuple[str, str], tuple[tuple[str, str], list[Scored]]]:
    """Cuts of a board by channel and material that hold captures.

    Returns
    -------
    dict
        By channel and material: the widest cut that holds the same captures, and what was scored on them.
    """
    channels = sorted({channel_name(one.channel) for one in members})
    materials = sorted({one.material for one in members})
    widest: dict[frozenset[int], tuple[str, str]] = {}
    kept = {}
    for channel in [ALL, *channels]:
        for material in [ALL, *materials]:
            chosen = [
                one
                for one in members
                if channel in (ALL, channel_name(one.channel)) and material in (ALL, one.material)
            ]
            if chosen:
                same = widest.setdefault(frozenset(map(id, chosen)), (channel, material))
                kept[channel, material] = same, chosen
    return kept


def channel_name(channel: int | None) -> str:
    """Name of a channel."""
    return "none" if channel is None else str(channel)


def _spans(scored: Scored, edges_m: FloatArray) -> dict[str, Outcome]:
    """Outcome in each range bin in which there are frames; none where a run has one bin."""
    bins = len(edges_m) - 1
    if bins < 2:
        return {}
    number = np.where(np.isfinite(scored.range_m), np.digitize(scored.range_m, edges_m) - 1, -1)
    inside = {place: number == place for place in range(bins)}
    return {
        span_name(edges_m[place], edges_m[place + 1]): subset(scored.outcome, rows)
        for place, rows in inside.items()
        if rows.any()
    }
