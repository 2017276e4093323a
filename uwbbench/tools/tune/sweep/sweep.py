"""Evaluating a detector for every set of thresholds of a grid, on peaks that are described once."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from uwbbench.api import registry
from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.capture import Capture
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError, nearest
from uwbbench.api.filters import RankFilter, RankParams, ranked
from uwbbench.api.override import with_values
from uwbbench.api.stage import Filter
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.detector import DetectorConfig, Step, check_detector
from uwbbench.detect.pipeline import Pipeline
from uwbbench.tools.tune.sweep.grid import Axis, axes_of


class Sweep:
    """A detector with a grid of threshold sets.

    The sets are numbered as :func:`itertools.product` of the thresholds yields them: the last one varies fastest.

    Parameters
    ----------
    detector : Pipeline
    grid : mapping of str to sequence of float or None
        Thresholds by the path of their parameter, as in ``set`` of a detector file; None sets no limit.
    leave_out : collection of str
        Steps to leave out, such as a clustering, which cannot follow a sweep.

    Raises
    ------
    ConfigError
        If a path is no threshold that can be swept, a value is not allowed, or the detector has a step that looks at
        several detections at once and so would have to run again for every set.

    Examples
    --------
    >>> from uwbbench.detect.pipeline import load_detector
    >>> sweep = Sweep(load_detector("paper-filtering"), {
    ...     "pipeline.filter.prominence.params.minimum": [0.01, 0.02, 0.05],
    ...     "pipeline.filter.snr.params.minimum_db": [10, 20],
    ... })
    >>> len(sweep), sweep.values(1)["pipeline.filter.snr.params.minimum_db"]
    (6, 20)
    """

    def __init__(
        self, detector: Pipeline, grid: Mapping[str, Sequence[float | None]], *, leave_out: Collection[str] = ()
    ) -> None:
        labels = [step.label for step in detector.config.steps]
        for label in leave_out:
            if label not in labels:
                raise ConfigError(f"sweep: detector '{detector.name}' has no step '{label}'.{nearest(label, labels)}")
        steps = tuple(step for step in detector.config.steps if step.label not in leave_out)
        self.config: DetectorConfig = dataclasses.replace(detector.config, steps=steps)
        self.axes: tuple[Axis, ...] = axes_of(self.config, grid)
        self.shape: tuple[int, ...] = tuple(len(axis.thresholds) for axis in self.axes)
        self._selection = _checked_selection(self.config, self.axes)
        swept = {axis.step.label for axis in self.axes}
        place = len(steps) if self._selection is None else steps.index(self._selection)
        before = tuple(step for step in steps[:place] if step.label not in swept)
        behind = steps[place + 1 :]
        self._whole = Pipeline(dataclasses.replace(self.config, steps=before + behind))
        # A step behind the selection may replace what the selection and the filters look at: then ask before it.
        replaced = frozenset().union(*(registry.load_plugin("stages", step.use).produces for step in behind))
        looked_at = {axis.limit.column for axis in self.axes}
        if self._selection is not None:
            looked_at |= registry.load_plugin("stages", self._selection.use).consumes
        needs_both = bool(replaced & looked_at)
        self._compared = Pipeline(dataclasses.replace(self.config, steps=before)) if needs_both else self._whole

    def __len__(self) -> int:
        return math.prod(self.shape)

    def values(self, index: int) -> dict[str, float | None]:
        """Thresholds of a set by their path."""
        places = np.unravel_index(index, self.shape)
        return {axis.path: axis.thresholds[place] for axis, place in zip(self.axes, places, strict=True)}

    def detector(self, index: int) -> Pipeline:
        """Detector with the thresholds of a set.

        Raises
        ------
        ConfigError
            If the thresholds exclude each other, such as a minimum above the maximum; such a set retains nothing.
        """
        data = with_values(self.config.here(), self.values(index), "sweep")
        return Pipeline(check_detector(data, YamlFile(f"sweep of {self.config.name}", data, {})))

    def run(self, capture: Capture) -> Swept:
        """Find and describe all peaks of a capture that any set retains.

        Parameters
        ----------
        capture : Capture

        Returns
        -------
        Swept
        """
        # A kernel may round a logarithm in another way, and asks the plain stages where that could decide: theirs are
        # the values that are compared with thresholds.
        detections = self._whole.run(capture, fused=False)
        compared = detections if self._compared is self._whole else self._compared.run(capture, fused=False)
        level = np.stack([axis.level(compared) for axis in self.axes], axis=1)
        rows = np.flatnonzero((level > 0).all(axis=1))
        keys: tuple[FloatArray, ...] = (compared.frame.astype(np.float64),)
        count = None
        if self._selection is not None:
            selection = _opened(self._selection, capture.radar.channel)
            keys, count = selection.rank(compared), selection.params.count
            rows = rows[~np.isnan(keys[0][rows])]
        rows = rows[ranked(compared.frame[rows], tuple(key[rows] for key in keys))]
        return Swept.of(self, detections, rows, level[rows] - 1, count)


def _opened(step: Step, channel: int | None) -> RankFilter[RankParams]:
    """Selection with its parameters for a channel."""
    stage = registry.load_plugin("stages", step.use)
    selection: RankFilter[RankParams] = stage(stage.params_type().model_validate(step.params_for(channel)[0]))
    return selection


def _checked_selection(config: DetectorConfig, axes: tuple[Axis, ...]) -> Step | None:
    """Step that retains the first few detections of a frame, if there is one; all others look at one at a time.

    Raises
    ------
    ConfigError
        If the answer for one set of thresholds does not follow from the peaks of the others.
    """
    selection: Step | None = None
    limited: dict[str, str] = {}  # column that a swept filter has compared: that filter
    for step in config.steps:
        stage = registry.load_plugin("stages", step.use)
        where = f"sweep: detector '{config.name}': step '{step.label}'"
        if selection is None and limited.keys() & stage.produces:
            column = min(limited.keys() & stage.produces)
            raise ConfigError(f"{where} replaces '{column}', which '{limited[column]}' has compared before")
        if selection is not None and issubclass(stage, Filter):
            raise ConfigError(f"{where} filters behind the selection '{selection.label}'; put it before")
        if issubclass(stage, RankFilter):
            selection = step
        elif "detections" in stage.consumes and not stage.rowwise:
            raise ConfigError(
                f"{where} looks at several detections at once, so that it would have to run again for every set of "
                "thresholds; leave it out (leave_out)"
            )
        limited |= {axis.limit.column: step.label for axis in axes if axis.step is step}
    return selection


@dataclass(frozen=True)
class Swept:
    """What every threshold set of a sweep retains on one capture.

    Attributes
    ----------
    sweep : Sweep
    found : Detections
        Detections that at least one set retains, by frame and then by rank.
    corner : (n, axes) int array
        Cell of the strictest thresholds that each of them passes; thresholds rise along each axis.
    place : (n,) int array
        Place of each of them among all peaks, in the order of the detector.
    count : int or None
        Detections that a set retains in a frame; None for all.
    terms : tuple of three (terms,) int arrays
        Row of ``found``, cell and sign of the boxes in which it is retained
        (:func:`uwbbench.tools.tune.sweep.kernels.regions`).
    """

    sweep: Sweep
    found: Detections
    corner: IntArray
    place: IntArray
    count: int | None
    terms: tuple[IntArray, IntArray, IntArray]

    @classmethod
    def of(cls, sweep: Sweep, found: Detections, rows: IntArray, corner: IntArray, count: int | None) -> Swept:
        """Sweep over the peaks in ``rows`` (n,), which stand by frame and rank.

        Parameters
        ----------
        sweep : Sweep
        found : Detections
            All peaks of a capture.
        rows : (n,) int array
            Those that at least one set of thresholds lets pass, ordered by frame and then by rank.
        corner : (n, axes) int array
            Cell of the strictest thresholds that each of them passes.
        count : int or None
            Detections that a set retains in a frame; None for all.
        """
        from uwbbench.tools.tune.sweep.kernels import regions  # imports numba

        frame = found.frame[rows]
        start = np.flatnonzero(np.diff(frame, prepend=-1, append=-1))
        peak, cell, sign = regions(start, corner, np.array(sweep.shape), count or 0)
        retained = np.zeros(len(rows), bool)  # by some set; the others are dropped here
        retained[peak] = True
        number = np.cumsum(retained) - 1
        return cls(
            sweep, found.take(rows[retained]), corner[retained], rows[retained], count, (number[peak], cell, sign)
        )

    def totals(self, values: IntArray) -> IntArray:
        """Sum of a number of each detection over those that each set retains, for all sets at once.

        Integers only: what is added for one box and taken away for another then cancels exactly.

        Parameters
        ----------
        values : (n, k) int array
            Numbers of the rows of ``found``.

        Returns
        -------
        (sets, k) int array
        """
        peak, cell, sign = self.terms
        sums = np.zeros((len(self.sweep), values.shape[1]), np.int64)
        np.add.at(sums, cell, sign[:, None] * values[peak])
        grid = sums.reshape(*self.sweep.shape, -1)
        for axis in range(len(self.sweep.shape)):  # a box holds all cells up to its corner
            grid = np.flip(np.cumsum(np.flip(grid, axis), axis), axis)
        for axis, swept in enumerate(self.sweep.axes):
            grid = np.take(grid, swept.place, axis)
        return grid.reshape(len(self.sweep), -1)

    @property
    def retained(self) -> IntArray:
        """Number of detections that each set retains (sets,)."""
        return self.totals(np.ones((len(self.found), 1), np.int64))[:, 0]

    def rows(self, sets: ArrayLike) -> IntArray:
        """Detection that each of some sets retains in each frame, where a set retains one.

        Ask for many sets in blocks: the answer has as many numbers as frames times sets.

        Parameters
        ----------
        sets : (sets,) int array

        Returns
        -------
        (sets, frames) int array
            Rows of ``found`` in the frames of ``found.processed``; -1 where nothing is retained.

        Raises
        ------
        ValueError
            If a set may retain more than one detection in a frame.
        """
        from uwbbench.tools.tune.sweep.kernels import first_retained

        if self.count != 1:
            raise ValueError("a set may retain more than one detection in a frame; use detections(index)")
        start = np.append(np.searchsorted(self.found.frame, self.found.processed), len(self.found))
        return first_retained(start, self.corner, self._cells(np.asarray(sets)))

    def detections(self, index: int) -> Detections:
        """Detections of one set: what the detector finds with its thresholds, in the same order.

        Equal to the last bit to what its plain stages find; a fused kernel rounds logarithms in its own way.
        """
        cell = self._cells(np.array([index]))[0]
        rows = np.flatnonzero((self.corner >= cell).all(axis=1))
        if self.count is not None:
            frame = self.found.frame[rows]
            rows = rows[np.arange(len(rows)) - np.searchsorted(frame, frame) < self.count]
        return self.found.take(rows[np.argsort(self.place[rows])])

    def _cells(self, sets: IntArray) -> IntArray:
        """Cells (sets, axes) of sets, thresholds rising along each axis."""
        places = np.unravel_index(sets, self.sweep.shape)
        return np.stack([axis.place[own] for axis, own in zip(self.sweep.axes, places, strict=True)], axis=1)
