"""One frame as a detector sees it: the response, its peaks, and what each filter made of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError
from uwbbench.detect.pipeline import Pipeline
from uwbbench.results.delay import delay_of_range, zero_tap
from uwbbench.show.figures import style
from uwbbench.show.figures.source import from_capture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLOOR_DB = -80.0
DOTTED_TAPS, CROWDED_PEAKS = 200, 40
"""Up to here taps have dots of their own, and from here on peaks have smaller marks."""


def draw_cir(capture: Capture, detector: Pipeline, frame: int | None = None) -> Figure:
    """Draw one frame with first path, peaks, prominences, widths and noise floor.

    Parameters
    ----------
    capture : Capture
    detector : Pipeline
    frame : int, optional
        Frame; by default the one nearest to the middle of the capture in which the detector found something.

    Raises
    ------
    ConfigError
        If the capture has no such frame, or it is invalid.
    """
    result = from_capture(capture, detector)
    frame = _chosen(capture, result.detections, frame)
    block = next(b for b in detector.signals(capture) if b.frames.first <= frame < b.frames.first + len(b.frames))
    row = frame - block.frames.first
    if not block.frames.valid[row]:
        raise ConfigError(f"capture '{capture.name}': frame {frame} holds samples that are not finite")
    peaks = result.candidates.take(result.candidates.frame == frame)
    zero = float(zero_tap(block, capture.radar)[0][row])
    interval_ns = capture.radar.sample_interval_s * 1e9

    with style.styled():
        drawn = style.figure(style.PAGE_IN, 4.4)
        upper, lower = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        curve, start, name = _searched(block, row)
        all_ns = np.asarray((np.arange(capture.radar.taps) - zero) * interval_ns, np.float64)
        delay_ns = all_ns[start:]
        amplitude = block.frames.amplitude[row]
        reference = float(amplitude.max()) or 1.0
        dots = {"marker": ".", "ms": 2.5} if len(curve) <= DOTTED_TAPS else {}
        handles: list[Any] = upper.plot(delay_ns, curve, color=style.BLACK, **dots)
        labels = ["response"]
        lower.plot(all_ns, _decibels(amplitude, reference), color=style.BLACK, **dots)
        if all_ns[0] <= 0.0 <= all_ns[-1]:
            lower.axvline(0.0, color=style.BLUE, ls="--")
            handles.append(upper.axvline(0.0, color=style.BLUE, ls="--"))
            labels.append("first path")
        if block.noise_rms is not None and block.noise_rms[row] > 0:
            level = _decibels(block.noise_rms[row : row + 1], reference)[0]
            handles.append(lower.axhline(level, color=style.GREEN, ls=":", lw=1.4))
            labels.append("noise floor (RMS)")
        measures = _measures(upper, peaks, curve, start, delay_ns)
        peaks_ns = (peaks["tap"] - zero) * interval_ns
        marks = _marks(upper, result.detections.chain, peaks, peaks_ns, _at(curve, peaks["tap"] - start))
        _marks(lower, result.detections.chain, peaks, peaks_ns, _decibels(_at(amplitude, peaks["tap"]), reference))
        for artist, label in [*measures, *marks]:
            handles.append(artist)
            labels.append(label)
        upper.set_ylabel(name)
        upper.set_ylim(min(0.0, float(curve.min())), float(curve.max()) * 1.08 or 1.0)
        lower.set_ylabel("Amplitude (dB)")
        origin = "from transmission" if capture.radar.first_tap_delay_s is not None else "behind the first path"
        lower.set_xlabel(f"Delay {origin} (ns)")
        lower.set_xlim(all_ns[0], all_ns[-1])
        _range_axis(upper, capture, all_ns)
        style.legend(upper, handles, labels, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
        time_s = capture.trajectory.timestamp_s[frame] - capture.trajectory.timestamp_s[0]
        where = f"Frame {frame} of {len(capture)}, {time_s:.2f} s after the first; dB relative to its strongest tap."
        style.caption(drawn, [result.subject, where])
    return drawn


def _chosen(capture: Capture, detections: Detections, frame: int | None) -> int:
    if not len(capture):
        raise ConfigError(f"capture '{capture.name}' has no frames")
    if frame is None:
        known = np.unique(detections.frame) if len(detections) else detections.processed
        if not len(known):
            raise ConfigError(f"capture '{capture.name}' has no valid frame")
        return int(known[np.argmin(np.abs(known - len(capture) // 2))])
    if not 0 <= frame < len(capture):
        raise ConfigError(f"capture '{capture.name}' has frames 0 to {len(capture) - 1}, not {frame}")
    return frame


def _searched(block: Block, row: int) -> tuple[FloatArray, int, str]:
    """Curve (taps,) that the detector searches, the tap it starts at, and its name."""
    amplitude = block.frames.amplitude[row]
    if block.profile is None:
        return amplitude, 0, "Amplitude (as stored)"
    curve, start = block.profile[row], block.profile_start
    same = np.array_equal(curve, amplitude[start:])
    return curve, start, "Amplitude (as stored)" if same else "Profile searched (no unit)"


def _decibels(amplitude: FloatArray, reference: float) -> FloatArray:
    """Amplitude in dB, no lower than the floor."""
    return np.asarray(20 * np.log10(np.maximum(amplitude / reference, 10 ** (FLOOR_DB / 20))))


def _at(curve: FloatArray, place: FloatArray) -> FloatArray:
    """Value of the curve at the tap nearest to each place (n,): interpolation may have moved a peak off the grid."""
    return np.asarray(curve[np.clip(np.rint(place).astype(int), 0, len(curve) - 1)])


def _measures(
    axes: Axes, peaks: Detections, curve: FloatArray, start: int, delay_ns: FloatArray
) -> list[tuple[Any, str]]:
    """Draw the prominence of each peak as an upright line, and its width as a level one at half prominence."""
    if "prominence" not in peaks or not len(peaks):
        return []
    height = _at(curve, peaks["tap"] - start)
    place = np.clip(np.rint(peaks["tap"]).astype(int) - start, 0, len(curve) - 1)
    prominence = peaks["prominence"]
    drawn: list[tuple[Any, str]] = [
        (axes.vlines(delay_ns[place], height - prominence, height, color=style.ORANGE, lw=1.4, zorder=3), "prominence")
    ]
    if "width_taps" in peaks:
        level = height - prominence / 2
        crossing = np.array([_crossing(curve, peak, at) for peak, at in zip(place, level, strict=True)])
        interval_ns = delay_ns[1] - delay_ns[0]
        left_ns = delay_ns[0] + crossing * interval_ns
        right_ns = left_ns + peaks["width_taps"] * interval_ns
        level_lines = axes.hlines(level, left_ns, right_ns, color=style.PURPLE, lw=1.4, zorder=3)
        drawn.append((level_lines, "width at half prominence"))
    return drawn


def _crossing(curve: FloatArray, peak: int, level: float) -> float:
    """Place left of a peak where the curve first falls to a level, by linear interpolation."""
    below = np.flatnonzero(curve[:peak] <= level)
    if not len(below):
        return 0.0
    at = int(below[-1])
    rise = curve[at + 1] - curve[at]
    return at + float((level - curve[at]) / rise) if rise > 0 else float(at)


def _marks(
    axes: Axes, chain: Iterable[str], peaks: Detections, delay_ns: FloatArray, height: FloatArray
) -> list[tuple[Any, str]]:
    """Mark each peak by the filter that dropped it, or as kept."""
    drawn: list[tuple[Any, str]] = []
    size = 4.5 if len(peaks) < CROWDED_PEAKS else 3.0
    dropping = [(place, label) for place, label in enumerate(chain) if (peaks["rejected_by"] == place).any()]
    for number, (place, label) in enumerate(dropping):
        rows = peaks["rejected_by"] == place
        marker = style.MARKERS[1 + number % (len(style.MARKERS) - 1)]
        look: dict[str, Any] = {"marker": marker, "color": style.GREY, "mfc": "white", "mew": 0.7, "ls": "none"}
        drawn.append((axes.plot(delay_ns[rows], height[rows], ms=size, zorder=4, **look)[0], f"dropped by {label}"))
    kept = peaks["retained"] == 1
    if kept.any():
        dots = axes.plot(delay_ns[kept], height[kept], "o", color=style.VERMILION, ms=size + 1, zorder=5)
        drawn.append((dots[0], "kept"))
    return drawn


def _range_axis(axes: Axes, capture: Capture, delay_ns: FloatArray) -> None:
    """Second axis on top: ranges on boresight."""
    farthest = capture.radar.window_m
    step = next((s for s in (0.5, 1.0, 2.0, 5.0, 10.0) if farthest / s <= 12), 20.0)
    range_m = np.arange(0.0, farthest, step)
    ticks = delay_of_range(capture.radar, range_m) * 1e9
    inside = (ticks >= delay_ns[0]) & (ticks <= delay_ns[-1])
    top = axes.secondary_xaxis("top")
    top.set_xticks(ticks[inside], [f"{value:g}" for value in range_m[inside]])
    top.set_xlabel("Range on boresight (m)")
