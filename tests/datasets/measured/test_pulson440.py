"""PulsON 440 scans and OptiTrack motion: synthetic files with known content, and the measured rail."""

import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.signal import find_peaks
from scipy.spatial.transform import Rotation

from uwbbench.api import SPEED_OF_LIGHT_M_S, CaptureError, analytic
from uwbbench.config.source import open_dataset
from uwbbench_datasets.measured.optitrack import read_motion
from uwbbench_datasets.measured.pulson440 import read_scans

SIZES = (350, 350, 20)
START_PS, STEP = 23342, 32
RNG = np.random.default_rng(5)
SAMPLES = RNG.integers(-(10**6), 10**6, (4, sum(SIZES)))
DAMAGE = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def packet(scan, index, sizes=SIZES, **changes):
    head = {
        "type": 0xF201,
        "id": (65534 + scan) % 65536,
        "source": 1,
        "time": 5000 + 17 * scan,
        "start": START_PS,
        "stop": START_PS + 1,
        "step": STEP,
        "n": sizes[index],
        "total": sum(sizes),
        "index": index,
        "count": len(sizes),
    } | changes
    first = sum(sizes[:index])
    values = np.zeros(350, ">i4")
    values[: sizes[index]] = SAMPLES[scan, first : first + sizes[index]]
    keys = ("type", "id", "source", "time", "start", "stop", "step", "n", "total", "index", "count")
    return struct.pack(">HHII16xiihxxxxHIHH", *(head[key] for key in keys)) + values.tobytes()


def scan_file(packets=None, start_ps=START_PS):
    configuration = struct.pack(">IiiHH16x", 1, start_ps, START_PS + 1, STEP, 11)
    if packets is None:
        packets = [packet(scan, index) for scan in range(4) for index in range(3)]
    return configuration + b"".join(packets)


def motion_file(rows, body="radar", frames=None, units="Meters", rotation="Quaternion"):
    frames = len(rows) if frames is None else frames
    lines = [
        f"Format Version,1.23,Total Exported Frames,{frames},Rotation Type,{rotation},Length Units,{units}",
        "",
        ",Type,Marker" + ",Rigid Body" * 7,
        ",Name,loose" + f",{body}" * 7,
        ",ID,1" + ",2" * 7,
        ",,Position" + ",Rotation" * 4 + ",Position" * 3,
        "Frame,Time (Seconds),X,X,Y,Z,W,X,Y,Z",
    ]
    lines += [f"{i},{','.join('' if value is None else repr(float(value)) for value in row)}" for i, row in rows]
    return "\r\n".join(lines) + "\r\n"


def pose_row(time_s, yaw_rad, position_y_up):
    """Row of a body turned by ``yaw_rad`` about the upward axis Y."""
    return [time_s, 7.0, *Rotation.from_euler("Y", yaw_rad).as_quat(), *position_y_up]


@pytest.fixture
def recording(tmp_path):
    """Folder with a good scan file and a motion that turns while it moves."""
    rows = [(i, pose_row(9.0 + 0.1 * i, 0.2 * i, (1.0, 2.0, 3.0 + i))) for i in range(5)]
    (tmp_path / "scan.txt").write_bytes(scan_file())
    (tmp_path / "motion.csv").write_text(motion_file(rows))
    return tmp_path


def rail(folder, **params):
    params = {"scan": "scan.txt", "motion": "motion.csv", "body": "radar", "time_offset_s": 9.15, **params}
    dataset = open_dataset("pulson440-rail", params, [folder])
    return dataset.open(dataset.names()[0])


def test_samples_and_times_come_back(recording):
    capture = rail(recording)
    assert capture.preamble.dtype == np.float32
    np.testing.assert_array_equal(capture.preamble, SAMPLES.astype(np.float32))
    np.testing.assert_allclose(capture.trajectory.timestamp_s, np.arange(4) * 0.017)
    assert capture.radar.frame_rate_hz == pytest.approx(1 / 0.017)
    assert capture.radar.sample_interval_s == pytest.approx(61.035e-12, rel=1e-5)


def test_bin_zero_has_the_device_range_less_the_bias(recording):
    for bias_m in (0.44, 0.0):
        radar = rail(recording, range_bias_m=bias_m).radar
        device_m = SPEED_OF_LIGHT_M_S * (START_PS * 1e-12 - 10e-9) / 2
        assert radar.first_tap_delay_s * SPEED_OF_LIGHT_M_S / 2 == pytest.approx(device_m - bias_m)


def test_poses_are_interpolated_in_a_right_handed_frame(recording):
    track = rail(recording, time_offset_s=9.1).trajectory
    along = track.timestamp_s / 0.1  # 0 at the second row of the motion
    np.testing.assert_allclose(track.position_m, np.column_stack([along * 0 + 1, -4 - along, along * 0 + 2]))
    np.testing.assert_allclose(track.yaw_rad, 0.2 + 0.2 * along, atol=2e-3)


def test_azimuth_of_a_reflector_is_that_of_the_unmirrored_room(recording):
    """A platform at Z = 3 looking along +X has a reflector at Z = 1.04 on its left, as Y up makes +Z its right."""
    capture = rail(recording, time_offset_s=9.0)
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    right = [one.name for one in capture.truth.objects].index("right reflector")
    expected = np.arctan2(-1.037974 - -3.0, 2.328990 - 1.0)
    assert sight.azimuth_rad[0, right] == pytest.approx(expected)


def test_untracked_and_outside_times_have_no_pose_but_keep_their_frames(recording):
    rows = [(i, pose_row(9.0 + 0.02 * i, 0.0, (1.0, 2.0, 3.0))) for i in range(3)]
    rows[1][1][2:] = [None] * 7
    (recording / "motion.csv").write_text(motion_file(rows))
    capture = rail(recording, time_offset_s=9.0)  # radar times 0, 17, 34, 51 ms; motion 0, (20), 40 ms
    assert np.isnan(capture.trajectory.yaw_rad).tolist() == [False, True, True, True]
    assert np.isnan(capture.trajectory.position_m).all(axis=1).tolist() == [False, True, True, True]
    assert np.isnan(capture.truth.seen_from(capture.radar, capture.trajectory).range_m[1:]).all()


def test_heading_turns_the_short_way_through_half_a_turn(recording):
    rows = [(i, pose_row(float(i), yaw, (0, 0, 0))) for i, yaw in enumerate((np.pi - 0.1, np.pi + 0.1))]
    (recording / "motion.csv").write_text(motion_file(rows))
    _, yaw_rad = read_motion(recording / "motion.csv", "radar").at(np.array([0.5]))
    assert abs(yaw_rad[0]) == pytest.approx(np.pi)


def test_a_scan_cut_short_by_stopping_between_packets_is_left_out(recording):
    path = recording / "scan.txt"
    path.write_bytes(scan_file()[:-1452])
    np.testing.assert_array_equal(read_scans(path).samples, SAMPLES[:3])


def broken(change):
    packets = [packet(scan, index) for scan in range(4) for index in range(3)]
    change(packets)
    return scan_file(packets)


def replace(number, scan, index, **changes):
    def change(packets):
        packets[number] = packet(scan, index, **changes)

    return change


@pytest.mark.parametrize(
    ("content", "byte", "what"),
    [
        (scan_file()[:-1], 32 + 11 * 1452, "ends inside a packet"),
        (b"", 0, "ends inside"),
        (b"x" * 31, 0, "ends inside"),
        (scan_file([]), 32, "no complete scan"),
        (scan_file([packet(0, 0)]), 32, "no complete scan"),
        (broken(replace(5, 1, 2, type=0xF202)), 32 + 5 * 1452, "0xF201"),
        (broken(replace(7, 2, 1, n=300)), 32 + 7 * 1452, "n_samples changes"),
        (broken(replace(7, 2, 1, total=721)), 32 + 7 * 1452, "total_samples changes"),
        (broken(replace(9, 3, 0, step=16)), 32 + 9 * 1452, "step changes"),
        (broken(replace(3, 1, 0, start=0)), 32 + 3 * 1452, "start_ps changes"),
        (broken(lambda packets: packets.pop(4)), 32 + 4 * 1452, "missing"),
        (broken(lambda packets: packets.__delitem__(slice(3, 6))), 32 + 3 * 1452, "missing"),
        (broken(replace(6, 2, 0, time=1)), 32 + 6 * 1452, "backwards"),
        (scan_file(start_ps=0), 4, "scan start"),
        (scan_file([packet(0, 0, (0,))]), 32, "add up"),
        (scan_file([packet(0, 0, (4,), n=351, total=351)]), 32, "add up"),
        (scan_file([packet(0, 0, (4,), step=0)]), 32, "step must be positive"),
    ],
)
def test_a_broken_scan_file_is_refused_with_its_name_and_the_byte(content, byte, what, tmp_path):
    path = tmp_path / "bad.txt"
    path.write_bytes(content)
    with pytest.raises(CaptureError, match=rf"bad\.txt: byte {byte}: .*{what}"):
        read_scans(path)


@DAMAGE
@given(st.integers(0, len(scan_file())))
def test_a_truncated_scan_file_gives_whole_scans_or_an_error(tmp_path, length):
    path = tmp_path / "cut.txt"
    path.write_bytes(scan_file()[:length])
    try:
        samples = read_scans(path).samples
    except CaptureError:
        return
    np.testing.assert_array_equal(samples, SAMPLES[: len(samples)])


@DAMAGE
@given(st.binary(max_size=4000))
def test_garbage_is_never_anything_but_a_capture_error(tmp_path, garbage):
    path = tmp_path / "garbage"
    for content in (garbage, scan_file()[:32] + garbage, scan_file()[:3000] + garbage):
        path.write_bytes(content)
        with pytest.raises(CaptureError):
            read_scans(path)
    path.write_bytes(garbage)
    with pytest.raises(CaptureError):
        read_motion(path, "radar")


GOOD_ROWS = [(i, pose_row(float(i), 0.0, (0, 0, 0))) for i in range(3)]


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("", "not an OptiTrack export"),
        ("time,x\n" * 9, "not an OptiTrack export"),
        (motion_file(GOOD_ROWS, units="Millimeters"), "'Length Units' must be 'Meters'"),
        (motion_file(GOOD_ROWS, rotation="XYZ"), "'Rotation Type' must be 'Quaternion'"),
        (motion_file(GOOD_ROWS, body="other"), "no rigid body 'radar'; known: other"),
        (motion_file(GOOD_ROWS, frames=4), "3 frames, but its line 1 says 4"),
        (motion_file(GOOD_ROWS).replace("2.0,7.0", "2.0,x"), None),
        (motion_file(GOOD_ROWS).replace("2,2.0,7.0,0.0", "2,2.0,7.0,x"), "line 10: not a row of numbers"),
        (motion_file(GOOD_ROWS)[:-20], "line 10: not a row of numbers"),
        (motion_file(GOOD_ROWS[::-1]), "increase"),
        (motion_file([]), "increase"),
        (motion_file(GOOD_ROWS).replace("X,X,Y,Z,W", "X,X,Y,Z,V"), "a column of rigid body 'radar' is missing"),
    ],
)
def test_a_broken_motion_file_is_refused_with_its_name(content, what, tmp_path):
    path = tmp_path / "bad.csv"
    path.write_text(content)
    if what is None:  # only columns of the body are read
        assert len(read_motion(path, "radar").time_s) == 3
        return
    with pytest.raises(CaptureError, match=rf"bad\.csv: .*{what}"):
        read_motion(path, "radar")


def test_names_need_no_files_and_a_missing_file_is_named(tmp_path):
    dataset = open_dataset("pulson440-rail", {}, [tmp_path])
    assert dataset.names() == ["scan_2105627"]
    with pytest.raises(CaptureError, match=r"pulson440-rail/scan_2105627\.txt.*uwbbench fetch"):
        dataset.open("scan_2105627")
    with pytest.raises(CaptureError, match="Did you mean 'scan_2105627'"):
        dataset.open("scan_2105672")


def test_a_recording_without_moving_frames_says_so(recording):
    with pytest.raises(CaptureError, match=r"scan\.txt: no scan while 'radar' moves, from 9\.00 to 9\.40 s of .*csv"):
        rail(recording, frames="moving", time_offset_s=0.0)


START_S, RATE_HZ = 1.5, 50.0


@pytest.fixture
def departure(tmp_path):
    """A radar that stands for 1.5 s and then runs 20 cm; its motion, with a clock 7.3 s ahead, says the same."""
    time_s = np.arange(125) / RATE_HZ
    run_m = 0.4 * np.maximum(time_s - START_S, 0) ** 2
    around = RNG.uniform(-1, 1, 200)  # cosines of the directions of 200 echoes
    phase = 2 * np.pi * RNG.uniform(size=200) + 4 * np.pi / 0.0759 * run_m[:, None] * around
    moving = 1000 * (np.cos(phase) @ RNG.normal(size=(200, sum(SIZES)))) + RNG.normal(size=(125, sum(SIZES)))
    packets = []
    for scan, row in enumerate(moving.astype(">i4")):
        for index, size in enumerate(SIZES):
            first, head = sum(SIZES[:index]), packet(0, index, id=(65534 + scan) % 65536, time=5000 + 20 * scan)
            packets.append((head[:52] + row[first : first + size].tobytes()).ljust(1452, b"\0"))
    (tmp_path / "scan.txt").write_bytes(scan_file(packets))
    rows = [
        (i, pose_row(i / 100, 0.0, (1.0, 2.0, 3.0 + 0.4 * max(i / 100 - START_S - 7.3, 0) ** 2)))
        for i in range(round(100 * (7.3 + 2.5)))
    ]
    (tmp_path / "motion.csv").write_text(motion_file(rows))
    return tmp_path


def test_the_onset_of_motion_ties_the_clocks_of_radar_and_motion_together(departure):
    capture = rail(departure, time_offset_s=None)
    moved_m = np.abs(capture.trajectory.position_m[:, 1] - capture.trajectory.position_m[0, 1])
    seen_s = capture.trajectory.timestamp_s[np.argmax(moved_m > 0.02)]
    assert seen_s == pytest.approx(START_S + np.sqrt(0.02 / 0.4), abs=0.05)
    assert "from the onset of motion" in capture.description


@pytest.mark.parametrize("late", ["scan.txt", "motion.csv"])
def test_a_record_that_starts_in_motion_needs_a_time_offset(late, departure):
    path = departure / late
    if late == "scan.txt":
        path.write_bytes(path.read_bytes()[:32] + path.read_bytes()[32 + 60 * 3 * 1452 :])
    else:
        rows = [(i, pose_row(i / 100, 0.0, (1.0, 2.0, 3.0 + i / 100))) for i in range(300)]
        path.write_text(motion_file(rows))
    with pytest.raises(CaptureError, match=rf"{late}: shows no onset of motion after 1 s at rest.*'time_offset_s'"):
        rail(departure, time_offset_s=None)


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({}, "0.43 m, fitted on both reflectors of trial 6, another recording"),
        ({"range_bias_m": 0.1}, "range bias 0.1 m as given"),
    ],
)
def test_a_capture_says_where_its_range_bias_comes_from(params, said, recording):
    assert said in rail(recording, **params).description


@pytest.mark.parametrize(("label", "said"), [("both", "FITTED ON THE SCORED OBJECTS"), ("left", "not labelled here")])
def test_the_own_recording_says_whether_its_bias_was_fitted_on_what_is_scored(label, said, recording):
    (recording / "scan.txt").rename(recording / "scan_2105627.txt")
    capture = rail(recording, scan="scan_2105627.txt", reflectors=label)
    assert said in capture.description
    assert len(capture.truth.objects) == (2 if label == "both" else 1)


@pytest.fixture(scope="module")
def measured(data_dir):
    def read(**params):
        dataset = open_dataset("pulson440-rail", params, [data_dir])
        return dataset.open(dataset.names()[0])

    return read


@pytest.mark.data
def test_the_measured_rail_has_the_published_size_and_poses(measured):
    capture = measured(time_offset_s=9.15)  # that of the published poses, which a fit on the reflectors gave
    assert capture.preamble.shape == (607, 960)
    assert not capture.truth.exhaustive
    published = [(-5.051659, -0.666974, 1.793870), (-5.066372, 0.358951, 1.793664), (-5.084464, 2.731775, 1.789821)]
    np.testing.assert_allclose(capture.trajectory.position_m[[0, 300, 606]], published, atol=2e-6)
    assert np.abs(capture.trajectory.yaw_rad).max() < 0.1


@pytest.mark.data
def test_moving_frames_are_those_of_the_whole_run(measured):
    whole, moving = measured(), measured(frames="moving")
    times = whole.trajectory.timestamp_s
    kept = (times >= 3.93) & (times <= 8.47)
    np.testing.assert_array_equal(moving.preamble, whole.preamble[kept])
    np.testing.assert_array_equal(moving.trajectory.timestamp_s, times[kept])


@pytest.mark.data
def test_the_two_strongest_echoes_of_the_measured_rail_are_mostly_its_reflectors(measured):
    """Coarse check of geometry and of the time offset, which no reflector gave: chance recall is 0.19."""
    capture = measured(frames="moving")
    samples = np.asarray(capture.preamble, float)
    envelopes = np.abs(analytic(samples - samples.mean(axis=0)))
    radar = capture.radar
    delay_s = radar.first_tap_delay_s + np.arange(radar.taps) * radar.sample_interval_s
    range_m = delay_s * SPEED_OF_LIGHT_M_S / 2
    errors = []
    true = capture.truth.seen_from(radar, capture.trajectory).range_m
    for envelope, wanted in zip(envelopes, true, strict=True):
        peaks = find_peaks(np.where((range_m >= 6) & (range_m <= 10), envelope, 0))[0]
        strongest = peaks[np.argsort(envelope[peaks])[-2:]]
        error = np.abs(range_m[strongest][:, None] - wanted)
        rows, columns = linear_sum_assignment(np.minimum(error, 1.0))
        errors += [each for each in error[rows, columns] if each <= 0.2]
    assert len(errors) / true.size > 0.65
    assert np.mean(errors) < 0.06
