"""The paper's detector and mapping (arXiv 2512.01018) as a user would write them: SciPy, frame by frame.

The reference of the speed targets. Written as one writes such a script with care: nothing is computed twice, the
prominences are handed on to the widths, and all filters are one mask.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import find_peaks, peak_prominences, peak_widths
from sklearn.cluster import DBSCAN

from uwbbench.api import SPEED_OF_LIGHT_M_S, Capture, ComplexArray, Frames, Radar

MINIMUM_PROMINENCE = {5: 0.05, 9: 0.03}
MINIMUM_WIDTH = {5: 1.0, 9: 0.20}
MINIMUM_SCORE_DB = {5: 20.0, 9: 10.0}
MAXIMUM_PDOA_RAD = 2.1325
GAIN_DB_PER_NS = 0.20
SEARCH_TAPS, GUARD_TAPS = 6, 1
EPS_M, MIN_SAMPLES, EVERY = 0.20, 20, 50


@dataclass
class Found:
    """The peak kept of one frame."""

    tap: int
    amplitude: float
    prominence: float
    width_taps: float
    score_db: float
    range_m: float
    pdoa_rad: float = 0.0


@dataclass
class Detector:
    """Strongest filtered peak of each frame, and its range: at boresight, or along its azimuth where it is located."""

    radar: Radar
    located: bool = False

    def detect(self, cir: ComplexArray) -> Found | None:
        """Look at one frame without STS."""
        return self._strongest(cir, None)

    def detect_with_sts(
        self, cir: ComplexArray, sts1: ComplexArray, sts2: ComplexArray, first: float, first1: float, first2: float
    ) -> Found | None:
        """Look at one frame whose device reports the first path of each of its responses."""
        return self._strongest(cir, (sts1, sts2, first1 - first, first2 - first))

    def _strongest(
        self, cir: ComplexArray, sts: tuple[ComplexArray, ComplexArray, float, float] | None
    ) -> Found | None:
        radar, channel = self.radar, self.radar.channel
        start, sample_ns = radar.noise_taps, radar.sample_interval_s * 1e9
        amplitude = np.abs(cir)
        noise = np.sqrt(np.mean(amplitude[:start] ** 2))
        first_path = start + np.argmax(amplitude[start : start + SEARCH_TAPS])

        signal = amplitude[start:]
        lowest = signal.min()
        profile = (signal - lowest) / (signal.max() - lowest)
        peaks, _ = find_peaks(profile)
        prominences, left_bases, right_bases = peak_prominences(profile, peaks)
        widths = peak_widths(profile, peaks, rel_height=0.5, prominence_data=(prominences, left_bases, right_bases))[0]
        taps = peaks + start
        scores = 20 * np.log10(amplitude[taps] / noise) + GAIN_DB_PER_NS * (taps - first_path) * sample_ns
        keep = (
            (taps > first_path + GUARD_TAPS)
            & (prominences >= MINIMUM_PROMINENCE[channel])
            & (widths >= MINIMUM_WIDTH[channel])
            & (scores >= MINIMUM_SCORE_DB[channel])
        )
        if sts is not None:
            pdoa = self._pdoa(taps, *sts)
            keep &= np.abs(pdoa) <= MAXIMUM_PDOA_RAD
        kept = np.flatnonzero(keep)
        if len(kept) == 0:
            return None
        best = kept[np.argmax(amplitude[taps[kept]])]

        pdoa_rad = float(pdoa[best]) if sts is not None else 0.0
        azimuth = azimuth_rad(pdoa_rad) if self.located else 0.0
        return Found(
            tap=int(taps[best]),
            amplitude=float(amplitude[taps[best]]),
            prominence=float(prominences[best]),
            width_taps=float(widths[best]),
            score_db=float(scores[best]),
            range_m=self._range_m((taps[best] - first_path) * radar.sample_interval_s, azimuth),
            pdoa_rad=pdoa_rad,
        )

    @staticmethod
    def _pdoa(taps: np.ndarray, sts1: ComplexArray, sts2: ComplexArray, shift1: float, shift2: float) -> np.ndarray:
        """Phase differences at the peaks' places in the two STS responses; NaN outside them."""
        at1 = np.floor(taps + shift1 + 0.5).astype(int)
        at2 = np.floor(taps + shift2 + 0.5).astype(int)
        inside = (at1 >= 0) & (at1 < len(sts1)) & (at2 >= 0) & (at2 < len(sts2))
        pdoa = np.full(len(taps), np.nan)
        difference = np.angle(sts2[at2[inside]]) - np.angle(sts1[at1[inside]])
        pdoa[inside] = (difference + np.pi) % (2 * np.pi) - np.pi
        return pdoa

    def _range_m(self, delay_s: float, azimuth: float) -> float:
        """Bistatic range by the law of cosines in the triangle transmitter, target, receiver."""
        tx_x, tx_y, _ = self.radar.baseline_m
        distance = self.radar.baseline_length_m
        path = delay_s * SPEED_OF_LIGHT_M_S + distance
        along = tx_x * math.cos(azimuth) + tx_y * math.sin(azimuth)
        return (path**2 - distance**2) / (2 * (path - along))


def azimuth_rad(pdoa_rad: float) -> float:
    """The paper's angle of arrival."""
    return math.asin(pdoa_rad / math.pi) / 0.95


@dataclass
class Mapper:
    """World points of all detections so far, clustered again after every 50 new ones."""

    radar: Radar
    points: list[tuple[float, float]] = field(default_factory=list)
    labels: np.ndarray = field(default_factory=lambda: np.empty(0, int))

    def add(self, found: Found, position_m: np.ndarray, yaw_rad: float) -> None:
        """Place one detection by the robot's pose."""
        mount_x, mount_y, _ = self.radar.mount_position_m
        cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
        heading = yaw_rad + self.radar.mount_yaw_rad + azimuth_rad(found.pdoa_rad)
        x = position_m[0] + cosine * mount_x - sine * mount_y + found.range_m * math.cos(heading)
        y = position_m[1] + sine * mount_x + cosine * mount_y + found.range_m * math.sin(heading)
        self.points.append((x, y))
        if len(self.points) % EVERY == 0:
            self.labels = DBSCAN(eps=EPS_M, min_samples=MIN_SAMPLES).fit_predict(np.array(self.points))


def filtering(capture: Capture, frames: Frames) -> list[Found | None]:
    """All frames, one after the other, without STS."""
    detector = Detector(capture.radar)
    return [detector.detect(cir) for cir in frames.preamble]


def filtering_with_sts(capture: Capture, frames: Frames) -> list[Found | None]:
    """All frames with the filter on the phase difference."""
    detector = Detector(capture.radar)
    return [detector.detect_with_sts(*row) for row in _rows(frames)]


def mapping(capture: Capture, frames: Frames) -> tuple[list[Found | None], Mapper]:
    """All frames, and the map that grows with them."""
    detector, mapper = Detector(capture.radar, located=True), Mapper(capture.radar)
    found = []
    for row, position_m, yaw_rad in zip(_rows(frames), frames.position_m, frames.yaw_rad, strict=True):
        found.append(detector.detect_with_sts(*row))
        if found[-1] is not None:
            mapper.add(found[-1], position_m, yaw_rad)
    return found, mapper


def _rows(frames: Frames) -> zip:
    reported = (frames.first_path_index, frames.first_path_index_sts1, frames.first_path_index_sts2)
    return zip(frames.preamble, frames.sts1, frames.sts2, *reported, strict=True)
