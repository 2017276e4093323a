"""Hard cases of the stages of this package: inputs at which single stages break."""

from uwbbench.api import cases_of
from uwbbench_detectors.hard_cases import clustering, clutter, geometry, learning, peaks, samples, segments, thresholds

CASES = cases_of(samples, peaks, thresholds, segments, geometry, clutter, clustering, learning)
