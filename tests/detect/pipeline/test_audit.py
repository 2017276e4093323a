"""The pipeline: what its filters dropped, and that asking for it changes nothing."""

import numpy as np
import pytest

from tests.detect.pipeline.conftest import CHAIN, assert_same, capture_of, detector
from uwbbench import load_detector


@pytest.mark.parametrize("steps", [CHAIN, (*CHAIN[:2], "late", *CHAIN[2:]), (*CHAIN, "late")])
@pytest.mark.parametrize("invalid", [(), (0, 4)])
def test_retained_and_rejected_add_up_to_the_candidates(steps, invalid):
    capture = capture_of(invalid=invalid)
    found = detector(*steps).run(capture, candidates=True)
    candidates = found.candidates
    retained = candidates["retained"] == 1
    amplitude = np.abs(capture.preamble.astype(complex))[np.setdiff1d(np.arange(10), invalid)]
    assert len(candidates) == amplitude.size
    assert retained.sum() == len(found) == (amplitude >= 1.0).sum()
    np.testing.assert_array_equal(np.sort(candidates["amplitude"][retained]), np.sort(found["amplitude"]))


def test_the_chain_counts_what_is_left_behind_each_step():
    capture = capture_of()
    amplitude = np.abs(capture.preamble.astype(complex))
    some, few = int((amplitude >= 0.5).sum()), int((amplitude >= 1.0).sum())
    for steps in (CHAIN, (*CHAIN[:2], "late", *CHAIN[2:])):
        chain = list(detector(*steps).run(capture).chain.values())
        assert sorted(chain, reverse=True) == chain
        assert list(dict.fromkeys(chain)) == [40, some, few]


@pytest.mark.parametrize("place", [1, 2, 3])
def test_rejected_candidates_are_described_like_retained_ones(place):
    """Also where a stage holds frames back between the filter and the description."""
    steps = list(CHAIN)
    steps.insert(place, ("late", "{frames: 3}"))
    found = detector(*steps).run(capture_of(), candidates=True).candidates
    described = ~np.isnan(found["range_m"])
    np.testing.assert_array_equal(found["range_m"][described], (found["tap"] + 100.0 * found.frame)[described])
    assert described[found["retained"] == 1].all()
    assert described.all()


def test_candidates_are_the_same_whether_asked_for_before_or_after():
    pipeline, capture = detector(*CHAIN), capture_of()
    assert_same(pipeline.run(capture).candidates, pipeline.run(capture, candidates=True).candidates)


@pytest.mark.parametrize("steps", [CHAIN, (*CHAIN[:2], ("late", "{frames: 3}"), *CHAIN[2:])])
def test_the_audit_names_the_filter_that_dropped_each_candidate(steps):
    found = detector(*steps).run(capture_of(invalid=[2]), candidates=True)
    candidates, labels = found.candidates, list(found.chain)
    amplitude, by = candidates["amplitude"], candidates["rejected_by"]
    np.testing.assert_array_equal(by == labels.index("at_least-1"), amplitude < 0.5)
    np.testing.assert_array_equal(
        by == labels.index(f"at_least-{len(steps) - 1}"), (amplitude >= 0.5) & (amplitude < 1)
    )
    np.testing.assert_array_equal(np.isnan(by), candidates["retained"] == 1)


def test_signals_are_the_blocks_that_the_first_detecting_stage_is_handed(approach):
    blocks = list(load_detector("background-mean").signals(approach))
    assert sum(len(block.frames) for block in blocks) == len(approach)
    assert all(block.profile is not None and block.noise_rms is not None for block in blocks)
    assert not any(len(block.detections) for block in blocks)
    raw, cleaned = approach.frames(200, 201).amplitude[0], blocks[0].frames.amplitude[200]
    assert abs(np.argmax(raw) - 7) <= 1  # the direct path
    assert np.argmax(cleaned) > 12  # the plate


def test_the_audit_changes_no_result():
    pipeline, capture = detector(*CHAIN, "late"), capture_of()
    assert_same(pipeline.run(capture), pipeline.run(capture, candidates=True))
