"""How old a detector's answers are, and what it knew at each moment.

Conventions
-----------
* Ages start from what :func:`uwbbench.detect.hand_out.with_hand_outs` finds: the frame after whose step each detection
  was handed out. A detector declares nothing.
* The *answer about a frame* is all detections of that frame. It has been given once any of them was handed out; those
  of them that come later join it then.
* A frame without detections is answered too, by "nothing there", from the step on that first named it as processed.
  That needs a detector that hands out the detections of a frame when it names the frame. One that names frames as
  processed and hands out detections of them later (on this capture at least once) cannot say "nothing there", as nobody
  can distinguish it from "nothing yet": its empty frames are no answers.
* The *latest answer* at the moment of a frame is the answer about the newest frame that has been given by then, after
  the step of that very frame. It is taken as it is, not extrapolated: its ranges and positions are held against the
  truth of the moment. A detector that has not answered yet has found nothing at that moment.
* So a detector that answers every frame at once is scored exactly as without age.
* What is handed out only at the end is never in time. Its age is counted up to the last frame of the capture.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.detections import HANDED_OUT, Detections
from uwbbench.api.errors import ScoringError


def latest_answers(found: Detections) -> Detections:
    """For each processed frame the latest answer that had been given by then, as detections of that frame.

    Parameters
    ----------
    found : Detections
        With hand-outs.

    Raises
    ------
    ScoringError
        If it is not known when the detections were handed out.
    """
    answered = found.answered
    if answered is None:
        raise ScoringError(
            "it is not known when these detections were handed out; take them from "
            "detector.run(capture, handed_out=True), or run the experiment anew where an earlier version made it"
        )
    if not len(answered):
        return found.take(np.zeros(len(found), np.bool_))
    found = found.take(np.argsort(found.frame, kind="stable"))
    moments = found.processed
    newest = _newest_answered(found, answered)
    start, stop = (np.searchsorted(found.frame, newest, side) for side in ("left", "right"))
    count = stop - start
    moment = np.repeat(moments, count)
    row = np.arange(len(moment)) + np.repeat(start - np.cumsum(count) + count, count)
    known = found[HANDED_OUT][row] <= moment
    return found.take(row[known]).with_columns(frame=moment[known])


def _newest_answered(found: Detections, answered: IntArray) -> IntArray:
    """Newest frame (processed,) that has been answered at the moment of each processed frame; -1 before the first."""
    handed_out = found[HANDED_OUT]
    filled, first_row = np.unique(found.frame, return_index=True)
    given = np.minimum.reduceat(handed_out, first_row) if len(filled) else np.empty(0, np.int64)
    frame = filled
    place = np.minimum(np.searchsorted(found.processed, found.frame), len(answered) - 1)
    if np.all(handed_out <= answered[place]):
        bare = ~np.isin(found.processed, filled)
        frame = np.concatenate([filled, found.processed[bare]])
        given = np.concatenate([given, answered[bare]])
    order = np.argsort(given, kind="stable")
    newest = np.concatenate([[-1], np.maximum.accumulate(frame[order])])
    return np.asarray(newest[np.searchsorted(given[order], found.processed, side="right")])


def age_summary(found: Detections, timestamp_s: FloatArray, times_us: FloatArray) -> dict[str, Any] | None:
    """How long after the arrival of its frame a detection was handed out.

    Parameters
    ----------
    found : Detections
        With hand-outs.
    timestamp_s : (frames,) array
        When each frame of the stream arrived.
    times_us : (frames,) array
        How long the call of each frame took.

    Returns
    -------
    dict or None
        Over the detections (``n``): ``p50_frames``, ``p95_frames`` and ``max_frames``, the frames that arrived after
        their own up to the hand-out; ``p50_s`` and ``p95_s``, the time between these two frames plus that of the call
        that handed them out; ``end_share``, the share that came only at the end. None without detections, or where it
        is not known when they were handed out.
    """
    if found.answered is None or not len(found):
        return None
    last = len(timestamp_s) - 1
    handed_out = found[HANDED_OUT]
    after = np.minimum(handed_out, last)
    frames = after - found.frame
    age_s = timestamp_s[after] - timestamp_s[found.frame] + times_us[after] * 1e-6
    return {
        "n": len(found),
        "p50_frames": float(np.percentile(frames, 50)),
        "p95_frames": float(np.percentile(frames, 95)),
        "max_frames": int(frames.max()),
        "p50_s": float(np.percentile(age_s, 50)),
        "p95_s": float(np.percentile(age_s, 95)),
        "end_share": float(np.mean(handed_out > last)),
    }
