"""Outcomes of every kind, made up, by which metrics are checked."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from uwbbench.api.metric import Outcome
from uwbbench.api.outcomes import MapOutcome, PoseOutcome, PresenceOutcome, SegmentOutcome, TrackOutcome
from uwbbench.measure.accuracy.groups import taken

FRAMES = 200
_RATE_HZ = 48.0
_CUTOFF_M = 0.5


def outcome(
    kind: type[Outcome],
    seed: int,
    *,
    missed: float = 0.1,
    false: float = 0.1,
    bias_m: float = 0.02,
    sd_m: float = 0.05,
) -> Outcome:
    """Outcome of 200 frames, each with an object that is found or missed, and at most one false alarm.

    Parameters
    ----------
    kind : type of Outcome
        What a metric takes.
    seed : int
        Of the random numbers.
    missed : float
        Probability that the object of a frame is missed.
    false : float
        Probability of a false alarm in a frame.
    bias_m, sd_m : float
        Mean and standard deviation of the range errors of matches, which are normal; those of false alarms are uniform
        from 0.3 m to 1 m.
    """
    rng = np.random.default_rng(seed)
    tp = (rng.uniform(size=FRAMES) >= missed).astype(np.int64)
    fp = (rng.uniform(size=FRAMES) < false).astype(np.int64)
    frame = np.repeat(np.arange(FRAMES), tp + fp)
    first = np.concatenate([[True], np.diff(frame) > 0]) if len(frame) else np.empty(0, bool)
    matched = first & (tp[frame] == 1)
    plain = Outcome(
        group=np.arange(FRAMES) // 50,
        tp=tp,
        fp=fp,
        fn=1 - tp,
        error_frame=frame,
        error_m=np.where(matched, rng.normal(bias_m, sd_m, len(frame)), rng.uniform(0.3, 1.0, len(frame))),
        matched=matched,
        duration_s=FRAMES / _RATE_HZ,
    )
    return _MADE[kind](plain) if kind in _MADE else plain


def perfect(kind: type[Outcome]) -> Outcome:
    """Outcome of a detector that finds everything, where it is, and nothing else."""
    return outcome(kind, 0, missed=0.0, false=0.0, bias_m=0.0, sd_m=0.0)


def empty(kind: type[Outcome]) -> Outcome:
    """Outcome of no frames."""
    return taken(perfect(kind), np.empty(0, np.int64))


def _tracks(plain: Outcome) -> TrackOutcome:
    """One object, that is found anew by another track after every miss; every false alarm is a track of its own."""
    lost = np.concatenate([[0], plain.fn[:-1]])
    near_m = np.zeros(FRAMES)
    near_m[plain.error_frame[plain.matched]] = np.abs(plain.error_m[plain.matched])
    square_m2 = near_m**2
    wrong, larger = plain.fn + plain.fp, np.maximum(1, plain.tp + plain.fp)
    starts = np.flatnonzero(plain.tp & ((lost > 0) | (np.arange(FRAMES) == 0)))
    false = np.flatnonzero(plain.fp)
    return TrackOutcome(
        **vars(plain),
        cutoff_m=_CUTOFF_M,
        localisation_m2=square_m2,
        ospa_m=(near_m + _CUTOFF_M * wrong) / larger,
        ospa_2_m2=(square_m2 + _CUTOFF_M**2 * wrong) / larger,
        switches=plain.tp * lost,
        fragmentations=plain.tp * lost,
        object_frame=np.zeros(1, np.int64),
        delay_s=np.array([plain.tp.argmax() / _RATE_HZ + plain.fn.sum() / _RATE_HZ]),
        track_frame=np.concatenate([starts, false]),
        false_track=np.arange(len(starts) + len(false)) >= len(starts),
    )


def _segments(plain: Outcome) -> SegmentOutcome:
    """Every match covers its obstacle as far as its error lets it, every other length is a metre."""
    near_m = np.zeros(FRAMES)
    near_m[plain.error_frame[plain.matched]] = np.abs(plain.error_m[plain.matched])
    return SegmentOutcome(
        **vars(plain),
        shared_m=plain.tp.astype(float) * np.maximum(1 - near_m, 0.0),
        covered_m=plain.tp * (1 + near_m) + plain.fn + plain.fp,
    )


def _presence(plain: Outcome) -> PresenceOutcome:
    """Frames of even number are present; a false alarm is one in another frame."""
    present = np.arange(FRAMES) % 2 == 0
    said = np.where(present, plain.tp, plain.fp) > 0
    return PresenceOutcome(
        group=plain.group,
        tp=(present & said).astype(np.int64),
        fp=(~present & said).astype(np.int64),
        fn=(present & ~said).astype(np.int64),
        error_frame=np.flatnonzero(said),
        error_m=np.full(int(said.sum()), np.nan),
        matched=present[said],
        duration_s=plain.duration_s,
        present=present,
        probability=np.where(said, 0.9, 0.1),
        classes=("empty", "obstacle"),
        true_class=present.astype(np.int64),
        said_class=said.astype(np.int64),
    )


def _poses(plain: Outcome) -> PoseOutcome:
    """A run whose poses are off by the errors of the frames, and by a metre where one is missed or false."""
    off_m = (plain.fn + plain.fp).astype(np.float64)
    np.add.at(off_m, plain.error_frame[plain.matched], plain.error_m[plain.matched])
    rows = np.arange(FRAMES)
    return PoseOutcome(
        **_nothing_counted(plain, FRAMES),
        step=rows,
        aligned_m=np.abs(off_m),
        start_m=2 * np.abs(off_m),
        heading_rad=off_m,
        nees=3 + 20 * off_m**2,
        nearest_m=np.stack([off_m, off_m], axis=1) / 2,
        pair_frame=rows[:-1],
        moved_m=np.abs(off_m[1:]),
        turned_rad=off_m[1:],
    )


def _maps(plain: Outcome) -> MapOutcome:
    """A run with as many landmarks as there are frames, each a point of an outline."""
    true = plain.matched
    off_m = np.where(true, np.abs(plain.error_m), 1.0)
    one = {name: np.array([int(getattr(plain, name).sum())]) for name in ("tp", "fp", "fn")}
    facts = _nothing_counted(plain, 1) | one
    facts |= {"error_m": np.where(true, off_m, np.nan), "matched": true, "error_frame": np.zeros(len(true), np.int64)}
    missed = np.ones(int(plain.fn.sum()))
    shared = np.array([int((off_m < 0.1).sum())])
    made = MapOutcome(
        **facts,
        duplicates=one["fp"],
        shared_cells=shared,
        covered_cells=2 * one["tp"] + one["fp"] + one["fn"] - shared,
        map_frame=np.zeros(len(off_m), np.int64),
        map_m=off_m,
        true_frame=np.zeros(int(true.sum()) + len(missed), np.int64),
        true_m=np.concatenate([off_m[true], missed]),
    )
    return dataclasses.replace(made, start=made)


def _nothing_counted(plain: Outcome, rows: int) -> dict[str, Any]:
    """What every outcome holds, of a run as a whole."""
    none = np.zeros(rows, np.int64)
    nothing = {"error_frame": np.zeros(0, np.int64), "error_m": np.zeros(0), "matched": np.zeros(0, bool)}
    return {"group": none, "tp": none, "fp": none, "fn": none, **nothing, "duration_s": plain.duration_s}


_MADE: Mapping[type[Outcome], Callable[[Outcome], Outcome]] = {
    TrackOutcome: _tracks,
    SegmentOutcome: _segments,
    PresenceOutcome: _presence,
    PoseOutcome: _poses,
    MapOutcome: _maps,
}
