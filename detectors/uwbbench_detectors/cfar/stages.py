"""CFAR detectors: taps whose power exceeds a multiple of the noise that the taps around them show."""

from __future__ import annotations

import math
from typing import ClassVar, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, field_validator, model_validator

from uwbbench.api import Block, ConfigError, Detections, Params, Radar, Stage, ports
from uwbbench_detectors.cfar.factors import Statistic, TrainingWindow, order_rank, threshold_factor
from uwbbench_detectors.peaks.profile import profile_start


class CfarParams(Params):
    """Training window, false-alarm rate, and what counts as one detection."""

    training_taps: int = Field(12, ge=2, le=256, description="Training cells N, half of them on each side.")
    guard_taps: int = Field(
        2,
        ge=0,
        le=64,
        description="Cells on each side between the tested cell and its training cells. The main lobe of a 500 MHz "
        "pulse at 1 ns reaches 2 to 3 taps to either side: with fewer a pulse raises its own threshold.",
    )
    training_pulses: float | None = Field(
        None,
        gt=0,
        le=128,
        description="Training cells of both sides in pulse lengths (1 / bandwidth) instead of taps, so that one window "
        "fits radars of any sampling; rounded to an even number of taps.",
    )
    guard_pulses: float | None = Field(
        None, ge=0, le=32, description="Guard cells on each side in pulse lengths instead of taps."
    )
    false_alarm_rate: float = Field(
        1e-3, ge=1e-12, le=0.1, description="Probability that a cell of noise alone exceeds its threshold."
    )
    noise: Literal["independent", "correlated"] = Field(
        "independent",
        description="'correlated' takes factors for noise that a root-raised-cosine filter of the radar's bandwidth "
        "has shaped. On such noise (500 MHz at 1 ns) the factors for independent cells give 1.9 to 2.2 times the rate "
        "asked for.",
    )
    cells: Literal["maxima", "all"] = Field(
        "maxima",
        description="'maxima': of the cells over their thresholds only those that no tap within the guard distance "
        "(at least 1) exceeds, so that a pulse is one detection. 'all': every cell, as false-alarm rates count them.",
    )
    skip_taps: int | None = Field(
        None,
        ge=0,
        description="Leading taps neither tested nor trained on; null: the radar's noise_taps, which precede any "
        "arrival.",
    )

    @field_validator("training_taps")
    @classmethod
    def _even(cls, value: int) -> int:
        if value % 2:
            raise ValueError(f"training_taps are shared by two sides and must be even, found {value}")
        return value

    @model_validator(mode="after")
    def _one_unit(self) -> Self:
        for name in ("training", "guard"):
            if {f"{name}_taps", f"{name}_pulses"} <= self.model_fields_set:
                raise ValueError(f"give {name}_taps or {name}_pulses, not both")
        return self

    def window_for(self, radar: Radar) -> tuple[int, int]:
        """Training taps on one side, and guard taps on one side, for a radar."""
        pulse_taps = 1 / (radar.bandwidth_hz * radar.sample_interval_s)
        half, guard = self.training_taps // 2, self.guard_taps
        if self.training_pulses is not None:
            half = max(round(self.training_pulses * pulse_taps / 2), 1)
        if self.guard_pulses is not None:
            guard = round(self.guard_pulses * pulse_taps)
        return half, guard


P = TypeVar("P", bound=CfarParams)


class Cfar(Stage[P]):
    """A detector whose threshold follows the noise around each tap.

    A cell ``|h|^2`` is detected where it exceeds ``factor * z``; subclasses say what ``z`` is. Near the edges of the
    frame, where one side has fewer than N/2 training cells, the other side alone is used, with a factor made for N/2
    cells: the false-alarm rate holds there too, at some loss of sensitivity. Sums are made of sums, never of
    differences, which would lose every digit behind a direct path 120 dB above the noise.

    ``score_db`` is the cell over ``z``. Where ``z`` is zero there is no noise to compare with and no rate that a
    threshold could keep: nothing is detected, and a note says so if something is there.

    Raises
    ------
    ConfigError
        From ``open``, if a frame has fewer taps than a window needs (N plus twice the guard), or there is no factor
        for the noise asked for.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("detections", "tap", "amplitude", "score_db")
    statistic: ClassVar[Statistic]

    def open(self, radar: Radar) -> None:
        """Compute the factor of every tap."""
        super().open(radar)
        p = self.params
        name = f"cfar.{self.statistic}"
        self._start = profile_start(name, p.skip_taps, radar)
        self._half, self._guard = p.window_for(radar)
        self._edge = self._half + self._guard
        tested = radar.taps - self._start
        if tested < 2 * self._edge:
            raise ConfigError(
                f"{name}: {2 * self._half} training taps and {self._guard} guard taps on each side need "
                f"{2 * self._edge} taps, but {tested} of the {radar.taps} taps of a frame are tested; lower one of them"
            )
        self._factor = np.full(tested, self._factor_for(1))
        self._factor[self._edge : tested - self._edge] = self._factor_for(2)
        if self._factor.min() <= 1:
            raise ConfigError(
                f"{name}: false_alarm_rate {p.false_alarm_rate:g} puts thresholds below the noise estimate; lower it"
            )
        from uwbbench_detectors.cfar import windows as cfar_windows

        self._detect = cfar_windows.detect
        self._settings = (
            self._start,
            self._half,
            self._guard,
            self._factor,
            getattr(cfar_windows, self.statistic.upper()),
            (order_rank(self._rank, self._half), order_rank(self._rank, 2 * self._half)),
            max(self._guard, 1) if p.cells == "maxima" else 0,
        )

    @property
    def resolves_taps(self) -> float:
        """The guard taps for means of training cells, which a second echo raises; an order statistic passes it by."""
        return self._guard if self.statistic in ("ca", "go") else math.inf

    @property
    def _rank(self) -> float:
        """Share of the training cells below an order statistic."""
        return 1.0

    def _factor_for(self, sides: Literal[1, 2]) -> float:
        window = TrainingWindow(self._half, sides, self._guard)
        bandwidth = self.radar.bandwidth_hz * self.radar.sample_interval_s
        correlated = self.params.noise == "correlated"
        return threshold_factor(
            self.statistic, window, self.params.false_alarm_rate, self._rank, bandwidth if correlated else None
        )

    def step(self, block: Block) -> Block:
        """Block with the detected cells, by frame and then tap."""
        frames = block.frames
        row, tap, amplitude, score_db, silent = self._detect(frames.amplitude, *self._settings)
        if silent:
            self.note(
                f"cfar.{self.statistic}: some taps with a signal have training taps that are all zero; without noise "
                "there is no threshold, and nothing is detected in them"
            )
        detections = Detections(
            row + frames.first, processed=frames.index, tap=tap, amplitude=amplitude, score_db=score_db
        )
        return block.replace(detections=detections)


class CellAveraging(Cfar[CfarParams]):
    """CA-CFAR: the noise is the mean of all training cells.

    The most sensitive one in even noise; a second echo or a step of clutter among the training cells raises the
    threshold. ``factor = N (P^(-1/N) - 1)`` for independent cells, exact for correlated ones too.

    References
    ----------
    H. M. Finn and R. S. Johnson, RCA Review 29, 1968.
    """

    statistic = "ca"


class GreatestOf(Cfar[CfarParams]):
    """GO-CFAR: the noise is the larger of the two sides' means.

    Keeps the false-alarm rate down at steps of clutter, and hides the weaker one of two near echoes.

    References
    ----------
    V. G. Hansen and J. H. Sawyers, IEEE Trans. AES 16(1), 1980.
    """

    statistic = "go"


class SmallestOf(Cfar[CfarParams]):
    """SO-CFAR: the noise is the smaller of the two sides' means.

    Finds an echo beside a stronger one, at many more false alarms where the clutter steps.

    References
    ----------
    G. V. Trunk, IEEE Trans. AES 14(5), 1978.
    """

    statistic = "so"


class OrderedStatisticParams(CfarParams):
    """Training window, false-alarm rate, and the rank."""

    rank: float = Field(
        0.75,
        gt=0,
        le=1,
        description="Share of the training cells below the one taken as noise: the k-th smallest, k = rank N rounded "
        "(halves to even). N - k strong cells do not move it.",
    )


class OrderedStatistic(Cfar[OrderedStatisticParams]):
    """OS-CFAR: the noise is the k-th smallest training cell.

    Bears as many echoes among the training cells as lie above the k-th, at a small loss in even noise.

    References
    ----------
    H. Rohling, IEEE Trans. AES 19(4), 1983.
    """

    statistic = "os"

    @property
    def _rank(self) -> float:
        return self.params.rank
