import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import SPEED_OF_LIGHT_M_S, ConfigError, Detections, Radar
from uwbbench.api.geometry import excess_path

PLACE = st.floats(-0.5, 0.5)


@pytest.fixture(scope="module")
def ranged(make_stage, make_block, run_stage):
    """Detections of one frame after the range stage, by their taps behind the first path."""

    def detections(radar: Radar, taps, azimuth_rad=None, first_path=7.0, **params):
        columns = {} if azimuth_rad is None else {"azimuth_rad": np.atleast_1d(azimuth_rad)}
        found = Detections(np.zeros(np.size(taps), int), tap=first_path + np.atleast_1d(taps), **columns)
        block = make_block(np.ones((1, radar.taps)), first_path=np.array([first_path]), detections=found)
        return run_stage(make_stage("range", **params), radar, block).detections

    return detections


def taps_of(radar, excess_m):
    return excess_m / SPEED_OF_LIGHT_M_S / radar.sample_interval_s


def test_printed_taps_of_a_nanosecond_take_the_place_of_the_radars(ranged, make_radar):
    radar = make_radar(sample_interval_s=1.0016e-9)
    printed = ranged(radar, [20.0], tap_ns=1.0, speed_of_light="rounded")
    assert printed["delay_s"][0] == pytest.approx(20e-9)
    assert printed.range_m[0] == pytest.approx(20e-9 * 3e8 / 2)


@given(transmitter=st.tuples(PLACE, PLACE, PLACE), range_m=st.floats(0.1, 30), azimuth=st.floats(-1.5, 1.5))
@settings(max_examples=100)
def test_exact_range_inverts_any_placement_of_the_transmitter(ranged, make_radar, transmitter, range_m, azimuth):
    radar = make_radar(tx_position_m=transmitter)
    target = range_m * np.array([[np.cos(azimuth), np.sin(azimuth), 0.0]])
    excess_m = excess_path(target, radar.baseline_m)
    if excess_m[0] < 1e-6:  # on the line through transmitter and receiver every delay fits many ranges
        return
    found = ranged(radar, taps_of(radar, excess_m), azimuth)
    assert found.range_m[0] == pytest.approx(range_m, rel=1e-6)


def test_no_azimuth_means_boresight(ranged, make_radar):
    radar = make_radar(tx_position_m=(-0.2, 0.1, 0.0))
    without = ranged(radar, [10.0])
    np.testing.assert_array_equal(ranged(radar, [10.0], np.nan).range_m, without.range_m)
    np.testing.assert_array_equal(ranged(radar, [10.0], 0.0).range_m, without.range_m)


def test_delay_counts_from_the_first_path(ranged, make_radar):
    assert ranged(make_radar(), [12.5]).columns["delay_s"][0] == pytest.approx(12.5e-9)


def test_ends_of_segments_become_ranges_as_their_crests_do(make_stage, make_block, run_stage, make_radar):
    found = Detections([0], tap=[20.0], start_tap=[17.5], stop_tap=[24.5])
    block = make_block(np.ones((1, 50)), first_path=np.array([7.0]), detections=found)
    ranged = run_stage(make_stage("range", bias_m=0.1), make_radar(), block).detections
    alone = [
        run_stage(make_stage("range", bias_m=0.1), make_radar(), block.replace(detections=Detections([0], tap=[tap])))
        for tap in (17.5, 24.5)
    ]
    assert [ranged["range_start_m"][0], ranged["range_stop_m"][0]] == [one.detections.range_m[0] for one in alone]


def test_delay_from_transmission_holds_the_baseline_already(ranged, make_radar):
    radar = make_radar(tx_position_m=(0.0, 0.3, 0.0), first_tap_delay_s=20e-9)
    target = np.array([[4.0, 0.0, 0.0]])
    flown_m = excess_path(target, radar.baseline_m) + radar.baseline_length_m
    found = ranged(radar, taps_of(radar, flown_m), first_path=-20.0)
    assert found.range_m[0] == pytest.approx(4.0)
    unchanged = ranged(radar, taps_of(radar, flown_m), first_path=-20.0, includes_baseline=False)
    assert unchanged.range_m[0] == pytest.approx(4.0)


@pytest.mark.parametrize("baseline_m", [0.20, 0.25, 0.30])
@pytest.mark.parametrize("range_m", [0.6, 3.4])
def test_printed_form_is_long_where_the_transmitter_stands_behind(ranged, make_radar, baseline_m, range_m):
    radar = make_radar(tx_position_m=(-baseline_m, 0.0, 0.0))
    excess_m = excess_path(np.array([[range_m, 0.0, 0.0]]), radar.baseline_m)
    too_long_m = ranged(radar, taps_of(radar, excess_m), geometry="paper").range_m[0] - range_m
    published = {(0.20, 0.6): 0.086, (0.20, 3.4): 0.097, (0.25, 0.6): 0.103, (0.25, 3.4): 0.121}
    published |= {(0.30, 0.6): 0.120, (0.30, 3.4): 0.144}
    assert too_long_m == pytest.approx(published[baseline_m, range_m], abs=6e-4)


def test_printed_form_is_exact_for_a_transmitter_on_the_right(ranged, make_radar):
    radar = make_radar(tx_position_m=(0.0, -0.25, 0.0))
    azimuth = np.linspace(-1.2, 1.2, 9)
    exact = ranged(radar, np.full(9, 15.0), azimuth).range_m
    np.testing.assert_allclose(ranged(radar, np.full(9, 15.0), azimuth, geometry="paper").range_m, exact, rtol=1e-12)


def test_forgotten_baseline_shortens_by_about_half_of_it(ranged, make_radar):
    radar = make_radar(tx_position_m=(0.0, -0.25, 0.0))
    shorter = ranged(radar, [20.0], includes_baseline=False).range_m - ranged(radar, [20.0]).range_m
    assert shorter[0] == pytest.approx(-0.125, abs=0.01)


def test_path_shorter_than_the_baseline_has_no_range(ranged, make_radar):
    radar = make_radar(tx_position_m=(0.0, -0.25, 0.0))
    assert np.isnan(ranged(radar, [-1.0]).range_m[0])
    assert ranged(radar, [0.0]).range_m[0] == 0.0


def test_rounded_speed_of_light_adds_a_quarter_of_a_centimetre(ranged, make_radar):
    taps = taps_of(make_radar(), 2 * 3.4)
    more = ranged(make_radar(), taps, speed_of_light="rounded").range_m - 3.4
    assert more[0] == pytest.approx(0.0024, abs=1e-4)


@pytest.mark.parametrize(("channel", "bias_m", "expected_m"), [(5, "paper", 0.15), (9, "paper", 0.13), (9, -0.2, -0.2)])
def test_bias_is_subtracted(ranged, make_radar, channel, bias_m, expected_m):
    radar = make_radar(channel=channel)
    less = ranged(radar, [20.0]).range_m - ranged(radar, [20.0], bias_m=bias_m).range_m
    assert less[0] == pytest.approx(expected_m)


@pytest.mark.parametrize("channel", [None, 4])
def test_paper_bias_is_unknown_on_other_channels(make_stage, make_radar, channel):
    with pytest.raises(ConfigError, match="channels 5 and 9"):
        make_stage("range", bias_m="paper").open(make_radar(channel=channel))


@given(
    position=st.tuples(*[st.floats(-50, 50)] * 2),
    yaw=st.floats(-7, 7),
    mount=st.tuples(PLACE, PLACE),
    mount_yaw=st.floats(-3, 3),
)
@settings(max_examples=50)
def test_position_chains_robot_mount_range_and_azimuth(
    make_stage, make_block, run_stage, make_radar, position, yaw, mount, mount_yaw
):
    range_m, azimuth = 3.0, 0.4
    radar = make_radar(mount_position_m=(*mount, 0.3), mount_yaw_rad=mount_yaw)
    found = Detections([1], range_m=[range_m], azimuth_rad=[azimuth])
    poses = np.array([[99.0, 99.0, 9.0], [*position, 0.0]])
    block = make_block(np.ones((2, 50)), position_m=poses, yaw_rad=np.array([1.0, yaw]), detections=found)
    placed = run_stage(make_stage("position"), radar, block).detections
    receiver = complex(*position) + complex(*mount) * np.exp(1j * yaw)
    expected = receiver + range_m * np.exp(1j * (yaw + mount_yaw + azimuth))
    assert complex(placed["x_m"][0], placed["y_m"][0]) == pytest.approx(expected, abs=1e-9)


def test_odometry_carries_the_position_where_asked_for(make_stage, make_block, run_stage, make_radar):
    found = Detections([0], range_m=[2.0], azimuth_rad=[0.0])
    drifted = {"odometry_position_m": np.array([[5.0, 0.0, 0.0]]), "odometry_yaw_rad": np.array([np.pi / 2])}
    block = make_block(np.ones((1, 50)), detections=found, **drifted)
    reference = run_stage(make_stage("position"), make_radar(), block).detections
    odometry = run_stage(make_stage("position", use_odometry=True), make_radar(), block).detections
    assert (reference["x_m"][0], reference["y_m"][0]) == pytest.approx((2.0, 0.0))
    assert (odometry["x_m"][0], odometry["y_m"][0]) == pytest.approx((5.0, 2.0))


def test_missing_odometry_falls_back_and_says_so(make_stage, make_block, run_stage, make_radar):
    found = Detections([0], range_m=[2.0], azimuth_rad=[0.0])
    stage = make_stage("position", use_odometry=True)
    placed = run_stage(stage, make_radar(), make_block(np.ones((1, 50)), detections=found)).detections
    assert placed["x_m"][0] == pytest.approx(2.0)
    assert any("no odometry" in note for note in stage.notes)
