import dataclasses

import numpy as np
import pytest

from uwbbench.api import ConfigError, Obstacle, Trajectory, Truth
from uwbbench.detect.pipeline import detector_from_yaml, load_detector
from uwbbench.show.figures.radargram import draw_radargram


def cut(capture, frames):
    """The first frames of a capture."""
    track = capture.trajectory
    part = Trajectory(track.timestamp_s[:frames], track.position_m[:frames], track.yaw_rad[:frames])
    names = ("preamble", "first_path_index")
    return dataclasses.replace(capture, trajectory=part, **{name: getattr(capture, name)[:frames] for name in names})


def test_detections_and_truth_are_drawn_where_they_are(approach, paper, look):
    seen = look(draw_radargram(approach, load_detector("paper")))
    (points,) = seen.lines("o")
    found = paper.detections
    time_s = approach.trajectory.timestamp_s
    in_order = np.argsort(found.frame, kind="stable")
    points = points[np.argsort(points[:, 0], kind="stable")]
    np.testing.assert_allclose(points[:, 0], time_s[found.frame[in_order]])
    np.testing.assert_allclose(points[:, 1], found.range_m[in_order])
    truth = seen.legend()["true range, plate"]
    truth = next(
        one for one in seen.axes[0].lines if (one.get_linestyle(), one.get_color()) == ("--", truth.get_color())
    )
    sight = approach.truth.seen_from(approach.radar, approach.trajectory)
    np.testing.assert_allclose(truth.get_ydata(), sight.range_m[:, 0])
    assert set(seen.legend()) == {"true range, plate", f"detections ({len(found)})"}


def test_truth_is_drawn_thin_outside_the_sector_that_scores_look_at(approach_without_sts, look):
    beside = Obstacle("post", "metal", np.array([[1.4, 1.0]]))
    capture = dataclasses.replace(approach_without_sts, truth=Truth((beside,)))
    seen = look(draw_radargram(capture))
    thin, thick = (line.get_ydata() for line in seen.axes[0].lines)
    ahead = capture.trajectory.position_m[:, 0] <= 1.4
    assert np.isfinite(thin).all()
    np.testing.assert_array_equal(np.isfinite(thick), ahead)
    assert "Truth is thin farther than 90 degrees" in seen.caption


def test_the_image_is_brightest_at_the_echo(approach, look):
    """Beyond the direct path's pulse the strongest cell of each column lies at the true range, within a tap."""
    seen = look(draw_radargram(approach))
    mesh = seen.axes[0].collections[0]
    image = np.ma.filled(mesh.get_array(), np.nan)
    edges_m = np.asarray(mesh.get_coordinates())[:, 0, 1]
    range_m = (edges_m[1:] + edges_m[:-1]) / 2
    far = range_m > 1.4
    true_m = approach.truth.seen_from(approach.radar, approach.trajectory).range_m[:, 0]
    columns = np.flatnonzero(true_m > 1.8)
    strongest = range_m[far][np.argmax(np.nan_to_num(image[far][:, columns], nan=-np.inf), axis=0)]
    assert np.median(np.abs(strongest - true_m[columns])) < 0.08
    assert np.max(np.abs(strongest - true_m[columns])) < 0.3


def test_axes_have_units_and_the_scale_is_in_db(approach, look):
    seen = look(draw_radargram(approach, load_detector("background-mean")))
    assert (seen.axes[0].get_xlabel(), seen.axes[0].get_ylabel()) == ("Time (s)", "Range (m)")
    assert seen.axes[1].get_ylabel() == "Amplitude (dB below the strongest)"
    assert "Detector background-mean." in seen.caption
    assert "SIMULATED" in seen.caption


def test_clutter_that_the_detector_removes_is_not_in_its_image(approach, look):
    """The direct path stands in the raw image, and is gone where the mean of past frames was taken away."""
    rows = {}
    for name in (None, "background-mean"):
        mesh = look(draw_radargram(approach, name and load_detector(name))).axes[0].collections[0]
        rows[name] = np.median(np.ma.filled(mesh.get_array(), np.nan)[4])
    assert rows["background-mean"] < rows[None] - 6


def test_invalid_frames_stay_empty(approach_without_sts, look):
    part = cut(approach_without_sts, 30)
    samples = np.array(part.preamble)
    samples[7, 3] = np.nan
    mesh = look(draw_radargram(dataclasses.replace(part, preamble=samples))).axes[0].collections[0]
    empty = np.ma.getmaskarray(mesh.get_array()) | np.isnan(np.ma.getdata(mesh.get_array()))
    assert empty[:, 7].all()
    assert not empty[:, 6].all()


@pytest.mark.parametrize("frames", [1, 2])
def test_very_short_captures_are_drawn(approach_without_sts, frames, look):
    part = cut(approach_without_sts, frames)
    assert look(draw_radargram(part, load_detector("paper"))).axes[0].get_ylabel() == "Range (m)"


def test_frames_of_zeros_are_drawn(approach_without_sts, look):
    part = cut(approach_without_sts, 5)
    silent = dataclasses.replace(part, preamble=np.zeros_like(part.preamble))
    assert look(draw_radargram(silent)).axes[0].get_ylabel() == "Range (m)"


def test_an_empty_capture_is_refused(approach_without_sts):
    with pytest.raises(ConfigError, match="has no frames"):
        draw_radargram(cut(approach_without_sts, 0))


def test_a_detector_without_ranges_is_refused(approach):
    steps = "schema: 1\nname: a\npipeline: [{use: profile.amplitude}, {use: peaks}]\n"
    with pytest.raises(ConfigError, match="add the stage 'range'"):
        draw_radargram(approach, detector_from_yaml(steps))
