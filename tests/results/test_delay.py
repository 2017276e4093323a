import dataclasses

import numpy as np
import pytest

from uwbbench.api import Radar
from uwbbench.api.geometry import bistatic_range, direction
from uwbbench.results.delay import delay_of_range

RADAR = Radar("test", 8e9, 5e8, 1e-9, 50.0, taps=50, tx_position_m=(-0.1, 0.3, 0.05))


@pytest.mark.parametrize("first_tap_delay_s", [None, 5e-9])
def test_the_delay_of_a_range_inverts_the_range_of_a_delay(first_tap_delay_s):
    radar = dataclasses.replace(RADAR, first_tap_delay_s=first_tap_delay_s)
    range_m = np.linspace(0.1, 7.0, 40)
    excess_m = radar.excess_m(delay_of_range(radar, range_m))
    np.testing.assert_allclose(bistatic_range(excess_m, direction(np.zeros(40)), radar.baseline_m), range_m)
