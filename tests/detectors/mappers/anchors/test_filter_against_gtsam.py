"""The filter with known association is that of the factor graph, where both are linear."""

import numpy as np
import pytest

from uwbbench.api import FloatArray, compose
from uwbbench_detectors.mappers.ekf import Ekf
from uwbbench_detectors.mappers.motion import Motion, MotionParams
from uwbbench_detectors.mappers.point import PointModel
from uwbbench_detectors.mappers.smoothing import Problem, Sightings, smooth

NOISE = np.diag([0.06**2, np.radians(6.0) ** 2])
POINTS_M = np.array([[1.5, 0.8], [0.4, -1.1], [2.2, -0.5]])
MOTION = MotionParams(along_sd_m=0.02, across_sd_m=0.01)
NODES = 9

ERROR = 1e-8
"""Of odometry and sightings: so small that everything is linear, and that what is left of it is seen in 16 digits."""

TOLERANCE = 1e-5 * ERROR

# By gtsam 4.3.0, of the problem below.
POSE = [1.6637064836070699, 0.9959839036408159, 0.9599999753759388]
POSE_COVARIANCE = [
    [0.001349409449924006, -0.00019790965668422828, -0.0007321738053133629],
    [-0.00019790965668422817, 0.0010049813707991566, 0.0007279758933335451],
    [-0.0007321738053133629, 0.0007279758933335451, 0.0011833472021590269],
]
POINT = [1.4999999962862798, 0.7999999989945765]
POINT_COVARIANCE = [
    [0.0009762666677377916, -0.00016833911339489093],
    [-0.00016833911339489093, 0.0007501114983566365],
]
SCALES = [1.0629880567507659e-08, 2.415764196453547e-09]


def steps() -> FloatArray:
    """Movements along a bend, so small errors in them that everything is linear."""
    rng = np.random.default_rng(5)
    return np.tile([0.25, 0.03, 0.12], (NODES - 1, 1)) + ERROR * rng.standard_normal((NODES - 1, 3))


def sightings(poses: FloatArray) -> FloatArray:
    """Ranges and bearings (nodes, points, 2) with errors as small."""
    rng = np.random.default_rng(6)
    exact = np.array([PointModel().expected(pose, POINTS_M)[0] for pose in poses])
    return np.asarray(exact + ERROR * rng.standard_normal(exact.shape))


def driven(moved: FloatArray) -> FloatArray:
    """Poses (nodes, 3) after the movements."""
    poses = [np.zeros(3)]
    for step in moved:
        poses.append(compose(poses[-1], step))
    return np.array(poses)


def filtered() -> Ekf:
    """The filter after the run."""
    moved = steps()
    seen = sightings(driven(np.tile([0.25, 0.03, 0.12], (NODES - 1, 1))))
    ekf = Ekf(np.zeros(3), MOTION)
    for node in range(NODES):
        if node:
            ekf.predict(moved[node - 1])
        for point in range(len(POINTS_M)):
            if node == 0:
                ekf.add(PointModel(), seen[0, point], NOISE)
            else:
                ekf.update(PointModel(), point, seen[node, point], NOISE)
    return ekf


def problem() -> Problem:
    """The same run for the factor graph."""
    moved = steps()
    poses = driven(moved)
    seen = sightings(driven(np.tile([0.25, 0.03, 0.12], (NODES - 1, 1))))
    motion = Motion(MOTION)
    known = [motion.predicted(np.zeros(5), step) for step in moved]
    return Problem(
        poses=poses,
        landmarks=POINTS_M,
        moved=moved,
        by_scales=np.array([by_head[:, 3:] for _, by_head, _ in known]),
        noise=np.array([noise for _, _, noise in known]),
        scale_sd=np.sqrt(motion.start_variance[3:]),
        sightings=Sightings(
            np.repeat(np.arange(NODES), len(POINTS_M)),
            np.tile(np.arange(len(POINTS_M)), NODES),
            seen.reshape(-1, 2),
            np.tile(np.sqrt(np.diag(NOISE)), (NODES * len(POINTS_M), 1)),
        ),
        huber=1.345,
    )


def test_filter_with_known_association_gives_what_gtsam_gave() -> None:
    ekf = filtered()
    points = ekf.landmarks()
    np.testing.assert_allclose(ekf.pose, POSE, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(points.position_m[0], POINT, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(ekf.scales, SCALES, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(ekf.pose_covariance, POSE_COVARIANCE, rtol=1e-6)
    np.testing.assert_allclose(points.covariance[0], POINT_COVARIANCE, rtol=1e-6)


def test_filter_with_known_association_equals_the_factor_graph() -> None:
    pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'uwbbench[slam]'")
    ekf, graph = filtered(), smooth(problem())
    points = ekf.landmarks()
    np.testing.assert_allclose(ekf.pose, graph.poses[-1], rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(points.position_m, graph.landmarks, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(ekf.pose_covariance, graph.covariance[-1], rtol=1e-6)
    blocks = graph.joint.reshape(3, 2, 3, 2)
    np.testing.assert_allclose(points.covariance, blocks[range(3), :, range(3)], rtol=1e-6)
