"""Segments by a recurrent network along the taps of a frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from uwbbench.api import (
    Block,
    ConfigError,
    Detections,
    Example,
    FloatArray,
    IntArray,
    LearnedParams,
    Radar,
    Stage,
    Weights,
    expect_arrays,
    ports,
)

_COLUMNS = ("tap", "start_tap", "stop_tap", "amplitude", "probability")


class LstmParams(LearnedParams):
    """Size of the network, how it learns, and from which probability on a tap belongs to a segment."""

    after_training: ClassVar[frozenset[str]] = frozenset({"weights", "threshold"})

    bidirectional: bool = Field(False, description="A second network runs from the last tap to the first.")
    hidden: int = Field(32, ge=1, le=256, description="Cells of each network.")
    taps: int = Field(44, ge=2, le=4096, description="Taps from the direct path on that the network sees.")
    threshold: float = Field(0.5, ge=0, le=1, description="Segments are runs of taps more probable than this.")
    epochs: int = Field(40, ge=1, description="Most passes over the training frames.")
    patience: int = Field(
        6, ge=1, description="Learning stops after so many passes without a smaller loss on the validation captures."
    )
    frame_step: int = Field(3, ge=1, description="Every n-th frame is learned from: neighbours are alike.")


class Lstm(Stage[LstmParams]):
    """Segments of taps that a long short-term memory, run along the taps of a frame, holds for echoes.

    The network is given the features of each tap from the direct path on, standardised, and says how probable it is
    that the tap lies within 1.5 taps of an obstacle's echo. Segments are runs of taps above ``threshold``: ``tap``
    and ``amplitude`` are those of the strongest sample, ``probability`` the largest inside. Each frame is judged for
    itself. Learning takes torch (the extra ``train``); detecting is compiled code over plain arrays.

    Of the source its abstract alone could be read: wavelets, then a recurrent network, then segments. Wavelet, sizes
    and training are chosen here.

    Weights
    -------
    scaling (2, features), inputs (directions, features, 4 hidden), recurrent (directions, hidden, 4 hidden), bias
    (directions, 4 hidden), outputs (directions, hidden), offset (1,): all float32.

    References
    ----------
    A. Mimouna et al., "LSTM-based system for multiple obstacle detection using ultra-wide band radar", ICAART 2021,
    pp. 418-425.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path", "features")
    produces: ClassVar[frozenset[str]] = ports("detections", "tap", "start_tap", "stop_tap", "amplitude", "probability")
    fidelity = "reconstruction"

    def fit(self, examples: Iterable[Example], *, seed: int, validation: Iterable[Example]) -> Weights:
        """Learn from every n-th frame of the examples.

        Parameters
        ----------
        examples : iterable of Example
        seed : int
        validation : iterable of Example
            By which learning stops, and the best pass is chosen; without them all passes are made.

        Raises
        ------
        ConfigError
            If torch is not installed, or no example has an echo.
        """
        from uwbbench_detectors.segments.lstm_training import learn

        return learn(self.params, examples, validation, seed)

    def load(self, weights: Weights) -> None:
        """Take weights.

        Raises
        ------
        ConfigError
            If an array is missing, has another shape or dtype, or holds what is no finite number or no scale.
        """
        p = self.params
        directions = 1 + p.bidirectional
        expect_arrays(
            weights,
            {
                "scaling": ("float32", (2, "features")),
                "inputs": ("float32", (directions, "features", 4 * p.hidden)),
                "recurrent": ("float32", (directions, p.hidden, 4 * p.hidden)),
                "bias": ("float32", (directions, 4 * p.hidden)),
                "outputs": ("float32", (directions, p.hidden)),
                "offset": ("float32", (1,)),
            },
        )
        if not (weights["scaling"][1] > 0).all():
            raise ConfigError("array 'scaling' holds standard deviations that are not positive")
        names = ("scaling", "inputs", "recurrent", "bias", "outputs")
        scaling, inputs, recurrent, bias, outputs = (weights[name].astype(np.float64) for name in names)
        self._arrays = (scaling, inputs, recurrent, bias, outputs)
        self._offset = float(weights["offset"][0])

    def open(self, radar: Radar) -> None:
        """Load the inner loops."""
        super().open(radar)
        from uwbbench_detectors.segments import lstm_loops

        self._loops = lstm_loops

    def probabilities(self, block: Block) -> FloatArray:
        """Probability (frames, taps looked at) that each tap from the direct path on is an echo's.

        Raises
        ------
        ConfigError
            If the taps have another number of features than those learned from.
        """
        features = block.part("features")
        if features.shape[2] != self._arrays[0].shape[1]:
            raise ConfigError(
                f"classify.lstm: was learned from {self._arrays[0].shape[1]} features of each tap, and is given "
                f"{features.shape[2]}"
            )
        found = np.empty((len(features), self.params.taps))
        self._loops.probabilities(features, first_taps(block), *self._arrays, self._offset, found)
        return found

    def step(self, block: Block) -> Block:
        """Block with a detection for each segment, by frame and then tap."""
        frames = block.frames
        row, found = self._loops.probable_runs(
            self.probabilities(block), first_taps(block), frames.amplitude, self.params.threshold
        )
        found.view(np.int64)[:, 0] = row + frames.first
        looked_at = (frames.first, np.ones(len(frames), bool))
        return block.replace(detections=Detections.of_table(_COLUMNS, found, looked_at, ()))

    def assess(self, examples: Iterable[Example]) -> Mapping[str, float]:
        """How well taps are told apart: precision, recall and F1 of single taps.

        Parameters
        ----------
        examples : iterable of Example
        """
        tp = fp = fn = 0
        for example in examples:
            said = self.probabilities(example.block) > self.params.threshold
            true, counts = targets(example, self.params.taps)
            tp += int((said & true).sum())
            fp += int((said & ~true & counts).sum())
            fn += int((~said & true).sum())
        return {
            "tap_precision": tp / max(tp + fp, 1),
            "tap_recall": tp / max(tp + fn, 1),
            "tap_f1": 2 * tp / max(2 * tp + fp + fn, 1),
        }


def first_taps(block: Block) -> IntArray:
    """Tap (frames,) of the direct path of each frame, inside the frame."""
    whole = np.floor(np.nan_to_num(block.part("first_path")) + 0.5).astype(np.int64)
    return np.clip(whole, 0, block.frames.taps - 1)


REACH_TAPS = 1.5
"""Distance from an echo up to which a tap is the echo's."""


def targets(example: Example, taps: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which taps of each frame are an obstacle's, and which say anything.

    Parameters
    ----------
    example : Example
    taps : int
        Taps looked at, from the direct path on.

    Returns
    -------
    (frames, taps) bool array
        Taps within 1.5 of the echo of an obstacle ahead that nothing hides.
    (frames, taps) bool array
        False for taps of a wall's echo alone, which nobody is asked to find, and for frames of zeros.
    """
    block, radar = example.block, example.radar
    frame = block.frames.index
    sight = example.truth.seen_from(radar, example.trajectory)
    place = (first_taps(block) - block.part("first_path"))[:, None] + np.arange(taps)
    shape = place.shape
    obstacle, structure = np.zeros(shape, bool), np.zeros(shape, bool)
    for number, item in enumerate(example.truth.objects):
        range_m, azimuth_rad = sight.range_m[frame, number], sight.azimuth_rad[frame, number]
        echo = _echo_taps(range_m, azimuth_rad, radar)
        with np.errstate(invalid="ignore"):
            seen = (np.abs(azimuth_rad) <= np.pi / 2) & ~sight.occluded[frame, number]
            near = (np.abs(place - echo[:, None]) <= REACH_TAPS) & seen[:, None]
        (structure if item.structure else obstacle)[near] = True
    signal = np.asarray(block.frames.amplitude.any(axis=1))[:, None]
    return obstacle & signal, (obstacle | ~structure) & signal


def _echo_taps(range_m: FloatArray, azimuth_rad: FloatArray, radar: Radar) -> FloatArray:
    """Taps (frames,) behind the first path at which a point at a range and azimuth shows."""
    from uwbbench.api import SPEED_OF_LIGHT_M_S, direction

    to_receiver = range_m[:, None] * direction(azimuth_rad)
    flown_m = np.linalg.norm(to_receiver - radar.baseline_m, axis=1) + range_m
    if radar.first_tap_delay_s is None:  # delays count from the direct path
        flown_m = flown_m - radar.baseline_length_m
    return np.asarray(flown_m / SPEED_OF_LIGHT_M_S / radar.sample_interval_s)
