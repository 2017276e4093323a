"""Detectors against physical limits, from a run over the ``limits`` dataset.

Conventions
-----------
* Truth and signal-to-noise ratio of these test signals are exact. SNR is the power of an echo's crest over that of the
  complex noise of one tap, behind a receiver matched to the pulse.
* An echo is *found* if a detection of its frame lies within :data:`GATE_M` of its range; the error is that of the
  nearest such detection. Errors are therefore conditional on being found: read them with the probability beside.
* Accuracy, detection against SNR and false alarms are taken in the *clear* span :data:`CLEAR_M`, away from the direct
  path and from the last taps.
* Detectors that report every cell over a threshold, and not one detection an echo, are asked for false alarms only.
* Frames of these captures are independent: places, phases and noise are drawn anew for each. Shares of frames have
  exact binomial intervals. Cells of one frame are not independent, since the noise is correlated over taps, cells share
  training cells, and a detector may scale a frame by what it holds: rates a cell have intervals over frames
  (:func:`~uwbbench.measure.accuracy.stats.clustered_proportion`). A detector that carries a background from frame to
  frame ties frames together a little; no interval allows for that.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api import registry
from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S
from uwbbench.measure.accuracy.stats import clopper_pearson, clustered_proportion
from uwbbench.run.folder.folder import RunFolder

if TYPE_CHECKING:
    import pandas as pd

SYMBOL_S, ROLL_OFF = 2.0e-9, 0.5
"""Root-raised-cosine pulse of the dataset (IEEE 802.15.4 HRP reference)."""
GATE_M = 0.20
CLEAR_M = (2.0, 5.5)
RANGE_EDGES_M = (0.2, 0.6, 1.0, 2.0, 4.0, 6.0)
BLIND_STEP_M, BLIND_UP_TO_M = 0.10, 2.0


def rms_bandwidth_hz(symbol_s: float = SYMBOL_S, roll_off: float = ROLL_OFF) -> float:
    """Root-mean-square bandwidth of a root-raised-cosine pulse.

    ``(1/T) sqrt(1/12 + b^2 (1/4 - 2/pi^2))``, the second moment of the raised-cosine power spectrum: 154.25 MHz for
    T = 2 ns and roll-off b = 0.5, against 144.3 MHz of a rectangular 500 MHz spectrum.

    Parameters
    ----------
    symbol_s, roll_off : float

    Examples
    --------
    >>> round(rms_bandwidth_hz() / 1e6, 2), round(rms_bandwidth_hz(roll_off=0.0) / 1e6, 1)
    (154.25, 144.3)
    """
    return math.sqrt(1 / 12 + roll_off**2 * (1 / 4 - 2 / math.pi**2)) / symbol_s


def cramer_rao_range_m(snr_db: float) -> float:
    """Smallest standard deviation of an unbiased range estimate from one echo of unknown amplitude and phase.

    ``c / 2 * 1 / (2 pi B sqrt(2 SNR))`` with the root-mean-square bandwidth B (Kay, Fundamentals of Statistical Signal
    Processing: Estimation Theory, 1993, section 3.11, for a complex envelope).

    Parameters
    ----------
    snr_db : float
        Power of the echo's crest over that of the complex noise, behind the matched filter.

    Returns
    -------
    float
        In metres of range, half the path.

    Examples
    --------
    >>> [round(100 * cramer_rao_range_m(snr_db), 2) for snr_db in (10, 20, 30)]
    [3.46, 1.09, 0.35]
    """
    return SPEED_OF_LIGHT_M_S / (4 * math.pi * rms_bandwidth_hz() * math.sqrt(2 * 10 ** (snr_db / 10)))


@dataclass(frozen=True)
class Trial:
    """One detector on all captures of one test signal.

    Attributes
    ----------
    detector, scene : str
    snr_db : float
    separation_ns : float or None
    captures : tuple of (CaptureHeader, Detections)
    """

    detector: str
    scene: str
    snr_db: float
    separation_ns: float | None
    captures: tuple[tuple[CaptureHeader, Detections], ...]

    @cached_property
    def range_m(self) -> FloatArray:
        """True range (frames, echoes)."""
        return np.concatenate([_true_range_m(header) for header, _ in self.captures])

    @cached_property
    def error_m(self) -> FloatArray:
        """Error (frames, echoes) of the nearest detection; NaN where the frame has none."""
        return np.concatenate([_nearest_error_m(found, _true_range_m(header)) for header, found in self.captures])

    def proportion(self, hits: BoolArray, among: BoolArray) -> dict[str, Any]:
        """Share of the frames ``among`` that are ``hits``, with its interval."""
        count, frames = int(np.sum(hits & among)), int(np.sum(among))
        low, high = clopper_pearson(count, frames)
        return {"share": count / frames if frames else math.nan, "low": low, "high": high, "n": frames}


def _true_range_m(header: CaptureHeader) -> FloatArray:
    """True range (frames, echoes)."""
    objects = header.truth.objects if header.truth is not None else ()
    columns = [np.linalg.norm(obstacle.outline_m[:, 0], axis=-1) for obstacle in objects]
    return np.stack(columns, axis=1) if columns else np.empty((len(header), 0))


def _nearest_error_m(found: Detections, true_m: FloatArray) -> FloatArray:
    """Error (frames, echoes) of the detection nearest to each echo; NaN where the frame has none."""
    error_m = np.full(true_m.shape, np.nan)
    for echo in range(true_m.shape[1]):
        off_m = found.range_m - true_m[found.frame, echo]
        order = np.argsort(-np.abs(off_m), kind="stable")  # the nearest is written last
        error_m[found.frame[order], echo] = off_m[order]
    return error_m


class Limits:
    """Numbers of a run over the ``limits`` dataset.

    Parameters
    ----------
    folder : RunFolder

    Raises
    ------
    StoreError
        If something stored is missing or broken.
    """

    def __init__(self, folder: RunFolder) -> None:
        self.folder = folder
        self._configs = {config["name"]: config for config in folder.manifest["experiment"]["detectors"]}

    @cached_property
    def datasets(self) -> dict[str, dict[str, Any]]:
        """Parameters of each dataset of test signals, by its label; none in any other run."""
        used = self.folder.manifest["experiment"]["datasets"]
        signals = registry.default("dataset.limits")
        return {one["label"]: one["params"] for one in used if one["use"] == signals}

    @cached_property
    def trials(self) -> list[Trial]:
        """Every detector on every test signal, in the order of the experiment."""
        params = self.datasets
        entries = [
            e for e in self.folder.entries() if (e.kind, e.status) == ("accuracy", "done") and e.dataset in params
        ]
        captures: dict[tuple[str, str], list[tuple[CaptureHeader, Detections]]] = defaultdict(list)
        for entry in entries:
            read = self.folder.header(entry.capture_id), self.folder.detections(entry.unit)
            captures[entry.detector, entry.dataset].append(read)
        return [
            Trial(
                detector=detector,
                scene=signal["scene"],
                snr_db=float(signal["snr_db"]),
                separation_ns=signal.get("separation_ns"),
                captures=tuple(captures[detector, label]),
            )
            for detector in self._configs
            for label, signal in params.items()
            if (detector, label) in captures
        ]

    @cached_property
    def accuracy(self) -> pd.DataFrame:
        """Range error of each detector against the Cramer-Rao bound, in the clear span."""
        return self._table("echo", _accuracy)

    @cached_property
    def detection(self) -> pd.DataFrame:
        """Probability of detection by range and signal-to-noise ratio."""
        return self._table("echo", _detection)

    @cached_property
    def blind_zone(self) -> pd.DataFrame:
        """Radius around the receiver inside which echoes are found less than half as often as in the clear span."""
        return self._table("echo", _blind_zone)

    @cached_property
    def resolution(self) -> pd.DataFrame:
        """How often two equal echoes are resolved."""
        return self._table("pair", _resolution)

    @cached_property
    def false_alarms(self) -> pd.DataFrame:
        """False alarms of a cell of noise, measured and, for CFAR detectors, requested."""
        return self._table("noise", self._false_alarms)

    def _table(self, scene: str, rows: Callable[[Trial], Iterator[dict[str, Any]]]) -> pd.DataFrame:
        import pandas as pd

        chosen = [trial for trial in self.trials if trial.scene == scene]
        if scene != "noise":
            chosen = [trial for trial in chosen if not self._reports_cells(trial.detector)]
        return pd.DataFrame([row for trial in chosen for row in rows(trial)])

    def _reports_cells(self, detector: str) -> bool:
        """Whether it reports every cell over a threshold: several for an echo, which says nothing about accuracy."""
        return any(step["params"].get("cells") == "all" for step in self._configs[detector]["pipeline"])

    def _false_alarms(self, trial: Trial) -> Iterator[dict[str, Any]]:
        radar = trial.captures[0][0].radar
        cell_m = SPEED_OF_LIGHT_M_S * radar.sample_interval_s / 2
        cells = int(np.sum(_clear(cell_m * np.arange(radar.taps, dtype=np.float64))))
        alarms = np.concatenate([_alarms(found) for _, found in trial.captures])
        frames = len(alarms)
        low, high = clustered_proportion(alarms, cells)
        total, n = int(alarms.sum()), frames * cells
        rate = {"share": total / n if n else math.nan, "low": low, "high": high, "n": n}
        requested, condition = self._requested(trial.detector, radar.channel)
        yield {"detector": trial.detector, **rate, "requested": requested, "condition": condition, "alarms": total}

    def _requested(self, detector: str, channel: int | None) -> tuple[float, str]:
        """False-alarm rate that a detector asks of its CFAR stage, and what for; NaN where it has none."""
        for step in self._configs[detector]["pipeline"]:
            rate = step["params"].get("false_alarm_rate")
            if rate is not None:
                by_channel = rate.get("by_channel", {}) if isinstance(rate, dict) else {}
                value = by_channel.get(str(channel), by_channel.get("other", math.nan)) if by_channel else rate
                return float(
                    value
                ), f"{step['params'].get('cells', 'maxima')}, {step['params'].get('noise', 'independent')}"
        return math.nan, ""

    def to_dict(self) -> dict[str, Any]:
        """All tables as plain rows; empty where the run has no test signals."""
        names = ("accuracy", "detection", "blind_zone", "resolution", "false_alarms")
        return {name: getattr(self, name).to_dict("records") for name in names} if self.trials else {}


def _clear(range_m: FloatArray) -> BoolArray:
    return np.asarray((range_m >= CLEAR_M[0]) & (range_m <= CLEAR_M[1]))


def _alarms(found: Detections) -> IntArray:
    """Detections (processed frames,) in the clear span of each frame."""
    row = np.searchsorted(found.processed, found.frame[_clear(found.range_m)])
    return np.bincount(row, minlength=len(found.processed)).astype(np.int64)


def _accuracy(trial: Trial) -> Iterator[dict[str, Any]]:
    clear = _clear(trial.range_m[:, 0])
    error_m = trial.error_m[:, 0]
    detected = np.abs(error_m) <= GATE_M
    kept = error_m[clear & detected]
    bound_m = cramer_rao_range_m(trial.snr_db)
    rmse_m = float(np.sqrt(np.mean(kept**2))) if len(kept) else math.nan
    bias_m = float(np.mean(kept)) if len(kept) else math.nan
    facts = {"rmse_m": rmse_m, "bias_m": bias_m, "bound_m": bound_m, "ratio": rmse_m / bound_m}
    yield {"detector": trial.detector, "snr_db": trial.snr_db, **trial.proportion(detected, clear), **facts}


def _detection(trial: Trial) -> Iterator[dict[str, Any]]:
    range_m = trial.range_m[:, 0]
    detected = np.abs(trial.error_m[:, 0]) <= GATE_M
    for near, far in itertools.pairwise(RANGE_EDGES_M):
        inside = (range_m >= near) & (range_m < far)
        about = {"detector": trial.detector, "snr_db": trial.snr_db, "near_m": near, "far_m": far}
        yield {**about, **trial.proportion(detected, inside)}


def _blind_zone(trial: Trial) -> Iterator[dict[str, Any]]:
    """Far edge of the last step of range, counted outwards, with less than half the detections of the clear span."""
    steps = round(BLIND_UP_TO_M / BLIND_STEP_M)
    step: IntArray = np.floor(trial.range_m[:, 0] / BLIND_STEP_M).astype(np.int64)
    near = step < steps
    detected = np.abs(trial.error_m[:, 0]) <= GATE_M
    echoes = np.bincount(step[near], minlength=steps)
    hits = np.bincount(step[near & detected], minlength=steps)
    usual = float(np.mean(detected[_clear(trial.range_m[:, 0])]))
    missed = np.flatnonzero(2 * hits < usual * echoes)
    radius_m = float(missed[-1] + 1) * BLIND_STEP_M if len(missed) else 0.0
    defined = usual > 0 and radius_m < BLIND_UP_TO_M
    yield {"detector": trial.detector, "snr_db": trial.snr_db, "radius_m": radius_m if defined else math.nan}


def _resolution(trial: Trial) -> Iterator[dict[str, Any]]:
    """Both echoes of a pair are found, each nearer than half their distance, so by two detections."""
    apart_m = (trial.range_m[:, 1] - trial.range_m[:, 0])[:, None]
    resolved = np.asarray((np.abs(trial.error_m) < np.minimum(apart_m / 2, GATE_M)).all(axis=1))
    clear = np.asarray(_clear(trial.range_m).all(axis=1))
    about = {"detector": trial.detector, "snr_db": trial.snr_db, "separation_ns": trial.separation_ns}
    yield {**about, **trial.proportion(resolved, clear)}
