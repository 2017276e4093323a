"""Constant offsets of range and azimuth, measured on a capture whose truth is known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uwbbench.api import registry
from uwbbench.api.capture import Capture
from uwbbench.api.errors import ConfigError, ScoringError
from uwbbench.api.geometry import wrap_angle
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Stage
from uwbbench.detect.pipeline import Pipeline

MINIMUM_MATCHES = 10
"""Fewest detections that an offset is taken from."""

SCATTER_WITHIN_M = 0.20
"""Distance from the median within which an error is scatter, and beyond which it is another peak's: a score's gate."""


@dataclass(frozen=True)
class Calibration:
    """Signed offsets of a detector, found minus true.

    Attributes
    ----------
    range_bias_m : float
        Median error of the range; positive where the detector reads too far.
    azimuth_bias_rad : float or None
        Median error of the azimuth; None where fewer than 10 matched detections have one.
    n : int
        Detections that the range offset was taken from.
    stages : mapping
        The detector's stages with its parameters for the channel of the capture, by the names of their steps.
    range_scatter_m : float
        Spread around the offset, which stays: root mean square of what lies within 20 cm of it. Where the zero was
        measured itself, that of the crest of the direct path alone.
    range_sd_m : float
        How sure the offset is: its standard deviation. NaN where that is not known.
    zeros_s : mapping
        Delay of the direct path behind the detector's first path by response, where it was measured itself; the
        offsets then replace those of the detector, and else are added to them.
    """

    range_bias_m: float
    azimuth_bias_rad: float | None
    n: int
    stages: Mapping[str, Stage[Any]] = field(default_factory=dict, repr=False)
    range_scatter_m: float = math.nan
    range_sd_m: float = math.nan
    zeros_s: Mapping[str, float] = field(default_factory=dict)

    def as_settings(self) -> dict[str, float]:
        """Values for the ``set:`` of a detector that extends the calibrated one, by path.

        The measured offsets are added to what the detector subtracts already. Where that depends on the channel, the
        new value is for the channel of the capture alone.

        Raises
        ------
        ConfigError
            If not exactly one step takes an offset off the range, or several one off the azimuth, or nothing can be
            added to what one takes off: a preset instead of a number, say, or an offset of the phase difference.
        """
        by_response = self._of_responses()
        settings = by_response or self._added("range_m", self.range_bias_m)
        if self.azimuth_bias_rad is None or not self.takes_azimuth:
            return settings
        return settings | self._added("azimuth_rad", self.azimuth_bias_rad)

    @property
    def takes_azimuth(self) -> bool:
        """Whether some step takes an offset off the azimuth; without one it stays."""
        return bool(self._changes("azimuth_rad", 0.0))

    def _of_responses(self) -> dict[str, float]:
        """Values by path where steps of the detector take the zeros of responses; they leave the range no offset."""
        settings: dict[str, float] = {}
        for response, zero_s in self.zeros_s.items():
            for label, changed in self._changes(f"{response}_delay_s", zero_s).items():
                settings |= {f"pipeline.{label}.params.{name}": value for name, value in changed.items()}
        return settings

    def _changes(self, column: str, offset: float) -> dict[str, dict[str, float]]:
        """New values of the parameters of the steps that take an offset off a column, by the names of the steps."""
        changes: dict[str, dict[str, float]] = {}
        for label, stage in self.stages.items():
            try:
                changed = stage.recalibrated(column, offset)
                known = stage.recalibrated(column, 0.0) if self.zeros_s else {}
            except ConfigError as error:
                raise ConfigError(f"pipeline.{label}.params.{error}") from error
            if changed:
                changes[label] = {name: value - known.get(name, 0.0) for name, value in changed.items()}
        return changes

    def _added(self, column: str, offset: float) -> dict[str, float]:
        """Values by path with which the detector takes an offset more off a column."""
        changes = self._changes(column, offset)
        if len(changes) != 1:
            raise ConfigError(
                f"the detector has {len(changes)} steps that take an offset off {column}; "
                "an offset can be set where there is one"
            )
        return {
            f"pipeline.{label}.params.{name}": value for label, set_ in changes.items() for name, value in set_.items()
        }


def settings_by_receiver(calibrations: Mapping[str, Calibration]) -> dict[str, Any]:
    """Values for the ``set:`` of a detector for a robot with several receivers.

    Parameters
    ----------
    calibrations : mapping of str to Calibration
        By receiver. Of a single one the values are those of :meth:`Calibration.as_settings`, for all receivers.

    Raises
    ------
    ConfigError
        As :meth:`Calibration.as_settings`; if the azimuth of some receivers alone could be measured, too.
    """
    each = {receiver: one.as_settings() for receiver, one in calibrations.items()}
    if len(each) == 1:
        return dict(*each.values())
    if len({frozenset(settings) for settings in each.values()}) > 1:
        without = [receiver for receiver, one in calibrations.items() if one.azimuth_bias_rad is None]
        raise ConfigError(
            f"the azimuth could not be measured on {', '.join(without)}: calibrate the receivers one by one"
        )
    paths = next(iter(each.values()))
    return {path: {receiver: settings[path] for receiver, settings in each.items()} for path in paths}


def calibrate(detector: Pipeline, capture: Capture, gate_m: float = 1.0) -> Calibration:
    """Measure what a detector's ranges and azimuths are off by.

    Every detection is compared with the visible object nearest to it in range; those farther away than the gate are
    left out. The median of the signed errors bears that up to half of the rest are other peaks. Bias, unlike spread,
    can be subtracted: arXiv 2512.01018 does so with a constant for each channel.

    Beside a transmitter that stands off the receiver's axis the range depends on the azimuth: a new azimuth offset of 5
    degrees moves ranges by about 1 cm at a baseline of 25 cm, which a second calibration takes out.

    Parameters
    ----------
    detector : Pipeline
        A detector that gives ranges.
    capture : Capture
        A run with ground truth, best of one object that nothing else is near.
    gate_m : float
        Largest range error that still counts as the object; generous, so that the bias itself fits in.

    Returns
    -------
    Calibration

    Raises
    ------
    ScoringError
        If the capture has no truth, or fewer than 10 detections lie within the gate.
    ValueError
        If the gate is not positive.

    Examples
    --------
    >>> calibration = calibrate(detector, capture)  # doctest: +SKIP
    >>> better = load_detector("paper", changes=calibration.as_settings())  # doctest: +SKIP
    """
    if not gate_m > 0:
        raise ValueError(f"gate_m must be positive, not {gate_m}")
    if capture.truth is None:
        raise ScoringError(f"capture '{capture.name}' has no ground truth, so nothing can be calibrated on it")
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    sought = np.array([not target.structure for target in capture.truth.objects], dtype=bool)
    ahead = np.abs(sight.azimuth_rad) <= np.pi / 2
    visible_m = np.where(ahead & ~sight.occluded & sought, sight.range_m, np.nan)

    detections = detector.run(capture)
    error_m = detections.range_m[:, None] - visible_m[detections.frame]
    distance_m = np.where(np.isfinite(error_m), np.abs(error_m), np.inf)
    near = np.flatnonzero(distance_m.min(axis=1, initial=np.inf) <= gate_m)
    if len(near) < MINIMUM_MATCHES:
        raise ScoringError(
            f"detector '{detector.name}' has only {len(near)} detections within {gate_m:g} m of a visible object on "
            f"capture '{capture.name}'; calibration needs {MINIMUM_MATCHES}"
        )
    target = distance_m[near].argmin(axis=1)
    errors_m = error_m[near, target]
    range_bias_m = float(np.median(errors_m))
    off_m = errors_m[np.abs(errors_m - range_bias_m) <= SCATTER_WITHIN_M] - range_bias_m
    azimuth_error = wrap_angle(detections.azimuth_rad[near] - sight.azimuth_rad[detections.frame[near], target])
    azimuth_error = azimuth_error[np.isfinite(azimuth_error)]
    return Calibration(
        range_bias_m=range_bias_m,
        azimuth_bias_rad=float(np.median(azimuth_error)) if len(azimuth_error) >= MINIMUM_MATCHES else None,
        n=len(near),
        stages=stages_of(detector, capture.radar),
        range_scatter_m=float(np.sqrt(np.mean(off_m**2))) if len(off_m) else math.nan,
    )


def stages_of(detector: Pipeline, radar: Radar) -> dict[str, Stage[Any]]:
    """A detector's stages with its parameters for a receiver, not opened, by the names of their steps.

    Parameters
    ----------
    detector : Pipeline
    radar : Radar
        Of the receiver.
    """
    stages = {}
    for step in detector.config.steps:
        cls = registry.load_plugin("stages", step.use)
        stage = cls(cls.params_type().model_validate(step.params_for(radar.channel)[0]))
        stage.radar = radar  # an offset may be that of a receiver
        stages[step.label] = stage
    return stages
