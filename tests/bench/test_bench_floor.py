"""The C code that speed is held against is exact: its prominences and widths equal the detector's to the last bit."""

import floor
import frames as made
import numpy as np
import pytest

from uwbbench.api import Capture
from uwbbench.detect.pipeline import load_detector

pytestmark = pytest.mark.skipif(floor.compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> floor.Floor:
    return floor.Floor(tmp_path_factory.mktemp("floor"))


def integers(highest: int, taps: int = 50, frames: int = 400) -> Capture:
    """Frames of small integers: plateaus and ties everywhere."""
    rng = np.random.default_rng(highest)
    parts = rng.integers(-highest, highest + 1, (2, frames, taps))
    return made.recorded((parts[0] + 1j * parts[1]).astype(np.complex64))


def constant() -> Capture:
    """Frames without contrast: zeros, one value, one value with a ripple of rounding."""
    samples = np.ones((3, 50), np.complex64)
    samples[0] = 0
    samples[2, 20] = np.nextafter(np.float32(1), np.float32(2))
    return made.recorded(samples)


def without_noise() -> Capture:
    """Frames whose leading taps are zero, so that no score can be given."""
    samples = made.approach(20, sts=False).preamble.copy()
    samples[:, :4] = 0
    return made.recorded(samples)


CAPTURES = {
    "approach on channel 5": lambda: made.approach(500, channel=5, sts=False),
    "approach on channel 9": lambda: made.approach(500, channel=9, sts=False),
    "combs": lambda: made.comb(300, 50),
    "5 taps": lambda: integers(3, taps=5),
    "16 taps": lambda: made.echoes(300, 16),
    "49 taps": lambda: made.echoes(300, 49),
    "64 taps": lambda: made.echoes(300, 64),
    "ties of 1": lambda: integers(1),
    "ties of 3": lambda: integers(3),
    "ties of 100": lambda: integers(100),
    "no contrast": constant,
    "no noise": without_noise,
}


@pytest.mark.slow
@pytest.mark.parametrize("entry", ["detect_first", "detect_first_plain", "detect_all"])
@pytest.mark.parametrize("name", CAPTURES)
def test_the_floor_finds_what_paper_filtering_finds(library, name, entry):
    capture = CAPTURES[name]()
    found = library.detector(capture.radar, len(capture), entry)(capture.frames().preamble)
    expected = load_detector("paper-filtering").run(capture)
    for column in ("frame", "tap", "amplitude", "prominence", "width_taps", "delay_s"):
        np.testing.assert_array_equal(found[column], expected[column], err_msg=column)
    for column in ("score_db", "range_m"):
        np.testing.assert_allclose(found[column], expected[column], rtol=1e-12, err_msg=column)


def test_the_floor_refuses_frames_that_it_was_not_made_for(library):
    capture = made.approach(10, sts=False)
    detect = library.detector(capture.radar, 10)
    for samples in (
        capture.preamble.astype(np.complex128),
        capture.preamble[:, ::2],
        np.tile(capture.preamble, (2, 1)),
    ):
        with pytest.raises(ValueError, match=r"floor reads|room for"):
            detect(samples)
    with pytest.raises(ValueError, match="64 taps at most, not 65"):
        library.detector(made.echoes(2, 65).radar, 2)
