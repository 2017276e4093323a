"""A grid of log-odds, against the same sums cell by cell."""

import math

import numpy as np
import pytest

from uwbbench.api import Detections, Poses, Step, load_plugin
from uwbbench.api.errors import PluginError
from uwbbench.api.registry import _registered, register
from uwbbench.config.detector import read_detector
from uwbbench.config.identity import detector_identity
from uwbbench.detect.pipeline import Pipeline
from uwbbench.detect.sources import source_hash

START = np.array([0.3, -0.2, 0.4])


@pytest.fixture
def make_mapper():
    def make(**params):
        cls = load_plugin("mappers", "map.occupancy")
        return cls(cls.params_type().model_validate(params))

    return make


@pytest.fixture
def radars(make_radar):
    return {
        "front": make_radar(mount_position_m=(0.0, 0.125, 0.0)),
        "side": make_radar(mount_position_m=(-0.125, 0.0, 0.0), mount_yaw_rad=math.pi / 2),
    }


def drive(steps=40, seed=7001):
    """Steps along an arc, with up to three detections a receiver, some of them not located."""
    rng = np.random.default_rng(seed)
    made = []
    for index in range(steps):
        found = {}
        for receiver in ("front", "side") if index % 2 else ("front",):
            rows = int(rng.integers(0, 4))
            range_m, azimuth_rad = rng.uniform(0.3, 4.0, rows), rng.uniform(-1.2, 1.2, rows)
            range_m[rng.uniform(size=rows) < 0.1] = np.nan
            found[receiver] = Detections(np.full(rows, index), range_m=range_m, azimuth_rad=azimuth_rad)
        moved = np.array([0.03, 0.002, 0.05]) if index else np.zeros(3)
        made.append(Step(index, index / 24, moved, found))
    return made


def mapped(mapper, radars, steps, start=START):
    mapper.open(radars, Poses.of_one(0, start))
    poses = Poses.join([mapper.step(step) for step in steps])
    return poses, mapper.finish()[1]


def cell_by_cell(radars, steps, poses, params):
    """Log-odds by (column, row), from the formula of the class."""
    cell, odds = params.cell_m, {}
    range_sd, azimuth_sd = max(params.range_sd_m, cell / 2), math.radians(params.azimuth_sd_deg)
    low, high = params.clamp
    for step, (x, y, yaw) in zip(steps, poses.pose.tolist(), strict=True):
        for receiver, rows in step.found.items():
            radar = radars[receiver]
            mount = complex(*radar.mount_position_m[:2])
            eye = complex(x, y) + mount * complex(math.cos(yaw), math.sin(yaw))
            beams = [
                (r, yaw + radar.mount_yaw_rad + a)
                for r, a in zip(rows.range_m.tolist(), rows.azimuth_rad.tolist(), strict=True)
                if params.reach_m[0] <= r <= params.reach_m[1] and abs(math.degrees(a)) <= params.azimuth_deg
            ]
            reach = round(5 / cell)
            middle = (math.floor(eye.real / cell), math.floor(eye.imag / cell))
            for column in range(middle[0] - reach, middle[0] + reach) if beams else ():
                for row in range(middle[1] - reach, middle[1] + reach):
                    to = complex((column + 0.5) * cell, (row + 0.5) * cell) - eye
                    occupied = free = 0.0
                    for r, heading in beams:
                        aside = math.remainder(math.atan2(to.imag, to.real) - heading, math.tau) / azimuth_sd
                        beyond = (abs(to) - r) / range_sd
                        if abs(aside) > 2 or beyond > 2:
                            continue
                        weight = math.exp(-(aside**2) / 2)
                        if beyond < -2:
                            free = max(free, weight)
                        else:
                            occupied = max(occupied, weight * math.exp(-(beyond**2) / 2))
                    change = params.occupied * occupied if occupied else -params.free * free
                    if change:
                        odds[column, row] = min(high, max(low, odds.get((column, row), 0.0) + change))
    return odds


def as_cells(grid):
    first = np.round(grid.origin_m / grid.cell_m).astype(int)
    rows, columns = np.nonzero(grid.log_odds)
    keys = zip((columns + first[0]).tolist(), (rows + first[1]).tolist(), strict=True)
    return dict(zip(keys, grid.log_odds[rows, columns].tolist(), strict=True))


@pytest.mark.parametrize("params", [{"cell_m": 0.2}, {"cell_m": 0.35, "azimuth_sd_deg": 20.0, "clamp": (-0.5, 1.0)}])
def test_the_grid_holds_the_sums_of_every_cell(make_mapper, radars, params):
    mapper, steps = make_mapper(**params), drive(12)
    poses, found = mapped(mapper, radars, steps)
    expected, known = cell_by_cell(radars, steps, poses, mapper.params), as_cells(found.grid)
    assert len(expected) > 100
    assert known.keys() == expected.keys()
    for cell, value in expected.items():
        assert known[cell] == pytest.approx(value, abs=1e-9)


def test_poses_are_those_of_dead_reckoning(make_mapper, radars):
    poses, _ = mapped(make_mapper(), radars, drive(30))
    place, yaw = complex(*START[:2]), START[2]
    for _ in range(29):
        place += complex(0.03, 0.002) * complex(math.cos(yaw), math.sin(yaw))
        yaw += 0.05
    assert poses.pose[-1] == pytest.approx([place.real, place.imag, yaw])
    assert poses.index.tolist() == list(range(30))


def test_an_object_is_occupied_and_what_lies_before_it_is_free(make_mapper, radars):
    rows = Detections([0], range_m=[2.0], azimuth_rad=[0.0])
    _, found = mapped(make_mapper(), radars, [Step(0, 0.0, np.zeros(3), {"front": rows})], np.zeros(3))
    cells = as_cells(found.grid)
    assert cells[20, 1] > 0 > cells[10, 1]  # at x = 2.05 m and 1.05 m, before the receiver at y = 0.125 m
    assert (25, 1) not in cells


def test_a_rod_before_a_wall_is_not_erased_by_the_wall_behind_it(make_mapper, radars):
    both = Detections([0, 0], range_m=[1.5, 3.0], azimuth_rad=[0.0, 0.0])
    _, found = mapped(make_mapper(), radars, [Step(0, 0.0, np.zeros(3), {"front": both})], np.zeros(3))
    cells = as_cells(found.grid)
    assert cells[15, 1] > 0
    assert cells[30, 1] > 0
    assert cells[22, 1] < 0


def test_the_log_odds_of_a_standing_robot_stay_within_their_bounds(make_mapper, radars):
    rows = Detections([0], range_m=[2.0], azimuth_rad=[0.0])
    steps = [Step(k, k / 24, np.zeros(3), {"front": rows}) for k in range(50)]
    _, found = mapped(make_mapper(), radars, steps)
    assert (found.grid.log_odds.min(), found.grid.log_odds.max()) == (-2.0, 3.5)


def test_where_cells_lie_does_not_hang_on_what_was_seen_first(make_mapper, radars):
    steps = drive(2)
    still = [Step(k, k / 24, np.zeros(3), step.found) for k, step in enumerate(reversed(steps))]
    ahead = [Step(k, k / 24, np.zeros(3), step.found) for k, step in enumerate(steps)]
    one, other = (as_cells(mapped(make_mapper(), radars, way)[1].grid) for way in (still, ahead))
    assert one.keys() == other.keys()
    assert list(one.values()) == pytest.approx([other[cell] for cell in one])


def test_the_grid_is_no_larger_than_what_was_seen_however_long_the_run(make_mapper, radars):
    rows = Detections([0], range_m=[2.0], azimuth_rad=[0.0])
    steps = [Step(k, k / 24, np.array([0.0, 0.0, 0.3]), {"front": rows}) for k in range(400)]
    mapper = make_mapper()
    _, found = mapped(mapper, radars, steps)
    assert max(found.grid.log_odds.shape) * 0.1 < 5.0
    assert mapper._cells._log_odds.size <= (2 * 64) ** 2


def test_a_robot_that_is_carried_away_costs_no_memory_and_is_said(make_mapper, radars):
    rows = Detections([0], range_m=[2.0], azimuth_rad=[0.0])
    steps = [
        Step(k, k / 24, np.array([moved, 0.0, 0.0]), {"front": rows}) for k, moved in enumerate([0, 1e6, 0, -1e6, 0.2])
    ]
    mapper = make_mapper(extent_m=20.0)
    _, found = mapped(mapper, radars, steps)
    assert found.grid.log_odds.size < 10_000
    assert mapper.notes == ["map.occupancy: what lies more than 20 m from the origin is not in the map"]


def test_a_run_without_detections_has_an_empty_grid(make_mapper, radars):
    steps = [Step(k, k / 24, np.zeros(3), {"front": Detections.empty([k])}) for k in range(3)]
    _, found = mapped(make_mapper(), radars, steps)
    assert found.grid.log_odds.shape == (0, 0)


def test_the_grid_can_be_drawn_from_the_poses_of_another_mapper(make_mapper, radars):
    """Here another grid's, whose odometry is the same: the grids are too."""
    steps = drive(10)
    poses, plain = mapped(make_mapper(), radars, steps)
    theirs, found = mapped(make_mapper(poses={"use": "map.occupancy", "params": {"cell_m": 0.5}}), radars, steps)
    np.testing.assert_array_equal(theirs.pose, poses.pose)
    np.testing.assert_array_equal(found.grid.log_odds, plain.grid.log_odds)


def test_a_mapper_of_poses_is_part_of_what_the_detector_is():
    pipeline = Pipeline(read_detector("map-occupancy", None, {"mapper.params.poses": {"use": "slam.points"}}))
    sources = pipeline.sources
    assert sources["mapper map.occupancy with slam.points"] == source_hash("uwbbench_detectors.mappers.slam_points")
    edited = sources | {"mapper map.occupancy with slam.points": "0" * 64}
    assert detector_identity(pipeline.config.to_dict(), edited) != pipeline.identity


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"poses": {"use": "map.occupancy", "params": {"cell": 1}}}, "map.occupancy: cell: Extra inputs"),
        ({"clamp": [0.5, 1.0]}, "must be below and above 0"),
        ({"reach_m": [3.0, 1.0]}, "nearest < farthest"),
    ],
)
def test_wrong_parameters_are_refused_with_what_was_expected(make_mapper, params, said):
    with pytest.raises(ValueError, match=said):
        make_mapper(**params)


def test_an_unknown_mapper_of_poses_is_refused_with_the_nearest_name(make_mapper):
    with pytest.raises(PluginError, match=r"Did you mean 'map\.occupancy'"):
        make_mapper(poses={"use": "map.ocupancy"})


def test_a_mapper_that_needs_the_truth_gives_no_poses(make_mapper):
    cheat = type("Cheat", (load_plugin("mappers", "map.occupancy"),), {"needs": frozenset({"truth"})})
    register("mappers", "test.cheat", cheat)
    try:
        with pytest.raises(ValueError, match="needs the truth"):
            make_mapper(poses={"use": "test.cheat"})
    finally:
        del _registered["mappers", "test.cheat"]
