"""Detectors for the hard cases: shipped ones, ones of rarer stages, and ones with a known fault."""

from collections.abc import Callable

import pytest

from uwbbench.api.case import CheckResult
from uwbbench.detect.pipeline import Pipeline, detector_from_yaml
from uwbbench.measure.robustness import case_named
from uwbbench.measure.robustness.subject import Subject

RARE = {
    "greatest of": [
        "{use: align}",
        "{use: first_path.crest, params: {interpolate: true}}",
        "{use: clutter.svd, params: {window_frames: 64, rank: 1, every: 3}}",
        "{use: cfar.go}",
        "{use: filter.first_path}",
        "{use: interpolate, params: {method: parabola}}",
        "{use: range}",
    ],
    "smallest of": [
        "{use: align}",
        "{use: first_path.reported}",
        "{use: clutter.template, params: {frames: 20}}",
        "{use: cfar.so, params: {noise: correlated}}",
        "{use: filter.first_path}",
        "{use: range, params: {geometry: paper, speed_of_light: rounded}}",
    ],
    "all frames so far": [
        "{use: align}",
        "{use: first_path.leading_edge}",
        "{use: clutter.mean}",
        "{use: noise_floor, params: {method: tail}}",
        "{use: profile.minmax, params: {scope: recording}}",
        "{use: peaks}",
        "{use: score.snr}",
        "{use: filter.snr, params: {minimum_db: 12}}",
        "{use: filter.first_path, params: {guard_taps: 4}}",
        "{use: select.strongest}",
        "{use: pdoa, params: {sample: fractional, reference: direct}}",
        "{use: azimuth, params: {formula: physical}}",
        "{use: range, params: {bias_m: 0.17}}",
        "{use: position}",
        "{use: dbscan, params: {labels: final}}",
    ],
    "running median": [
        "{use: first_path.crest, params: {interpolate: true}}",
        "{use: noise_floor, params: {method: running_median}}",
        "{use: profile.minmax, params: {scope: frame_all_taps}}",
        "{use: peaks}",
        "{use: score.snr, params: {amplitude: normalised}}",
        "{use: filter.snr, params: {minimum_db: 12}}",
        "{use: filter.first_path, params: {guard_taps: 3}}",
        "{use: select.strongest}",
        "{use: interpolate}",
        "{use: pdoa, params: {wrap: closed_above}}",
        "{use: azimuth, params: {formula: paper_inside}}",
        "{use: range}",
        "{use: position}",
        "{use: dbscan, params: {window: 100, every: 20, min_samples: 5}}",
    ],
    "adaptive average": [
        "{use: align}",
        "{use: first_path.crest}",
        "{use: clutter.exponential, params: {adaptive: true}}",
        "{use: cfar.os, params: {noise: correlated}}",
        "{use: filter.first_path, params: {guard_taps: 3}}",
        "{use: interpolate}",
        "{use: range}",
    ],
}


def build(*steps: str) -> Pipeline:
    """A detector from its steps."""
    return detector_from_yaml("\n".join(["schema: 1", "name: made", "pipeline:", *(f"  - {step}" for step in steps)]))


@pytest.fixture(scope="session")
def make_detector() -> Callable[..., Pipeline]:
    return build


@pytest.fixture(scope="session")
def rare_detectors() -> dict[str, Pipeline]:
    return {name: build(*steps) for name, steps in RARE.items()}


@pytest.fixture
def judged() -> Callable[[str, Pipeline], CheckResult]:
    """Result of one case, by name."""
    return lambda name, pipeline: case_named(name).judge(Subject(pipeline))


FAULTY = '''
import numpy as np
from uwbbench.api import Block, Detections, Filter, Params, Stage, ports


class RunningSums(Stage[Params]):
    """Every cell over ten times the mean of the twelve around it, by running sums."""

    consumes = ports("frames")
    produces = ports("detections", "tap", "amplitude", "score_db")

    class Window(Params):
        training_taps: int = 12
        guard_taps: int = 0

        def window_for(self, radar):
            return self.training_taps // 2, self.guard_taps

    @classmethod
    def params_type(cls):
        return cls.Window

    def step(self, block):
        power = np.abs(block.frames.preamble) ** 2
        total = np.cumsum(power, axis=1)
        mean = np.ones_like(power)
        mean[:, 7:-7] = (total[:, 13:-1] - total[:, :-14] - power[:, 7:-7]) / 12
        with np.errstate(all="ignore"):
            score = 10 * np.log10(power / mean)
        score[:, :7] = score[:, -7:] = 0
        row, tap = np.nonzero(score > 10)
        return block.replace(detections=Detections(
            block.frames.index[row], tap=tap, amplitude=np.sqrt(power[row, tap]), score_db=score[row, tap]))


class LetsNanPass(Filter[Params]):
    """Rejects scores below 9 dB."""

    consumes = ports("detections", "score_db")

    class Limits(Params):
        minimum_db: float = 9.0

    @classmethod
    def params_type(cls):
        return cls.Limits

    def keep(self, block):
        return ~(block.detections["score_db"] < self.params.minimum_db)


class InfiniteScore(Stage[Params]):
    """Amplitude over noise, whatever the noise is."""

    consumes = ports("detections", "amplitude", "noise")
    produces = ports("score_db")

    class Choices(Params):
        amplitude: str = "raw"

    @classmethod
    def params_type(cls):
        return cls.Choices

    def step(self, block):
        with np.errstate(all="ignore"):
            ratio = block.detections["amplitude"] / block.part("noise_rms")[block.rows]
            return block.with_columns(score_db=20 * np.log10(ratio))


class Unclipped(Stage[Params]):
    """Arcsine without a limit."""

    consumes = ports("detections", "pdoa_rad")
    produces = ports("azimuth_rad")

    class Limits(Params):
        bias_deg: float = 0.0
        sign: int = 1

    @classmethod
    def params_type(cls):
        return cls.Limits

    def step(self, block):
        with np.errstate(all="ignore"):
            return block.with_columns(azimuth_rad=np.arcsin(block.detections["pdoa_rad"] / np.pi) / 0.95)


class ConjugateProduct(Stage[Params]):
    """Angle of a conjugate product, which is +pi for opposite phases."""

    consumes = ports("frames", "detections", "tap")
    produces = ports("pdoa_rad")
    needs = ports("sts")

    class Choices(Params):
        reference: str = "none"
        sample: str = "same_tap"
        phase: str = "atan2"
        wrap: str = "half_open"

    @classmethod
    def params_type(cls):
        return cls.Choices

    def step(self, block):
        at = block.rows, block.detections["tap"].astype(int)
        return block.with_columns(pdoa_rad=np.angle(block.frames.sts2[at] * block.frames.sts1[at].conj()))


class NaiveScale(Stage[Params]):
    """Magnitudes scaled to the span from 0 to 1, constant frames too."""

    consumes = ports("frames")
    produces = ports("profile")

    def step(self, block):
        height = np.abs(block.frames.preamble)
        low, high = height.min(axis=1, keepdims=True), height.max(axis=1, keepdims=True)
        return block.replace(profile=(height - low) / (high - low))


class GramClutter(Stage[Params]):
    """Everything but the strongest direction of the window's Gram matrix."""

    consumes = ports("frames")
    produces = ports("frames")

    class Window(Params):
        window_frames: int = 32
        rank: int = 1

        @property
        def largest_rank(self):
            return self.rank

        def frames_for(self, radar):
            return self.window_frames

    @classmethod
    def params_type(cls):
        return cls.Window

    def step(self, block):
        samples = block.frames.preamble
        _, vectors = np.linalg.eigh(samples.conj().T @ samples)
        _, left = vectors[:, -1:], vectors[:, -2:-1]
        return block.replace(frames=block.frames.with_preamble((samples @ left) @ left.conj().T))


class Plane(Stage[Params]):
    """DBSCAN at single precision, with distances by products."""

    consumes = ports("detections", "x_m", "y_m")
    produces = ports("cluster")

    class Settings(Params):
        eps_m: float = 0.2
        min_samples: int = 20
        window: int | None = None

    @classmethod
    def params_type(cls):
        return cls.Settings

    def step(self, block):
        from sklearn.cluster import DBSCAN

        found = block.detections
        points = np.stack([found["x_m"], found["y_m"]], axis=1).astype(np.float32)
        square = (points**2).sum(axis=1)
        apart = np.sqrt(np.maximum(square[:, None] + square - 2 * points @ points.T, 0))
        model = DBSCAN(eps=self.params.eps_m, min_samples=self.params.min_samples, metric="precomputed")
        return block.with_columns(cluster=model.fit(apart).labels_)


class EchoOfNan(Stage[Params]):
    """A detection in every frame, with an amplitude that is the mean of all so far."""

    consumes = ports("frames")
    produces = ports("detections", "tap", "amplitude", "range_m")

    def open(self, radar):
        super().open(radar)
        self.total = 0.0

    def step(self, block):
        total = self.total + np.cumsum(np.abs(block.frames.preamble).sum(axis=1))
        self.total = total[-1] if len(total) else self.total
        ones = np.ones(len(total))
        return block.replace(detections=Detections(block.frames.index, tap=ones, amplitude=total, range_m=total))


class PlainSoftmax(Stage[Params]):
    """A row for every frame, with a softmax whose exponentials overflow."""

    consumes = ports("frames", "first_path")
    produces = ports("detections", "probability")

    def step(self, block):
        with np.errstate(all="ignore"):
            there = np.exp(np.abs(block.frames.preamble[:, 10:]).max(axis=1).astype(np.float32))
            found = there / (1 + there)
        return block.replace(detections=Detections(block.frames.index, probability=found))
'''


@pytest.fixture
def faulty(install_plugin) -> None:
    """Stages with one fault each."""
    install_plugin(
        "faulty",
        {
            "stages": {
                "cfar.running_sums": "uwbbench_faulty:RunningSums",
                "filter.snr.passes_nan": "uwbbench_faulty:LetsNanPass",
                "score.snr.infinite": "uwbbench_faulty:InfiniteScore",
                "azimuth.unclipped": "uwbbench_faulty:Unclipped",
                "pdoa.product": "uwbbench_faulty:ConjugateProduct",
                "profile.naive": "uwbbench_faulty:NaiveScale",
                "clutter.svd.gram": "uwbbench_faulty:GramClutter",
                "dbscan.plane": "uwbbench_faulty:Plane",
                "echo.of_nan": "uwbbench_faulty:EchoOfNan",
                "classify.plain": "uwbbench_faulty:PlainSoftmax",
            }
        },
        {"uwbbench_faulty.py": FAULTY},
    )
