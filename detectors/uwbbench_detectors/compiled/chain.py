"""Which stages one compiled search can do, and their parameters as it wants them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from uwbbench.api import FloatArray, IntArray, Radar, Stage
from uwbbench_detectors.compiled import layout as at
from uwbbench_detectors.filters.selection import All, Nearest, Strongest
from uwbbench_detectors.filters.thresholds import FirstPathFilter, PdoaFilter, ProminenceFilter, SnrFilter, WidthFilter
from uwbbench_detectors.first_path.estimators import CrestFirstPath
from uwbbench_detectors.peaks.interpolation import Interpolate
from uwbbench_detectors.peaks.noise import NoiseFloor
from uwbbench_detectors.peaks.peaks import Peaks
from uwbbench_detectors.peaks.profile import AmplitudeProfile, MinMaxProfile
from uwbbench_detectors.peaks.score import SnrScore
from uwbbench_detectors.position.azimuth import Azimuth
from uwbbench_detectors.position.pdoa import Pdoa
from uwbbench_detectors.position.ranging import Position, Range

MOST_NOISE_TAPS = 128
"""Terms up to which the compiled root mean square adds up in numpy's order."""


class Chain:
    """A run of stages as settings of the search.

    Stages are taken one after the other by :meth:`take`, as long as each comes where the search does its work:
    signals, peaks, properties and filters of peaks, selection, then what describes the detections that are left.

    Parameters
    ----------
    radar : Radar

    Attributes
    ----------
    how : (HOW,) int array
    limits : (LIMITS,) array
        Laid out as in :mod:`uwbbench_detectors.compiled.layout`.
    columns : list of str
        Columns of detections, in the order in which the stages make them.
    """

    def __init__(self, radar: Radar) -> None:
        self.radar = radar
        self.how: IntArray = np.zeros(at.HOW, np.int64)
        self.limits: FloatArray = np.zeros(at.LIMITS)
        for limit in (at.GUARD_TAPS, at.LEAST_PROMINENCE, at.LEAST_WIDTH, at.LEAST_SCORE):
            self.limits[limit] = -np.inf
        for limit in (at.LARGEST_WIDTH, at.LARGEST_PDOA):
            self.limits[limit] = np.inf
        self.limits[[at.SINE_DIVISOR, at.ANGLE_DIVISOR, at.ANGLE_SIGN]] = 1.0
        self.columns: list[str] = []
        self._taken: dict[type[Stage[Any]], int] = {}
        self._phase = 0

    def take(self, stage: Stage[Any]) -> bool:
        """Add a stage to the chain; False where the search cannot do it there."""
        known = _TAKES.get(type(stage))
        if known is None or type(stage) in self._taken:
            return False
        phases, settle = known
        phase = next((phase for phase in phases if phase >= self._phase), None)
        if phase is None or (phase > PEAKS and Peaks not in self._taken) or not settle(self, stage):
            return False
        self._phase = phase
        self._taken[type(stage)] = phase
        return True

    def __contains__(self, kind: type[Stage[Any]]) -> bool:
        return kind in self._taken

    def settle(self) -> None:
        """Work out what follows from all settings together."""
        gain, least = self.limits[at.GAIN_DB], self.limits[at.LEAST_SCORE]
        earliest = self._earliest_first_path()
        if gain >= 0 and np.isfinite(least) and np.isfinite(earliest):
            farthest = (self.radar.taps - 1 - earliest) * self.limits[at.DELAY_UNIT]
            # Somewhat below, so that rounding can never make it a limit of its own.
            self.limits[at.LEAST_RATIO] = 10 ** ((least - gain * farthest) / 20) * (1 - 1e-9)

    def _earliest_first_path(self) -> float:
        if self.how[at.FIRST_PATH] == at.FIRST_PATH_GIVEN:
            return -np.inf
        fixed = self.how[at.FIRST_PATH] == at.FIRST_PATH_FIXED
        return float(self.limits[at.FIRST_PATH_TAP]) if fixed else float(self.how[at.CREST_START]) - 0.5


SIGNAL, PEAKS, JUDGED, SELECTED, MOVED, DESCRIBED, RANGED, PLACED = range(8)
"""Parts of the search, in order."""


def _noise(chain: Chain, stage: NoiseFloor) -> bool:
    methods = {"leading": at.NOISE_LEADING, "tail": at.NOISE_TAIL, "median": at.NOISE_MEDIAN}
    if stage.method not in methods or stage.taps > MOST_NOISE_TAPS:
        return False
    chain.how[[at.NOISE, at.NOISE_TAPS]] = methods[stage.method], stage.taps
    return True


def _minmax(chain: Chain, stage: MinMaxProfile) -> bool:
    scopes = {"frame": at.PROFILE_MINMAX, "frame_all_taps": at.PROFILE_MINMAX_ALL_TAPS}
    if AmplitudeProfile in chain or stage.params.scope not in scopes:
        return False
    chain.how[[at.PROFILE, at.PROFILE_START]] = scopes[stage.params.scope], stage.start
    return True


def _amplitude(chain: Chain, stage: AmplitudeProfile) -> bool:
    if MinMaxProfile in chain:
        return False
    chain.how[[at.PROFILE, at.PROFILE_START]] = at.PROFILE_AMPLITUDE, stage.start
    return True


def _crest(chain: Chain, stage: CrestFirstPath) -> bool:
    radar = chain.radar
    start = radar.noise_taps
    chain.how[at.CREST_START] = start
    chain.how[at.CREST_STOP] = min(start + stage.params.within_taps, radar.taps)
    if radar.first_tap_delay_s is not None:
        chain.how[at.FIRST_PATH] = at.FIRST_PATH_FIXED
        chain.limits[at.FIRST_PATH_TAP] = -radar.first_tap_delay_s / radar.sample_interval_s
    else:
        chain.how[at.FIRST_PATH] = at.FIRST_PATH_INTERPOLATED if stage.params.interpolate else at.FIRST_PATH_CREST
    return True


def _peaks(chain: Chain, stage: Peaks) -> bool:
    # Deeper down a level could, by rounding, fall below the lower ground, where the search for it would not end.
    if stage.params.window_taps is not None or stage.params.relative_height > 0.9:
        return False
    if AmplitudeProfile not in chain and MinMaxProfile not in chain:
        return False
    chain.limits[at.RELATIVE_HEIGHT] = stage.params.relative_height
    chain.columns += ["tap", "amplitude", "prominence", "width_taps"]
    return True


def _guard(chain: Chain, stage: FirstPathFilter) -> bool:
    chain.limits[at.GUARD_TAPS] = stage.params.guard_taps
    return True


def _prominent(chain: Chain, stage: ProminenceFilter) -> bool:
    chain.limits[at.LEAST_PROMINENCE] = stage.params.minimum
    return True


def _wide(chain: Chain, stage: WidthFilter) -> bool:
    chain.limits[at.LEAST_WIDTH] = stage.params.minimum
    if stage.params.maximum is not None:
        chain.limits[at.LARGEST_WIDTH] = stage.params.maximum
    return True


def _score(chain: Chain, stage: SnrScore) -> bool:
    if stage.params.amplitude != "raw" or NoiseFloor not in chain:
        return False
    chain.how[at.SCORED] = 1
    chain.limits[at.GAIN_DB] = stage.params.gain_db_per_ns
    chain.limits[at.DELAY_UNIT] = chain.radar.sample_interval_s * 1e9 if stage.params.delay_unit == "ns" else 1.0
    chain.columns.append("score_db")
    return True


def _audible(chain: Chain, stage: SnrFilter) -> bool:
    chain.limits[at.LEAST_SCORE] = stage.params.minimum_db
    return SnrScore in chain


def _phase(chain: Chain, stage: Pdoa) -> bool:
    p = stage.params
    if p.sample == "fractional" or p.phase != "atan2" or p.reference == "direct" or Interpolate in chain:
        return False
    chain.how[[at.PHASED, at.ALIGNED, at.WRAPPED_ABOVE]] = 1, p.sample == "aligned", p.wrap == "closed_above"
    chain.limits[at.PDOA_OFFSET] = stage.expected_rad
    chain.columns.append("pdoa_rad")
    return True


def _sector(chain: Chain, stage: PdoaFilter) -> bool:
    chain.limits[at.LARGEST_PDOA] = stage.params.maximum_rad
    return Pdoa in chain


def _select(chain: Chain, stage: Strongest | Nearest) -> bool:
    if chain.how[at.SELECT] != at.SELECT_ALL:
        return False
    chain.how[at.SELECT] = at.SELECT_STRONGEST if isinstance(stage, Strongest) else at.SELECT_NEAREST
    chain.how[at.COUNT] = stage.params.count
    return True


def _retain_all(_chain: Chain, _stage: All) -> bool:
    return True


def _interpolate(chain: Chain, stage: Interpolate) -> bool:
    parabola = stage.params.method == "parabola"
    chain.how[at.INTERPOLATE] = at.INTERPOLATE_PARABOLA if parabola else at.INTERPOLATE_LOG_PARABOLA
    return True


def _azimuth(chain: Chain, stage: Azimuth) -> bool:
    divisors = stage.divisors
    if divisors is None or Pdoa not in chain:
        return False
    chain.how[at.ANGLE] = 1
    chain.limits[[at.SINE_DIVISOR, at.ANGLE_DIVISOR]] = divisors
    chain.limits[at.ANGLE_SIGN] = stage.params.sign
    bias = at.PDOA_BIAS if stage.params.bias_domain == "alpha" else at.ANGLE_BIAS
    chain.limits[bias] = stage.bias_rad
    chain.columns.append("azimuth_rad")
    return True


def _range(chain: Chain, stage: Range) -> bool:
    radar = chain.radar
    chain.how[at.RANGED] = at.RANGED_EXACT if stage.params.geometry == "exact" else at.RANGED_SINE
    chain.limits[at.INTERVAL_S] = stage.interval_s
    chain.limits[at.SPEED_RATIO] = stage.speed_ratio
    from_transmission = radar.first_tap_delay_s is not None or not stage.params.includes_baseline
    chain.limits[at.EXCESS_OFFSET_M] = radar.baseline_length_m if from_transmission else 0.0
    chain.limits[[at.BASELINE_X, at.BASELINE_Y]] = radar.baseline_m[:2]
    chain.limits[at.BASELINE_LENGTH] = radar.baseline_length_m
    chain.limits[at.RANGE_BIAS] = stage.bias_m
    chain.columns += ["delay_s", "range_m"]
    return True


def _position(chain: Chain, stage: Position) -> bool:
    if stage.params.use_odometry or Range not in chain or Azimuth not in chain:
        return False
    chain.how[at.PLACED] = 1
    chain.limits[[at.MOUNT_X, at.MOUNT_Y]] = chain.radar.mount_position_m[:2]
    chain.limits[at.MOUNT_YAW] = chain.radar.mount_yaw_rad
    chain.columns += ["x_m", "y_m"]
    return True


_TAKES: dict[type[Stage[Any]], tuple[tuple[int, ...], Callable[[Chain, Any], bool]]] = {
    NoiseFloor: ((SIGNAL,), _noise),
    MinMaxProfile: ((SIGNAL,), _minmax),
    AmplitudeProfile: ((SIGNAL,), _amplitude),
    CrestFirstPath: ((SIGNAL,), _crest),
    Peaks: ((PEAKS,), _peaks),
    FirstPathFilter: ((JUDGED,), _guard),
    ProminenceFilter: ((JUDGED,), _prominent),
    WidthFilter: ((JUDGED,), _wide),
    SnrScore: ((JUDGED,), _score),
    SnrFilter: ((JUDGED,), _audible),
    Pdoa: ((JUDGED, SELECTED), _phase),
    PdoaFilter: ((JUDGED,), _sector),
    All: ((JUDGED, SELECTED), _retain_all),
    Strongest: ((SELECTED,), _select),
    Nearest: ((SELECTED,), _select),
    Interpolate: ((MOVED,), _interpolate),
    Azimuth: ((DESCRIBED,), _azimuth),
    Range: ((RANGED,), _range),
    Position: ((PLACED,), _position),
}
"""Stages that the search does, and in which of its parts."""


def chain_of(stages: Sequence[Stage[Any]]) -> tuple[Chain, int]:
    """The longest run of stages, from the first on, that one search does.

    Parameters
    ----------
    stages : sequence of Stage
        Opened.

    Returns
    -------
    Chain
    int
        Number of stages in it; 0 where it would find no peaks.
    """
    chain = Chain(stages[0].radar)
    taken = 0
    for stage in stages:
        if not chain.take(stage):
            break
        taken += 1
    chain.settle()
    return chain, taken if Peaks in chain else 0
