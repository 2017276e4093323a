"""The assignment of detections to tracks."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from uwbbench_detectors.tracks.assignment import assigned


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (4, 4), (3, 7), (7, 3), (12, 12)])
def test_sum_of_costs_is_that_of_scipy(shape):
    rng = np.random.default_rng(sum(shape))
    for ties in (False, True):
        for _ in range(50):
            cost = np.minimum(rng.exponential(size=shape), 1.0) if ties else rng.normal(size=shape)
            found = assigned(cost)
            rows = np.flatnonzero(found >= 0)
            assert len(rows) == len(set(found[rows].tolist())) == min(shape)
            assert cost[rows, found[rows]].sum() == pytest.approx(cost[linear_sum_assignment(cost)].sum(), abs=1e-12)
