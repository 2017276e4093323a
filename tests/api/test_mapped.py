"""Reading a file of samples in bounded memory."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from uwbbench.api import Capture, Radar, Trajectory, open_capture, write_capture
from uwbbench.api.mapped import MappedSamples

FRAMES, TAPS, MEGABYTE = 200_000, 50, 1 << 20


@pytest.fixture(scope="module")
def long_file(tmp_path_factory) -> Path:
    """200 000 frames: 80 MB of samples."""
    path = tmp_path_factory.mktemp("long") / "long.h5"
    samples = np.broadcast_to(np.ones(TAPS, np.complex64), (FRAMES, TAPS))
    radar = Radar("test", 8e9, 5e8, 1e-9, 50.0, taps=TAPS)
    track = Trajectory(np.arange(FRAMES) / 50.0, np.zeros((FRAMES, 3)), np.zeros(FRAMES))
    write_capture(path, Capture(name="long", radar=radar, trajectory=track, preamble=samples))
    return path


@pytest.fixture
def mapped(tmp_path: Path) -> tuple[MappedSamples, np.ndarray]:
    """Forty frames behind a header of 24 bytes, of which six may be kept, and the same as an array."""
    samples = np.arange(40 * 8).reshape(40, 8).astype(np.complex64)
    (tmp_path / "samples").write_bytes(bytes(24) + samples.tobytes())
    found = MappedSamples(tmp_path / "samples", samples.dtype, 24, samples.shape)
    found.kept_bytes = 6 * 8 * 8
    return found, samples


@pytest.mark.parametrize(
    "key", [slice(3, 9), slice(None), 5, slice(0, 0), [4, 1], (slice(None), 2), np.arange(40) > 30]
)
def test_mapped_samples_are_sliced_like_an_array(mapped, key) -> None:
    found, expected = mapped
    np.testing.assert_array_equal(found[key], expected[key])


def test_mapped_samples_become_an_array(mapped) -> None:
    found, expected = mapped
    np.testing.assert_array_equal(np.asarray(found), expected)
    assert (found.shape, found.dtype, len(found)) == (expected.shape, expected.dtype, 40)


def test_views_stay_right_after_their_memory_was_given_back(mapped) -> None:
    found, expected = mapped
    views = [found[start : start + 5] for start in range(0, 40, 5)]
    np.testing.assert_array_equal(np.concatenate(views), expected)


def test_blocks_of_a_long_file_allocate_no_samples(long_file: Path) -> None:
    capture = open_capture(long_file)
    tracemalloc.start()
    try:
        assert sum(int(frames.valid.sum()) for frames in capture.blocks(4096)) == FRAMES
        assert tracemalloc.get_traced_memory()[1] < 2 * MEGABYTE
    finally:
        tracemalloc.stop()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell what is resident")
def test_blocks_of_a_long_file_keep_a_bounded_part_of_it_resident(long_file: Path) -> None:
    def resident_file_bytes() -> int:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("RssFile"))

    capture = open_capture(long_file)
    before = resident_file_bytes()
    most = max(resident_file_bytes() for _ in capture.blocks(4096)) - before
    assert most < MappedSamples.kept_bytes + 16 * MEGABYTE < FRAMES * TAPS * 8


def test_opening_a_long_file_allocates_no_samples(long_file: Path) -> None:
    tracemalloc.start()
    try:
        capture = open_capture(long_file)
        poses = sum(array.nbytes for array in vars(capture.trajectory).values())
        assert tracemalloc.get_traced_memory()[1] < poses + 6 * MEGABYTE
    finally:
        tracemalloc.stop()
