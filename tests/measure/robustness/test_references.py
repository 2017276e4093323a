"""What the cases compare with: the synthetic capture, the comparisons, and references against mpmath."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.cluster import DBSCAN

from uwbbench.api import Detections, Violation, exact_ulps, magnitude
from uwbbench.api.geometry import bistatic_range, bistatic_range_sine
from uwbbench.measure.robustness import case_named
from uwbbench.measure.robustness.compare import flipped_share, hit_share, in_frames, still_found, unchanged
from uwbbench.measure.robustness.scene import RADAR, STEP_M, altered, approach, chosen
from uwbbench_detectors.clutter.svd import dominant_shapes
from uwbbench_detectors.hard_cases.clustering import textbook_clusters
from uwbbench_detectors.hard_cases.geometry import EXCESS_M, _range_m


def ranges(frames: list[int], range_m: list[float], **columns: list[float]) -> Detections:
    return Detections(frames, range_m=range_m, **columns)


# The capture


def test_the_capture_is_the_same_every_time():
    assert approach().sha256 == approach().sha256


def test_the_robot_approaches_the_target():
    capture = approach()
    range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    assert np.diff(range_m) == pytest.approx(-STEP_M, rel=0.01)


def test_the_echo_stands_where_the_truth_says():
    capture = approach(direct=0.0)
    range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    crest = np.argmax(np.abs(capture.preamble), axis=1)
    delay_s = (crest - capture.first_path_index) * RADAR.sample_interval_s
    ahead = np.tile([1.0, 0.0, 0.0], (len(crest), 1))
    assert bistatic_range(RADAR.excess_m(delay_s), ahead, RADAR.baseline_m) == pytest.approx(range_m, abs=0.15)


def test_altering_a_capture_leaves_it_as_it_was():
    capture = approach(frames=3)
    before = capture.sha256

    def zeroed(samples):
        samples[:] = 0
        return samples

    assert not altered(capture, zeroed).sts2.any()
    assert capture.sha256 == before


def test_chosen_frames_keep_their_poses():
    capture = approach(frames=5)
    part = chosen(capture, np.array([1, 4]))
    np.testing.assert_array_equal(part.preamble, capture.preamble[[1, 4]])
    np.testing.assert_array_equal(part.trajectory.position_m, capture.trajectory.position_m[[1, 4]])


# The comparisons


def test_unchanged_ignores_the_order_within_a_run():
    one, other = ranges([0, 2, 1], [1.0, 3.0, 2.0]), ranges([0, 1, 2], [1.0, 2.0, 3.0 + 1e-12])
    assert unchanged(one, other, 1e-9).error_m == pytest.approx(1e-12, rel=1e-3)


@pytest.mark.parametrize(
    "other",
    [ranges([0], [1.0]), ranges([0, 2], [1.0, 2.0]), ranges([0, 1], [1.0, 2.1]), ranges([0, 1], [1.0, math.nan])],
)
def test_unchanged_refuses_what_differs(other):
    with pytest.raises(Violation):
        unchanged(ranges([0, 1], [1.0, 2.0]), other, 1e-3)


@pytest.mark.parametrize(
    ("other", "share"),
    [
        (ranges([0, 1], [1.0, 2.0]), 0.0),
        (ranges([0, 1], [1.0, 2.05]), 0.0),
        (ranges([0, 1], [1.0, 2.2]), 0.5),
        (ranges([0], [1.0]), 1 / 3),
        (ranges([], []), 1.0),
    ],
)
def test_flips_are_detections_of_one_run_alone(other, share):
    assert flipped_share(ranges([0, 1], [1.0, 2.0]), other) == pytest.approx(share)


def test_a_change_between_noise_and_cluster_is_a_flip():
    one, other = ranges([0, 1], [1.0, 2.0], cluster=[0, -1]), ranges([0, 1], [1.0, 2.0], cluster=[1, 0])
    assert flipped_share(one, other) == pytest.approx(0.5)


def test_nothing_found_twice_is_no_flip():
    assert flipped_share(ranges([], []), ranges([], [])) == 0.0


def test_frames_are_renumbered_by_their_places():
    found = in_frames(ranges([0, 3, 5, 9], [1.0, 2.0, 3.0, 4.0]), np.array([9, 3]))
    assert dict(zip(found.range_m, found.frame, strict=True)) == {2.0: 1, 4.0: 0}


def test_hits_are_counted_by_frame():
    capture = approach(frames=4)
    true_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    found = ranges([0, 0, 1, 3], [true_m[0], true_m[0] + 0.1, true_m[1] + 0.3, true_m[3] - 0.19])
    assert hit_share(found, capture) == 0.5
    assert hit_share(found, capture, [1, 3]) == 0.5
    with pytest.raises(Violation, match="more than 10% lost"):
        still_found(found, capture, 0.7, 0.10)


# The references


@given(st.floats(1e-15, 1e3), st.floats(1e-3, 10), st.floats(-1, 0.5))
@settings(max_examples=60)
def test_the_exact_range_agrees_with_mpmath(excess_m, distance_m, cosine):
    with mpmath.workdps(60):
        path, base = mpmath.mpf(excess_m) + mpmath.mpf(distance_m), mpmath.mpf(distance_m)
        expected = (path**2 - base**2) / (2 * (path - base * mpmath.mpf(cosine)))
        exact = _range_m(excess_m, distance_m, cosine)
        assert abs(mpmath.mpf(exact.numerator) / exact.denominator / expected - 1) < mpmath.mpf(10) ** -30


def test_units_in_the_last_place_are_those_of_the_exact_value():
    exact = [_range_m(excess, 0.25, 0.0) for excess in EXCESS_M[1:]]
    floats = np.array([float(value) for value in exact])
    assert exact_ulps(floats, exact) <= 0.5
    assert 1 <= exact_ulps(np.nextafter(np.nextafter(floats, np.inf), np.inf), exact) <= 2.5


@given(st.floats(1e-12, 1e-3))
@settings(max_examples=30)
def test_squared_paths_would_fail_where_the_ranges_do_not(excess_m):
    exact = _range_m(excess_m, 0.25, 0.0)
    found = bistatic_range_sine(np.array([excess_m]), np.zeros(1), 0.25)
    assert exact_ulps(found, [exact]) <= 4


def test_magnitudes_agree_with_mpmath():
    rng = np.random.default_rng(1)
    samples = (rng.normal(size=200) + 1j * rng.normal(size=200)).astype(np.complex64)
    with mpmath.workdps(50):
        exact = [mpmath.hypot(mpmath.mpf(float(s.real)), mpmath.mpf(float(s.imag))) for s in samples]
        error = [
            abs(mpmath.mpf(m) - e) / float(np.spacing(float(e)))
            for m, e in zip(magnitude(samples).tolist(), exact, strict=True)
        ]
    assert max(error) <= 1


def test_a_gram_matrix_loses_what_the_svd_keeps():
    heights = [1.0, 1e-5, 1e-10]
    rng = np.random.default_rng(4)
    left, _ = np.linalg.qr(rng.normal(size=(40, 3)))
    right, _ = np.linalg.qr(rng.normal(size=(30, 3)))
    window = (left * heights) @ right.T + 0j
    with mpmath.workdps(40):
        exact = sorted((mpmath.svd_c(mpmath.matrix(window.tolist()), compute_uv=False)), reverse=True)
        third = float(exact[2] / exact[0])
    singular, _ = dominant_shapes(window, 3)
    gram = np.sqrt(np.abs(np.linalg.eigvalsh(window.conj().T @ window)[::-1]))
    assert singular[2] / singular[0] == pytest.approx(third, rel=1e-4)
    assert abs(gram[2] / gram[0] / third - 1) > 1


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_textbook_clusters_are_those_of_the_library_where_nothing_ties(seed):
    points_m = np.random.default_rng(seed).uniform(0, 1, (60, 2))
    model = DBSCAN(eps=0.12, min_samples=5, algorithm="kd_tree").fit(points_m)
    label = textbook_clusters(points_m, 0.12, 5)
    core = model.core_sample_indices_
    np.testing.assert_array_equal(label < 0, model.labels_ < 0)
    pairs = set(zip(label[core].tolist(), model.labels_[core].tolist(), strict=True))
    assert len(pairs) == len({one for one, _ in pairs}) == len({other for _, other in pairs})


def test_a_case_is_found_by_name_or_the_nearest_one_is_told():
    assert case_named("zero-frames").group == "samples"
