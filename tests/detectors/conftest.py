"""Running one stage alone on made-up frames, whole or cut into blocks."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from uwbbench.api import Block, Frames, Radar, Stage
from uwbbench.api.block import PER_FRAME
from uwbbench.api.registry import load_plugin

Maker = Callable[..., Any]


def build_radar(taps: int = 50, **changes: Any) -> Radar:
    """A DW3000-like radar; ``changes`` replace its values."""
    values: dict[str, Any] = {
        "model": "test",
        "center_frequency_hz": 7987.2e6,
        "bandwidth_hz": 499.2e6,
        "sample_interval_s": 1e-9,
        "frame_rate_hz": 48.0,
        "noise_taps": 4,
    }
    return Radar(taps=taps, **{**values, **changes})


def build_block(samples: Any, **parts: Any) -> Block:
    """A block with these samples (frames, taps); frames with a sample that is not finite are invalid and zero.

    Parts that frames have go into them, the others into the block.
    """
    samples = np.asarray(samples)
    valid = np.isfinite(samples).all(axis=1)
    in_frames = {name: parts.pop(name) for name in list(parts) if name in Frames.__dataclass_fields__}
    values: dict[str, Any] = {
        "first": 0,
        "preamble": np.where(valid[:, None], samples, 0).astype(complex),
        "timestamp_s": np.arange(len(samples)) / 48.0,
        "position_m": np.zeros((len(samples), 3)),
        "yaw_rad": np.zeros(len(samples)),
        "valid": valid,
    }
    return Block(Frames(**{**values, **in_frames}), **parts)


def build_stage(name: str, **params: Any) -> Stage[Any]:
    """A registered stage with these parameters."""
    cls = load_plugin("stages", name)
    return cls(cls.params_type().model_validate(params))


def run(stage: Stage[Any], radar: Radar, block: Block, cuts: Sequence[int] = ()) -> Block:
    """All that a stage yields for a block handed over in pieces, the flush included."""
    stage.open(radar)
    edges = [0, *sorted(cuts), len(block.frames)]
    yielded = [stage.step(block.cut(start, stop)) for start, stop in pairwise(edges)]
    tail = stage.flush()
    return Block.join([*yielded, *([] if tail is None else [tail])])


def assert_same(one: Block, other: Block) -> None:
    """Bit-equal samples, levels, profiles and detections."""
    np.testing.assert_array_equal(one.frames.index, other.frames.index)
    np.testing.assert_array_equal(one.frames.preamble, other.frames.preamble)
    for name in PER_FRAME:
        ours, theirs = getattr(one, name), getattr(other, name)
        assert (ours is None) == (theirs is None)
        if name == "aligned" and ours is not None:
            ours, theirs = ours.magnitude, theirs.magnitude
        if name.startswith("window") and ours is not None:
            assert ours.refused == theirs.refused
            ours, theirs = ours.of_frames, theirs.of_frames
        if ours is not None:
            np.testing.assert_array_equal(ours, theirs)
    assert one.detections.columns.keys() == other.detections.columns.keys()
    for name, column in one.detections.columns.items():
        np.testing.assert_array_equal(column, other.detections.columns[name])


def run_twice(name: str, params: dict[str, Any], radar: Radar, block: Block, cuts: Sequence[int]) -> Block:
    """What a stage yields for the whole block, after checking that the cut one gives the same results and notes."""
    whole, cut = build_stage(name, **params), build_stage(name, **params)
    result = run(whole, radar, block)
    assert_same(result, run(cut, radar, block, cuts))
    assert whole.notes == cut.notes
    return result


def build_echoes(frames: int, taps: int = 50, seed: int = 0) -> np.ndarray:
    """Direct path at tap 7, ringing, a receding echo and noise; one frame invalid, one zero, one much stronger."""
    rng = np.random.default_rng(seed)
    tap = np.arange(taps)
    fixed = np.exp(-((tap - 7.2) ** 2) / 3) + 0.3j * np.exp(-((tap - 9.0) ** 2) / 2)
    place = 15 + np.arange(frames)[:, None] * 0.1
    moving = 0.1 * np.exp(-((tap - place) ** 2) / 3) * np.exp(1j * place)
    noise = 1e-3 * (rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps)))
    samples = fixed + moving + noise
    if frames > 20:
        samples[5] = np.nan
        samples[11] = 0
        samples[17] *= 1e6
    return samples


@pytest.fixture(scope="session")
def make_radar() -> Maker:
    return build_radar


@pytest.fixture(scope="session")
def make_block() -> Maker:
    return build_block


@pytest.fixture(scope="session")
def make_stage() -> Maker:
    return build_stage


@pytest.fixture(scope="session")
def run_stage() -> Maker:
    return run


@pytest.fixture(scope="session")
def run_cut() -> Maker:
    return run_twice


@pytest.fixture(scope="session")
def make_echoes() -> Maker:
    return build_echoes


@pytest.fixture(scope="session")
def one_by_one() -> Maker:
    return lambda frames: list(range(1, frames))
