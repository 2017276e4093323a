"""Deadlines: how many frames the head answers later than the next one comes, at the radar's rate, on this machine."""

from __future__ import annotations

import numpy as np

from uwbbench.config.source import CaptureRef
from uwbbench.measure.latency.latency import miss_summary
from uwbbench.tools.gate.check import Check, GateVerdict
from uwbbench.tools.gate.config import DeadlineModel, Gate
from uwbbench.tools.gate.link import join, worker_of


def deadline_checks(gate: Gate, settings: DeadlineModel, label: str, ref: CaptureRef) -> list[Check]:
    """Share of missed deadlines with its exact bounds, and the longest burst, on one capture.

    More frames are measured as long as the bounds hold the limit, up to ``patience`` times as many.

    Parameters
    ----------
    gate : Gate
    settings : DeadlineModel
    label : str
        Name of the capture, for people.
    ref : CaptureRef

    Returns
    -------
    list of Check
        The share, and the longest burst where it is limited.

    Raises
    ------
    SetUpError
        If the head cannot be measured.
    """
    most = settings.frames * settings.patience
    timeout_s = gate.model.timeout_s + (most / settings.rate_hz if settings.rate_hz else 0.0)
    with worker_of(gate.head, timeout_s) as worker:
        joined = join(worker, "head", gate.head, ref, most, settings.warmup_windows)
        rate_hz = settings.rate_hz or joined["frame_rate_hz"]
        found_us = np.empty(0)
        while True:
            answer = worker.ask("respond", player="head", count=settings.frames, rate_hz=rate_hz, paced=settings.paced)
            found_us = np.append(found_us, answer["responses_us"])
            missed = miss_summary(found_us, 1e6 / rate_hz)
            verdict = share_verdict(missed["missed"], missed["missed_share_low"], missed["missed_share_high"], settings)
            if verdict is not GateVerdict.INCONCLUSIVE or len(found_us) >= most:
                break
    name = f"{label}, SIMULATED" if joined["source"] == "simulated" else label
    how = "paced" if settings.paced else "one by one"
    name += f", {rate_hz:g} frames/s, {how}"
    share = Check(
        kind="deadline",
        name=f"deadlines on {name}",
        verdict=verdict,
        quantity="missed",
        value=missed["missed_share"],
        low=missed["missed_share_low"],
        high=missed["missed_share_high"],
        n=len(found_us),
        counted=f"frames, p50 {np.median(found_us):.0f} us, longest burst {missed['longest_burst']}",
        unit="share",
        limit=settings.maximum_missed_share,
        reason=_REASONS.get(verdict, ""),
        advice=_ADVICE.get(verdict, ""),
    )
    if settings.maximum_burst is None:
        return [share]
    burst = missed["longest_burst"]
    exceeded = burst > settings.maximum_burst
    return [
        share,
        Check(
            kind="deadline",
            name=f"longest burst on {name}",
            verdict=GateVerdict.REGRESSION if exceeded else GateVerdict.PASS,
            quantity="missed in a row",
            value=burst,
            n=len(found_us),
            counted="frames",
            unit="frames",
            limit=settings.maximum_burst,
            reason="too many deadlines missed in a row" if exceeded else "",
            advice=_ADVICE[GateVerdict.REGRESSION] if exceeded else "",
        ),
    ]


def share_verdict(missed: int, low: float, high: float, settings: DeadlineModel) -> GateVerdict:
    """Verdict on a share of missed deadlines; where none is allowed, none seen is all that can be asked for.

    Parameters
    ----------
    missed : int
        Missed deadlines.
    low, high : float
        Bounds of their share.
    settings : DeadlineModel
    """
    if low > settings.maximum_missed_share:
        return GateVerdict.REGRESSION
    none_allowed = settings.maximum_missed_share == 0 and missed == 0
    return GateVerdict.PASS if high <= settings.maximum_missed_share or none_allowed else GateVerdict.INCONCLUSIVE


_REASONS = {
    GateVerdict.REGRESSION: "more deadlines missed than allowed",
    GateVerdict.INCONCLUSIVE: "too few frames to say on which side of its limit the share is",
}
_ADVICE = {
    GateVerdict.REGRESSION: "make the head faster, or gate on the machine that the radar will have",
    GateVerdict.INCONCLUSIVE: "raise deadline.frames or deadline.patience",
}
