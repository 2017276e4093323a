"""How detections of a kernel and of the plain stages are compared."""

import numpy as np

from uwbbench.api import Detections

ROUNDED = ("tap", "score_db", "pdoa_rad", "azimuth_rad", "delay_s", "range_m", "x_m", "y_m")
"""Columns behind a logarithm or an angle, which different libraries round differently; others agree to the bit."""


def assert_same(fused: Detections, plain: Detections) -> None:
    """The same detections in the same order, equal columns, processed frames and notes."""
    assert list(fused.columns) == list(plain.columns)
    np.testing.assert_array_equal(fused.frame, plain.frame)
    np.testing.assert_array_equal(fused.processed, plain.processed)
    assert fused.notes == plain.notes, (fused.notes, plain.notes)
    for name in fused.columns:
        if name in ROUNDED:
            np.testing.assert_allclose(fused[name], plain[name], rtol=1e-12, atol=1e-12, err_msg=name)
        else:
            np.testing.assert_array_equal(fused[name], plain[name], err_msg=name)
