import dataclasses

import numpy as np
import pytest

from uwbbench.api import ConfigError
from uwbbench.detect.pipeline import load_detector
from uwbbench.show.figures.cir import draw_cir

INTERVAL_NS = 1e9 / (2 * 499.2e6)


def test_the_peaks_of_the_frame_are_drawn_where_they_are_and_by_their_fate(approach, paper, look):
    seen = look(draw_cir(approach, load_detector("paper"), 224))
    peaks = paper.candidates.take(paper.candidates.frame == 224)
    kept = peaks.take(peaks["retained"] == 1)
    (marks,) = seen.lines("o")
    assert len(kept) == len(marks) == 1
    first_path = kept["tap"][0] - kept["delay_s"][0] * 1e9 / INTERVAL_NS
    assert marks[0, 0] == pytest.approx((kept["tap"][0] - first_path) * INTERVAL_NS)
    dropped = sorted(x for marker in "s^Dv" for line in seen.lines(marker) for x in line[:, 0])
    expected = np.sort((peaks["tap"][peaks["retained"] == 0] - first_path) * INTERVAL_NS)
    np.testing.assert_allclose(dropped, expected)
    assert {"kept", "dropped by filter.first_path", "dropped by filter.prominence"} <= set(seen.legend())


def test_prominences_and_widths_have_the_length_that_the_detector_measured(approach, paper, look):
    seen = look(draw_cir(approach, load_detector("paper"), 224))
    peaks = paper.candidates.take(paper.candidates.frame == 224)
    upright, level = (np.array(lines.get_segments()) for lines in seen.axes[0].collections)
    np.testing.assert_allclose(upright[:, 1, 1] - upright[:, 0, 1], peaks["prominence"])
    np.testing.assert_allclose(level[:, 1, 0] - level[:, 0, 0], peaks["width_taps"] * INTERVAL_NS)
    curve = next(line for line in seen.axes[0].lines if line.get_marker() == ".")
    for segment in level:  # both ends of a width lie on the curve
        np.testing.assert_allclose(np.interp(segment[:, 0], *curve.get_data()), segment[:, 1], atol=1e-9)


def test_axes_have_units_and_the_caption_says_what_is_shown(approach, look):
    seen = look(draw_cir(approach, load_detector("paper"), 10))
    upper, lower = seen.axes[:2]
    assert lower.get_xlabel() == "Delay behind the first path (ns)"
    assert lower.get_ylabel() == "Amplitude (dB)"
    assert upper.child_axes[0].get_xlabel() == "Range on boresight (m)"
    assert seen.caption.startswith("SIMULATED capture approach-ch9-metal-1, channel 9, receiver front. Detector paper.")
    assert "Frame 10 of 449" in seen.caption


def test_the_noise_floor_is_that_of_the_detector(approach, look):
    seen = look(draw_cir(approach, load_detector("paper"), 100))
    amplitude = np.abs(approach.preamble[100].astype(complex))
    expected = 20 * np.log10(np.sqrt(np.mean(amplitude[:4] ** 2)) / amplitude.max())
    floor = next(line for line in seen.axes[1].lines if line.get_linestyle() == ":")
    assert floor.get_ydata()[0] == pytest.approx(expected)


def test_the_middle_frame_with_a_detection_is_shown_by_default(approach, look):
    assert "Frame 224 of" in look(draw_cir(approach, load_detector("paper"))).caption


def test_a_detector_without_prominences_is_drawn_without_them(approach, look):
    seen = look(draw_cir(approach, load_detector("cfar-os"), 200))
    assert "prominence" not in seen.legend()
    assert "kept" in seen.legend()


@pytest.mark.parametrize("frame", [-1, 449])
def test_a_frame_that_does_not_exist_is_refused(approach, frame):
    with pytest.raises(ConfigError, match=f"has frames 0 to 448, not {frame}"):
        draw_cir(approach, load_detector("paper"), frame)


def test_an_invalid_frame_is_refused(approach_without_sts):
    samples = np.array(approach_without_sts.preamble)
    samples[3, 5] = np.nan
    broken = dataclasses.replace(approach_without_sts, preamble=samples)
    with pytest.raises(ConfigError, match="frame 3 holds samples that are not finite"):
        draw_cir(broken, load_detector("paper"), 3)


def test_a_frame_of_zeros_is_drawn(approach_without_sts, look):
    samples = np.array(approach_without_sts.preamble)
    samples[3] = 0
    silent = dataclasses.replace(approach_without_sts, preamble=samples)
    assert "kept" not in look(draw_cir(silent, load_detector("paper"), 3)).legend()
