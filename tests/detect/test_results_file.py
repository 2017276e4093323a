"""Results files as programs in any language write them: what is read, and what is refused with which words."""

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import uwbbench
from uwbbench.api import Capture, ScoringError
from uwbbench.detect.results_file import content_of, read_results

FRAMES = 45
WINDOW_M = 7.5


@pytest.fixture(scope="module")
def capture() -> Capture:
    return uwbbench.open_dataset("approach", {"speed_m_s": 3.0}).open("approach-ch9-metal-1")


def written(folder: Path, content: str | bytes, name: str = "mine.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def test_what_detect_writes_is_read_back_as_it_was_found(capture, tmp_path):
    found = uwbbench.load_detector("paper").run(capture)
    found.to_pandas().sort_values("frame", kind="stable").to_csv(tmp_path / "mine.csv", index=False)
    found.to_pandas().to_parquet(tmp_path / "mine.parquet")
    before = uwbbench.score(found, capture, scoring="object").to_dict()
    for name in ("mine.csv", "mine.parquet"):
        read = read_results(tmp_path / name, capture)
        assert read.detections.processed.tolist() == found.processed.tolist()
        assert uwbbench.score(read.detections, capture, scoring="object").to_dict() == before


def test_a_frame_and_a_range_are_enough_and_a_frame_without_a_row_was_looked_at(capture, tmp_path):
    read = read_results(written(tmp_path, "frame,range_m\n0,2.5\n3,1.25\n"), capture)
    assert read.detections.frame.tolist() == [0, 3]
    assert read.detections.range_m.tolist() == [2.5, 1.25]
    assert len(read.detections.processed) == FRAMES
    assert read.times_us is None
    assert read.detections.notes == ()


def test_a_delay_becomes_the_range_of_the_triangle_of_transmitter_target_and_receiver(capture, tmp_path):
    found = uwbbench.load_detector("cfar-os").run(capture)
    delays = pd.DataFrame({"frame": found.frame, "delay_s": found["delay_s"]}).drop_duplicates()
    delays.to_csv(tmp_path / "mine.csv", index=False, float_format="%.17g")
    read = read_results(tmp_path / "mine.csv", capture).detections
    np.testing.assert_allclose(read.range_m, found.range_m[delays.index], rtol=1e-12)


def test_matlab_and_spreadsheets_may_write_their_line_ends_marks_and_spaces(capture, tmp_path):
    text = "\ufeffframe, range_m, amplitude\r\n0, 2.5, NaN\r\n\r\n3.0, 1.25e0, 7\r\n,,\r\n"
    read = read_results(written(tmp_path, text), capture).detections
    assert (read.frame.tolist(), read.range_m.tolist()) == ([0, 3], [2.5, 1.25])
    assert np.isnan(read["amplitude"]).tolist() == [True, False]


def test_names_of_columns_alone_mean_that_nothing_was_found(capture, tmp_path):
    read = read_results(written(tmp_path, "frame,range_m\n"), capture).detections
    assert (len(read), len(read.processed)) == (0, FRAMES)
    assert uwbbench.score(read, capture).fn > 0


def test_unsorted_rows_are_sorted_with_a_note_and_keep_their_order_in_a_frame(capture, tmp_path):
    read = read_results(written(tmp_path, "frame,range_m\n4,2\n1,3\n4,1\n"), capture).detections
    assert (read.frame.tolist(), read.range_m.tolist()) == ([1, 4, 4], [3, 2, 1])
    assert any("not in the order of frames" in note for note in read.notes)


def test_a_column_of_somebody_elses_is_left_out_with_a_note(capture, tmp_path):
    read = read_results(written(tmp_path, "frame,range_m,comment\n1,2,wall\n"), capture).detections
    assert "comment" not in read
    assert read.notes == ("results file: column 'comment' is not read",)


def test_a_list_of_frames_says_what_was_looked_at_and_how_long_it_took(capture, tmp_path):
    path = written(tmp_path, "frame,range_m\n2,2.5\n")
    written(tmp_path, "frame,time_us\n2,30\n1,10.5\n", "mine.frames.csv")
    read = read_results(path, capture)
    assert read.detections.processed.tolist() == [1, 2]
    assert read.times_us is not None
    assert read.times_us.tolist() == [10.5, 30]


def test_frames_with_a_broken_sample_are_no_detectors_affair(capture, tmp_path):
    samples = np.array(capture.preamble[:])
    samples[3] = np.nan
    broken = dataclasses.replace(capture, preamble=samples)
    read = read_results(written(tmp_path, "frame,range_m\n2,1\n3,1\n"), broken).detections
    assert read.frame.tolist() == [2]
    assert 3 not in read.processed
    assert any("1 rows left out" in note for note in read.notes)


def test_the_hash_changes_with_either_file(tmp_path):
    path = written(tmp_path, "frame,range_m\n")
    hashes = [content_of(path)]
    written(tmp_path, "frame\n1\n", "mine.frames.csv")
    hashes.append(content_of(path))
    written(tmp_path, "frame,range_m\n1,1\n")
    assert len({*hashes, content_of(path)}) == 3


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "is empty; where nothing was found, the names of the columns stand alone"),
        ("\r\n", "is empty"),
        ("frame,range_m\n0,2.5\n1\n", "line 3: has 1 values, the first line names 2 columns"),
        ("frame,range_m\n0,2.5,\n", "line 2: has 3 values"),
        ("frame;range_m\n0;2,5\n", "line 1: is separated by semicolons: write commas, and points in numbers"),
        ("frame\trange_m\n", "separated by tabs"),
        ("0,2.5\n1,2.4\n", "the first line must name the columns, it begins with 0"),
        ("frame,range_m,range_m\n", "column 'range_m' is there 2 times"),
        ("frame,,range_m\n", "column 2 has no name"),
        ("Frame,Range_m\n0,2\n", "no column is called 'Frame'. Did you mean 'frame'?"),
        ("frame,RANGE M\n0,2\n", "no column is called 'RANGE M'. Did you mean 'range_m'?"),
        ("frame,range_m,amplitud\n0,2,1\n", "no column is called 'amplitud'. Did you mean 'amplitude'?"),
        ("range_m\n2\n", "column 'frame' is missing. Found: range_m."),
        ("frame_id,range_m\n1,2\n", "column 'frame' is missing. Is 'frame_id' meant to be 'frame'?"),
        ("frame,amplitude\n0,2\n", "neither 'range_m' (in metres) nor 'delay_s' (in seconds) is there"),
        ("frame,range_m\n0,2.5\n45,2\n", "line 3: frame 45, but capture 'approach-ch9-metal-1' has 45 frames"),
        ("frame,range_m\n1,2.5\n45,2\n", "Do they count from 1 there?"),
        ("frame,range_m\n-1,2\n", "line 2: frame -1, but"),
        ("frame,range_m\n1.5,2\n", "line 2: frame 1.5 is not a whole number"),
        ("frame,range_m\ninf,2\n", "line 2: frame inf is no number to be scored"),
        ("frame,range_m\n,2\n", "line 2: frame is missing"),
        ("frame,range_m\nzero,2\n", "line 2: frame must be a number, not 'zero'"),
        ("frame,range_m\n0,2\n1,2 m\n", "line 3: range_m must be a number, not '2 m'"),
        ("frame,range_m\n0,2\n1,NaN\n", "line 3: neither range nor delay; a frame in which nothing was found has no"),
        ("frame,range_m\n0,inf\n", "line 2: range_m inf is no number to be scored"),
        ("frame,range_m\n0,-2\n", "line 2: range_m -2 is negative"),
        ("frame,range_m\n0,1\n1,250\n", "line 3: range_m 250: metres? 1 of 2 lie beyond the radar's window of 7.51 m"),
        ("frame,range_m\n0,800\n1,120\n", "line 2: range_m 800: metres? 2 of 2 lie beyond"),
        ("frame,range_m\n0,8\n1,9\n", "line 3: range_m 9: metres? 2 of 2 lie beyond"),
        ("frame,range_m\n0,1e-8\n1,0\n", "metres? None of 2 reaches 0.001 m"),
        ("frame,delay_s\n0,12.5\n", "line 2: delay_s 12.5: seconds?"),
        ("frame,range_m,azimuth_rad\n0,2,1\n1,2,-30\n", "line 3: azimuth_rad -30 is more than a turn: radians?"),
        ("frame,range_m\n0,2\n1,2\n1,2.0\n", "line 4: repeats line 3"),
        ("frame,range_m\n0,2\n0,2\n0,2\n", "line 3: repeats line 2; 1 more rows repeat others"),
        ("frame,range_m\n0,2\n".encode("utf-16"), "is not UTF-8 text (byte 0)"),
        (b"frame,range_m\n0,2\xb5\n", "is not UTF-8 text (byte 17)"),
        (b'frame,range_m\n0,"2\n', "is not CSV"),
    ],
)
def test_nonsense_is_refused_in_one_line_that_names_the_file(capture, tmp_path, content, says):
    path = written(tmp_path, content)
    with pytest.raises(ScoringError) as refused:
        read_results(path, capture)
    assert says in str(refused.value)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("frames", "says"),
    [
        ("frame\n1\n1\n2\n", "mine.frames.csv: frame 1 is listed twice"),
        ("frame\n0\n1\n", "mine.csv: line 2: frame 2 has a detection, but mine.frames.csv lacks it"),
        ("frame,time_us\n2,\n", "mine.frames.csv: line 2: time_us is missing"),
        ("frame,time_us\n2,-3\n", "mine.frames.csv: line 2: time_us -3 is negative"),
        ("frame,time\n2,3\n", "no column is called 'time'. Did you mean 'time_us'?"),
        ("frame\n2\n45\n", "mine.frames.csv: line 3: frame 45, but capture"),
        ("time_us\n2\n", "mine.frames.csv: column 'frame' is missing"),
    ],
)
def test_a_wrong_list_of_frames_is_refused(capture, tmp_path, frames, says):
    written(tmp_path, frames, "mine.frames.csv")
    with pytest.raises(ScoringError) as refused:
        read_results(written(tmp_path, "frame,range_m\n2,1\n"), capture)
    assert says in str(refused.value)


def test_parquet_must_hold_numbers_and_be_parquet(capture, tmp_path):
    pd.DataFrame({"frame": ["0"], "range_m": [1.0]}).to_parquet(tmp_path / "text.parquet")
    with pytest.raises(ScoringError, match="column 'frame' must hold numbers, not"):
        read_results(tmp_path / "text.parquet", capture)
    with pytest.raises(ScoringError, match="is not a readable Parquet file"):
        read_results(written(tmp_path, "frame,range_m\n0,1\n", "mine.parquet"), capture)
    pd.DataFrame({"frame": [0, 7], "range_m": [1.0, None]}).to_parquet(tmp_path / "gap.parquet")
    with pytest.raises(ScoringError, match=r"gap\.parquet: row 2: neither range nor delay"):
        read_results(tmp_path / "gap.parquet", capture)


def test_a_file_of_another_kind_or_none_is_refused(capture, tmp_path):
    with pytest.raises(ScoringError, match=r"expected \.csv or \.parquet"):
        read_results(written(tmp_path, "", "mine.txt"), capture)
    with pytest.raises(ScoringError, match="cannot be read: No such file"):
        read_results(tmp_path / "gone.csv", capture)


def test_a_track_is_read_and_a_row_without_one_belongs_to_none(capture, tmp_path):
    text = (
        "frame,range_m,track,range_rate_m_s,range_sd_m,probability\n0,2.5,3,-0.5,0.04,\n0,1.5,,,,\n1,2.4,3,-0.5,0.04,\n"
    )
    read = read_results(written(tmp_path, text), capture).detections
    assert read["track"].tolist() == [3, -1, 3]
    assert read["range_rate_m_s"][0] == -0.5
    assert "probability" not in read


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("1,2.0,0.5", "line 3: track 0.5: expected a whole number"),
        ("1,2.0,-2", "line 3: track -2: expected a whole number"),
        ("0,2.0,7", "line 3: track 7 has another row in frame 0 already"),
    ],
)
def test_a_track_is_a_number_in_one_place_at_a_time(row, said, capture, tmp_path):
    with pytest.raises(ScoringError, match=said):
        read_results(written(tmp_path, f"frame,range_m,track\n0,2.5,7\n{row}\n"), capture)
