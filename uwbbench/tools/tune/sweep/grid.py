"""The grid of threshold sets: which thresholds of a detector are varied, and how far each detection gets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api import registry
from uwbbench.api.arrays import IntArray
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError, nearest
from uwbbench.api.filters import Limit, LimitFilter
from uwbbench.api.override import with_values
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.detector import DetectorConfig, Step, check_detector

MOST_SETS = 1_000_000
"""Sets of one grid, each of which takes some hundred bytes of memory."""


@dataclass(frozen=True)
class Axis:
    """Thresholds of one parameter of one filter.

    Attributes
    ----------
    path : str
        Path of the parameter in the detector file.
    step : Step
        The filter.
    parameter : str
    limit : Limit
        What it limits.
    thresholds : tuple of float or None
        Values in the order of the grid; None sets no limit.
    """

    path: str
    step: Step
    parameter: str
    limit: Limit
    thresholds: tuple[float | None, ...]

    @property
    def place(self) -> IntArray:
        """Place of each threshold (thresholds,) when they are sorted from loose to strict."""
        order = np.argsort([self.limit.bound(threshold) for threshold in self.thresholds], kind="stable")
        return np.argsort(order)

    def level(self, found: Detections) -> IntArray:
        """Number (n,) of the thresholds, from the loosest on, that each detection passes.

        Raises
        ------
        ConfigError
            If the detections lack the column that the filter compares, and it may not be left out.
        """
        if self.limit.column not in found:
            if self.step.optional:  # left out on this capture, as the detector itself does: everything passes
                return np.full(len(found), len(self.thresholds))
            raise ConfigError(f"{self.path}: the capture has no {self.limit.column}, which this threshold limits")
        measure = self.limit.measure(found)
        bounds = np.sort([self.limit.bound(threshold) for threshold in self.thresholds])
        return np.where(np.isnan(measure), 0, np.searchsorted(bounds, measure, side="right"))


def axes_of(config: DetectorConfig, grid: Mapping[str, Sequence[float | None]]) -> tuple[Axis, ...]:
    """Axes of a grid, checked.

    Parameters
    ----------
    config : DetectorConfig
    grid : mapping of str to sequence of float or None
        Thresholds by the path of their parameter.

    Raises
    ------
    ConfigError
        If a path is no parameter of a step, the parameter no threshold that can be swept, or a value not allowed.
    """
    if not grid:
        raise ConfigError("a sweep needs at least one threshold to vary")
    sets = math.prod(len(values) for values in grid.values())
    if sets > MOST_SETS:
        raise ConfigError(f"a grid of {sets} sets is too large: at most {MOST_SETS}")
    return tuple(_axis(config, path, tuple(values)) for path, values in grid.items())


def _axis(config: DetectorConfig, path: str, thresholds: tuple[float | None, ...]) -> Axis:
    step, parameter = _parameter_at(config, path)
    stage = registry.load_plugin("stages", step.use)
    if not issubclass(stage, LimitFilter):
        raise ConfigError(f"{path}: '{step.use}' is no filter that compares a column with a threshold")
    if parameter not in stage.limits:
        raise ConfigError(f"{path}: '{parameter}' is no threshold of '{step.use}'.{nearest(parameter, stage.limits)}")
    if not thresholds:
        raise ConfigError(f"{path}: a sweep needs at least one value")
    for value in thresholds:
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise ConfigError(f"{path}: expected numbers or null, found {value!r}")
        alone = {"use": step.use, "as": step.label, "params": {**step.params, parameter: value}}
        data = {"schema": 1, "name": config.name, "pipeline": [alone]}
        try:
            check_detector(data, YamlFile(path, data, {}))
        except ConfigError as error:
            raise ConfigError(f"threshold {value}: {error}") from None
    return Axis(path, step, parameter, stage.limits[parameter], thresholds)


def _parameter_at(config: DetectorConfig, path: str) -> tuple[Step, str]:
    """Step and parameter that a path leads to."""
    here = object()
    changed = with_values(config.to_dict(), {path: here}, "sweep")
    for step, item in zip(config.steps, changed["pipeline"], strict=True):
        for name, value in item["params"].items():
            if value is here:
                return step, name
    raise ConfigError(f"sweep: '{path}' is no parameter of a step; write pipeline.STEP.params.NAME")
