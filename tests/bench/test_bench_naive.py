"""The script that speed is measured against does the same work as the detectors."""

import frames as made
import naive
import numpy as np
import pytest

from uwbbench.api import Capture, Detections
from uwbbench.detect.pipeline import load_detector


def kept(expected):
    """(frame, tap) of the peaks that the script kept."""
    return [(frame, peak.tap) for frame, peak in enumerate(expected) if peak is not None]


def peaks(found: Detections):
    ordered = found.take(np.argsort(found.frame, kind="stable"))
    return list(zip(ordered.frame.tolist(), ordered["tap"].tolist(), strict=True))


CAPTURES = {
    "approach on channel 5": lambda: made.approach(400, channel=5, sts=False),
    "approach on channel 9": lambda: made.approach(400, channel=9, sts=False),
    "echoes in 50 taps": lambda: made.echoes(300, 50),
    "echoes in 1 016 taps": lambda: made.echoes(50, 1016),
    "combs": lambda: made.comb(200, 100),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CAPTURES)
def test_the_script_keeps_the_peaks_of_paper_filtering(name):
    capture: Capture = CAPTURES[name]()
    expected = naive.filtering(capture, capture.frames())
    found = load_detector("paper-filtering").run(capture)
    assert peaks(found) == kept(expected)
    assert len(found) > len(capture) // 2
    for column in ("amplitude", "prominence", "width_taps", "score_db", "range_m"):
        values = [getattr(peak, column) for peak in expected if peak is not None]
        np.testing.assert_allclose(found[column], values, rtol=1e-3, atol=1e-4)  # the script keeps single precision


@pytest.mark.slow
def test_the_script_filters_by_phase_where_there_is_sts():
    capture = made.tour(400)
    expected = naive.filtering_with_sts(capture, capture.frames())
    assert kept(expected) == peaks(load_detector("paper-filtering").run(capture))
    assert kept(expected) != kept(naive.filtering(capture, capture.frames()))


@pytest.mark.slow
def test_the_script_maps_the_points_and_clusters_of_paper():
    capture = made.tour(700)
    expected, mapper = naive.mapping(capture, capture.frames())
    found = load_detector("paper").run(capture)
    assert peaks(found) == kept(expected)
    ordered = found.take(np.argsort(found.frame, kind="stable"))
    points_m = np.stack([ordered["x_m"], ordered["y_m"]], axis=1)
    np.testing.assert_allclose(mapper.points, points_m, rtol=0, atol=1e-5)

    settled = len(mapper.labels)
    assert settled == len(found) // naive.EVERY * naive.EVERY > 0
    clustered = mapper.labels >= 0
    assert clustered.any()
    np.testing.assert_array_equal(ordered["cluster"][:settled] >= 0, clustered)


def test_a_lengthened_capture_repeats_its_frames():
    short = made.approach(10)
    long = made.lengthened(short, 25)
    np.testing.assert_array_equal(long.frames(8, 12).preamble, short.preamble[[8, 9, 0, 1]])
    np.testing.assert_array_equal(long.frames(18, 25).sts2, short.sts2[[8, 9, 0, 1, 2, 3, 4]])
    assert len(long) == 25
