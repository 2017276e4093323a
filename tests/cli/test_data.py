"""``convert`` and ``fetch``."""

from pathlib import Path

import numpy as np
import pytest

import uwbbench as package
from uwbbench.api.registry import load_plugin

MAPPING = """\
schema: 1
files: [frames.csv]
radar: {model: mine, center_frequency_hz: 7.0e9, bandwidth_hz: 5.0e8, sample_interval_ns: 1.0}
receivers:
  main: {mount_position_m: [0, 0, 0], mount_yaw_deg: 0, tx_position_m: [0, 0, 0], noise_taps: 0}
time: {column: t, unit: s}
preamble: {i: "re{tap}", q: "im{tap}"}
"""


def test_convert_writes_what_the_adapter_reads(uwbbench, tmp_path: Path) -> None:
    uwbbench("convert", ".", "--dataset", "approach", "--set", "channel=5", "-o", "new/folder/plate.h5")
    adapter = load_plugin("datasets", "approach")
    expected = adapter(adapter.params_type()(channel=5), ()).open("approach-ch5-metal-1")
    assert package.open_capture(tmp_path / "new/folder/plate.h5").sha256 == expected.sha256


def test_several_runs_get_a_file_each_and_one_can_be_chosen(uwbbench, tmp_path: Path) -> None:
    words = ("convert", ".", "--dataset", "approach", "--set", "runs=2", "-o", "plate.h5")
    uwbbench(*words)
    for run in ("approach-ch9-metal-1", "approach-ch9-metal-2"):
        assert package.open_capture(tmp_path / f"plate-{run}.h5").name == run
    uwbbench(*words, "--capture", "approach-ch9-metal-2")
    assert package.open_capture(tmp_path / "plate.h5").name == "approach-ch9-metal-2"
    assert "Did you mean 'approach-ch9-metal-2'?" in uwbbench(*words, "--capture", "aproach-ch9-metal2", code=2).stderr


def test_a_file_is_handed_to_an_adapter_that_takes_files(uwbbench, capture: Path, tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    capture.rename(tmp_path / "recordings/some [1].h5")
    uwbbench("convert", "recordings/some [1].h5", "--dataset", "capture", "-o", "copy.h5")
    copy = package.open_capture(tmp_path / "copy.h5")
    assert copy.sha256 == package.open_capture(tmp_path / "recordings/some [1].h5").sha256


def test_a_mapping_is_handed_to_the_table_adapter(uwbbench, tmp_path: Path) -> None:
    rows = ["t," + ",".join(f"re{tap},im{tap}" for tap in range(4))]
    rows += [f"{frame / 10}," + ",".join(f"{frame},{tap}" for tap in range(4)) for frame in range(3)]
    (tmp_path / "frames.csv").write_text("\n".join(rows))
    (tmp_path / "mapping.yaml").write_text(MAPPING)
    uwbbench("convert", "mapping.yaml", "--dataset", "table", "-o", "table.h5")
    found = package.open_capture(tmp_path / "table.h5").frames().preamble
    assert np.array_equal(found[2], [2, 2 + 1j, 2 + 2j, 2 + 3j])


def test_a_source_in_another_place_is_never_replaced_by_known_data(uwbbench, data_dir, monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("UWBBENCH_DATA", str(data_dir))
    words = ("convert", tmp_path, "--dataset", "pulson440-rail", "-o", "rail.h5")
    assert "scan_2105627.txt" in uwbbench(*words, code=2).stderr


def test_a_measured_recording_is_converted_from_its_folder(uwbbench, data_dir: Path, tmp_path: Path) -> None:
    for source in (data_dir / "et4173-walk", data_dir / "et4173-walk" / "101_P1.mat"):
        uwbbench("convert", source, "--dataset", "et4173-walk", "--capture", "101", "-o", "walk.h5")
        assert package.open_capture(tmp_path / "walk.h5").source == "measured"


def test_the_receivers_of_one_run_share_a_file(uwbbench, data_dir: Path, tmp_path: Path) -> None:
    uwbbench("convert", data_dir / "et4173-walk", "--dataset", "et4173-walk", "-o", "walk.h5")
    node = package.open_capture(tmp_path / "walk.h5", receiver="102")
    assert node.receivers == ("101", "102")
    assert node.trajectory.position_m[0].tolist() == [2.0, 2.0, 0.0]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["gone", "--dataset", "approach", "-o", "x.h5"], "gone: no such file or folder"),
        ([".", "--dataset", "aproach", "-o", "x.h5"], "Did you mean 'approach'?"),
        ([".", "--dataset", "approach", "--set", "chanel=5", "-o", "x.h5"], "Did you mean 'channel'?"),
        ([".", "--dataset", "approach", "-o", "x.mat"], "expected .h5"),
        ([".", "--dataset", "capture", "-o", "x.h5"], "'files' is missing"),
        (["other.txt", "--dataset", "pulson440-rail", "-o", "x.h5"], "give the folder"),
    ],
)
def test_wrong_words_for_convert_are_usage_errors(uwbbench, tmp_path: Path, words: list[str], says: str) -> None:
    (tmp_path / "other.txt").write_text("")
    assert says in uwbbench("convert", *words, code=2).stderr
    assert not list(tmp_path.glob("x.*"))


def test_fetch_refuses_what_is_not_published(uwbbench) -> None:
    assert "nothing to download" in uwbbench("fetch", "approach", code=2).stderr
    assert "Did you mean 'pulson440-rail'?" in uwbbench("fetch", "pulson440-rial", code=2).stderr


def test_fetch_prints_the_folder_of_files_that_are_there(uwbbench, data_dir: Path) -> None:
    result = uwbbench("fetch", "pulson440-rail", "--folder", data_dir)
    assert result.stdout.strip() == str(data_dir / "pulson440-rail")
