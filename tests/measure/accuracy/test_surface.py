"""What the error of a position is the distance to: the outline, or what the receiver can see of it."""

import numpy as np
import pytest

from tests.measure.accuracy.scenes import capture_of
from uwbbench.api import Detections, Obstacle, ScoringError
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes, score
from uwbbench.run.folder.identity import accuracy_identity

BOX = Obstacle("box", "metal", np.array([[2.0, -0.5], [3.0, -0.5], [3.0, 0.5], [2.0, 0.5]]))


def clustered(x_m, y_m):
    """One clustered detection a frame."""
    frames = np.arange(len(x_m))
    place = {"x_m": np.array(x_m, float), "y_m": np.array(y_m, float), "cluster": np.zeros(len(x_m), int)}
    return Detections(frames, range_m=np.hypot(*map(np.array, (x_m, y_m))), processed=frames, **place)


def errors_m(found, capture, surface):
    return outcomes(found, capture, ScoringRules("object", surface=surface))["mapping"].error_m


def test_inside_an_outline_the_error_is_zero_or_the_way_to_the_face_that_is_seen():
    found, capture = clustered([2.1, 2.5, 1.9, 2.5], [0.0, 0.4, 0.0, 0.6]), capture_of(BOX)
    np.testing.assert_allclose(errors_m(found, capture, "outline"), [0, 0, 0.1, 0.1], atol=1e-12)
    np.testing.assert_allclose(errors_m(found, capture, "visible"), [0.1, 0.5, 0.1, np.hypot(0.5, 0.1)], atol=1e-12)


def test_the_face_is_the_one_that_is_seen_from_where_the_receiver_is_in_that_frame():
    capture = capture_of(BOX, frames=2, position_m=[[0, 0, 0], [2.5, -3, 0]], yaw_rad=[0, np.pi / 2])
    found = clustered([2.5, 2.5], [-0.3, -0.3])
    np.testing.assert_allclose(errors_m(found, capture, "visible"), [0.5, 0.2], atol=1e-12)


def test_the_gate_holds_for_the_error_that_was_chosen_and_ranges_do_not_care():
    found, capture = clustered([2.5] * 4, [0.0] * 4), capture_of(BOX)
    outline, visible = (score(found, capture, "object", surface=one) for one in ("outline", "visible"))
    assert (outline.mapping.tp, visible.mapping.tp) == (4, 0)
    assert outline.filtering == visible.filtering


def test_without_the_choice_rules_have_the_identity_that_they_had_before_it():
    usual, visible = (accuracy_identity("d", "c", [ScoringRules(surface=one)]) for one in ("outline", "visible"))
    assert usual == "0eeb660a57359aa5797dcfd479949ce0a734b1fc11f17324e359e159b001200a"
    assert visible != usual


def test_an_unknown_surface_is_refused():
    with pytest.raises(ScoringError, match=r"no surface 'visable'\. Did you mean 'visible'"):
        ScoringRules(surface="visable")
