"""DecaRanging logs: synthetic ones with known content, and the measured one."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from uwbbench.api import CaptureError
from uwbbench.config.source import open_dataset
from uwbbench_datasets.measured.dw1000 import BEFORE_TAPS, TICK_S, Log, around_first_path, read_log

TAPS = 6
PAIRS = np.random.default_rng(8).integers(-30000, 30000, (3, TAPS, 2))
SAMPLES = PAIRS[..., 0] + 1j * PAIRS[..., 1]
TICKS = (2**40 - 1000, 500, 64_000_000_000)  # the clock starts anew between the first two
HEAD = "File:log, created by DecaRanging MP Version 3.05\nMode: 2, Chan 2, Code 9, PRF 64, Plength 1024\n\n"
TABLES = {
    "pairs.csv": "file_number,anchor_location,tag_location\n4,1,2\n",
    "labels.csv": "file_id,label\n4,NDP NLOS\n",
    "anchors.csv": "location,x,y\n1,1.0,2.0\n",
    "tags.csv": "location,x,y\n2,4.0,6.0\n",
}
DAMAGE = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def reception(number, taps=TAPS, head=None):
    ticks = f"{TICKS[number]:012X}"
    good = f"RX OK WInd(0735), HLP(0745.{number}125), PSC(0274), RC({ticks[:4]} {ticks[4:]}), T(83BD)"
    lines = [good if head is None else head, f"Accum Len {taps}"]
    return "\n".join(lines + [f"{re}, {im}" for re, im in PAIRS[number][:taps]]) + "\n\n"


def log(*receptions):
    between = "Anchor ToF: 8.986 ns Dist: 2.693148 m\n\n"
    return (HEAD + between.join(receptions or [reception(i) for i in range(3)])).replace("\n", "\r\n")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "4.log").write_text(log(), newline="")
    for name, text in TABLES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def apartment(folder, *files):
    params = {"files": list(files or ["4.log"]), "window_taps": None}
    return open_dataset("dw1000-apartment", params, [folder])


def test_samples_first_paths_and_unwrapped_times_come_back(folder):
    capture = apartment(folder).open("4")
    assert capture.preamble.dtype == np.complex64
    np.testing.assert_array_equal(capture.preamble, SAMPLES)
    np.testing.assert_array_equal(capture.first_path_index, [745.0125, 745.1125, 745.2125])
    np.testing.assert_allclose(capture.trajectory.timestamp_s, np.array([0, 1500, 64_000_001_000]) * TICK_S)
    assert capture.radar.channel == 2
    assert capture.radar.center_frequency_hz == 3993.6e6


def test_a_window_starts_before_each_first_path_and_is_zero_beyond_the_accumulator():
    samples = (np.arange(40).reshape(2, 20) + 1).astype(np.complex64)
    cropped = around_first_path(Log(2, samples, np.array([9.25, 18.5]), np.zeros(2)), taps=10)
    np.testing.assert_array_equal(cropped.samples[0], samples[0, 9 - BEFORE_TAPS : 19 - BEFORE_TAPS])
    np.testing.assert_array_equal(cropped.samples[1], [*samples[1, 12:], 0, 0])
    np.testing.assert_allclose(cropped.first_path_index, [6.25, 6.5])


def test_the_baseline_is_the_distance_of_anchor_and_tag(folder):
    capture = apartment(folder).open("4")
    assert capture.radar.baseline_length_m == pytest.approx(5.0)
    np.testing.assert_array_equal(capture.trajectory.position_m, np.tile([1.0, 2.0, 0.0], (3, 1)))
    assert capture.truth is None
    assert capture.description.startswith("NDP NLOS")


def test_a_reception_with_an_error_is_left_out(folder):
    bad = "RX E  WInd(0735), PSC(0264), CE(0000), RSE(0000)"
    (folder / "4.log").write_text(log(reception(0), reception(1, head=bad), reception(2)))
    np.testing.assert_array_equal(read_log(folder / "4.log").samples, SAMPLES[[0, 2]])


def test_reported_distances_are_messages_of_the_tag_where_they_are_asked_for(folder):
    assert apartment(folder).open("4").anchors is None
    params = {"files": ["4.log"], "messages": True}
    anchors = open_dataset("dw1000-apartment", params, [folder]).open("4").anchors
    assert (anchors.identity.tolist(), anchors.position_m.tolist()) == ([2], [[4.0, 6.0]])
    assert anchors.frame.tolist() == [0, 1]
    assert anchors.messages.range_m.tolist() == [2.693148, 2.693148]
    assert np.isnan(anchors.messages.azimuth_rad).all()


def test_a_distance_before_the_first_reception_belongs_to_no_frame(folder):
    (folder / "4.log").write_text(log().replace("\r\n", "\n").replace(HEAD, HEAD + "Anchor ToF: 1 ns Dist: 9.1 m\n"))
    found = read_log(folder / "4.log")
    assert found.distance_m.tolist() == [2.693148, 2.693148]


def test_a_tag_without_a_number_has_no_messages(folder):
    (folder / "pairs.csv").write_text("file_number,anchor_location,tag_location\n4,1,door\n")
    (folder / "tags.csv").write_text("location,x,y\ndoor,4.0,6.0\n")
    with pytest.raises(CaptureError, match=r"pairs\.csv: a message needs the number of a tag, not 'door'"):
        open_dataset("dw1000-apartment", {"files": ["4.log"], "messages": True}, [folder]).open("4")


FIRST = HEAD.count("\n") + 1  # line of the first 'RX OK'


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("", "no DW1000 channel"),
        ("\0\xff garbage\n" * 20, "no DW1000 channel"),
        (HEAD.replace("Chan 2", "Chan 6"), "no DW1000 channel"),
        (HEAD, "no reception"),
        (log(reception(0) + "Accum Len 6\n" + "1, 2\n" * 6), f"line {FIRST + 8}: expected 'RX OK'"),
        (log(reception(0)[:-8]), f"line {FIRST + 7}: the accumulator of line {FIRST + 1} ends after 5 of 6 taps"),
        (log(reception(0).replace("Len 6", "Len 7")), f"line {FIRST + 8}: .* ends after 6 of 7 taps"),
        (log(reception(0), reception(1, taps=5)), "expected 'Accum Len 6', not 'Accum Len 5'"),
        (log(reception(0).replace("Len 6", "Len six")), f"line {FIRST + 1}: expected 'Accum Len' and a number"),
        (log(reception(0).replace("HLP", "HLQ")), f"line {FIRST}: expected 'RX OK' with HLP"),
        (log(reception(0).replace(", ", "; ")), f"line {FIRST + 2}: .* ends after 0 of 6 taps"),
    ],
)
def test_a_broken_log_is_refused_with_its_name_and_the_line(content, what, tmp_path):
    path = tmp_path / "bad.log"
    path.write_text(content, encoding="latin-1")
    with pytest.raises(CaptureError, match=rf"bad\.log: {what}|bad\.log: .*{what}"):
        read_log(path)


@DAMAGE
@given(st.data())
def test_a_truncated_log_gives_whole_frames_or_an_error(tmp_path, data):
    """Only a cut inside the last number cannot be told from a shorter number."""
    whole = log().encode()
    cut = data.draw(st.integers(0, len(whole)))
    path = tmp_path / "cut.log"
    path.write_bytes(whole[:cut])
    try:
        samples = read_log(path).samples
    except CaptureError:
        return
    np.testing.assert_array_equal(samples[:-1], SAMPLES[: len(samples) - 1])
    np.testing.assert_array_equal(samples[-1][:-1], SAMPLES[len(samples) - 1][:-1])


@DAMAGE
@given(st.binary(max_size=200))
def test_garbage_is_never_anything_but_a_capture_error(tmp_path, garbage):
    path = tmp_path / "garbage.log"
    for content in (garbage, HEAD.encode() + garbage, HEAD.encode() + b"RX OK HLP(1.0), RC(\nAccum Len 6\n" + garbage):
        path.write_bytes(content)
        with pytest.raises(CaptureError, match=r"garbage\.log"):
            read_log(path)


@pytest.mark.parametrize(
    ("table", "text", "what"),
    [
        ("pairs.csv", "file_number,anchor_location,tag_location\n5,1,2\n", "no row with file_number '4'"),
        ("pairs.csv", "file,anchor,tag\n4,1,2\n", "line 1: no column 'file_number'"),
        ("labels.csv", "file_id,label\n4\n", "line 2: expected file_id, label"),
        ("anchors.csv", "location,x,y\n1,here,2\n", "location '1': could not convert"),
        ("anchors.csv", "location,x,y\n,1,2\n", "line 2: expected location, x, y"),
        ("anchors.csv", "location,x,y\n2,1,2\n", "no row with location '1'"),
        ("tags.csv", "", "line 1: no column 'location'"),
    ],
)
def test_a_broken_table_is_refused_with_its_name(table, text, what, folder):
    (folder / table).write_text(text)
    with pytest.raises(CaptureError, match=rf"{table}: .*{what}"):
        apartment(folder).open("4")


def test_a_log_that_is_not_in_the_tables_is_refused(folder):
    (folder / "mine.log").write_text(log())
    with pytest.raises(CaptureError, match=r"pairs\.csv: no row with file_number 'mine'"):
        apartment(folder, "mine.log").open("mine")


def test_one_reception_has_no_frame_rate(folder):
    (folder / "4.log").write_text(log(reception(0)))
    with pytest.raises(CaptureError, match=r"4\.log: 1 frames.*a frame rate needs two"):
        apartment(folder).open("4")


def test_names_need_no_files_and_a_missing_file_is_named(tmp_path, folder):
    dataset = open_dataset("dw1000-apartment", {}, [tmp_path / "empty"])
    assert dataset.names() == ["1"]
    with pytest.raises(CaptureError, match=r"dw1000-apartment/1\.log.*uwbbench fetch"):
        dataset.open("1")
    with pytest.raises(CaptureError, match="no log '2'"):
        dataset.open("2")
    (folder / "labels.csv").unlink()
    with pytest.raises(CaptureError, match=r"labels\.csv"):
        apartment(folder).open("4")


@pytest.mark.data
def test_the_measured_log_has_its_accumulators_and_a_crest_at_the_first_path(data_dir):
    capture = open_dataset("dw1000-apartment", {"window_taps": None}, [data_dir]).open("1")
    assert capture.preamble.shape == (252, 1016)
    assert capture.radar.baseline_length_m == pytest.approx(np.hypot(7.76 - 7.87, 8.1 - 5.61))
    assert capture.description.startswith("LOS")
    crest = np.abs(capture.preamble).argmax(axis=1)
    after = crest - capture.first_path_index
    assert np.all((after > 0) & (after < 10))
    assert capture.duration_s == pytest.approx(129, abs=1)


@pytest.mark.data
def test_the_measured_log_is_cropped_so_that_the_crest_is_among_the_first_taps(data_dir):
    capture = open_dataset("dw1000-apartment", {}, [data_dir]).open("1")
    assert capture.preamble.shape == (252, 100)
    crest = np.argmax(np.abs(capture.preamble[:, :10]), axis=1)
    assert np.mean((crest >= BEFORE_TAPS) & (crest <= BEFORE_TAPS + 3)) > 0.95


@pytest.mark.data
def test_measured_distances_are_eighteen_centimetres_too_long(data_dir):
    capture = open_dataset("dw1000-apartment", {"messages": True}, [data_dir]).open("1")
    anchors = capture.anchors
    true_m = np.hypot(*(anchors.position_m[0] - capture.trajectory.position_m[0, :2]))
    assert len(anchors.messages) == 126
    assert np.mean(anchors.messages.range_m) - true_m == pytest.approx(0.181, abs=5e-4)
    assert np.std(anchors.messages.range_m, ddof=1) == pytest.approx(0.026, abs=5e-4)
