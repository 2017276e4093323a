"""The shipped mapping for the paper's recordings reads a table of the layout that it guesses, and gives the tables."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from uwbbench.api.locate import config_folder
from uwbbench.config.source import open_dataset
from uwbbench.results import Report, published
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with one run of each material on both channels, and the shipped mapping beside them."""
    folder = tmp_path_factory.mktemp("recordings")
    shutil.copy(config_folder() / "mappings" / "published-dataset.yaml", folder)
    for material in ("metal", "concrete", "plywood"):
        parts = []
        for channel in (5, 9):
            params = {"channel": channel, "material": material, "speed_m_s": 3.0}
            dataset = open_dataset("approach", params, [])
            frames = dataset.open(dataset.names()[0]).frames()
            columns = {
                "run": f"{material}_1",
                "receiver": "front",
                "channel": channel,
                "timestamp": frames.timestamp_s,
                "robot_x": 1e3 * frames.position_m[:, 0],
                "robot_y": 1e3 * frames.position_m[:, 1],
                "robot_yaw": frames.yaw_rad,
            }
            for name, samples in (("cir", frames.preamble), ("sts1", frames.sts1), ("sts2", frames.sts2)):
                columns |= {f"{name}_i_{tap}": samples.real[:, tap] for tap in range(50)}
                columns |= {f"{name}_q_{tap}": samples.imag[:, tap] for tap in range(50)}
            parts.append(pd.DataFrame(columns))
        pd.concat(parts).to_csv(folder / f"{material}.csv", index=False)
    return folder


def test_the_mapping_reads_responses_poses_and_truth_of_each_run(recordings: Path) -> None:
    dataset = open_dataset("table", {"mapping": "published-dataset.yaml"}, [recordings])
    assert len(dataset.names()) == 6
    for name in dataset.names():
        capture = dataset.open(name)
        assert capture.truth is not None
        (thing,) = capture.truth.objects
        assert thing.material in name
        assert capture.radar.channel in (5, 9)
        assert capture.radar.has_sts
        assert capture.source == "measured"
        nearest = np.min(thing.outline_m[:, 0])
        assert nearest == pytest.approx(3.4, abs=0.002)
        assert capture.trajectory.position_m[-1, 0] == pytest.approx(2.8, abs=0.1)


@pytest.mark.slow
def test_one_command_gives_both_tables_beside_the_published_figures(recordings: Path, tmp_path: Path) -> None:
    experiment = read_experiment("published-dataset", data_dir=recordings)
    report = Report(run_experiment(experiment, tmp_path / "run", jobs=1))
    assert report.failures == []
    table = report.paper_tables
    assert set(table["table"]) == {"filtering", "mapping"}
    assert set(zip(table["channel"], table["material"], strict=True)) == set(published.ROWS)
    assert set(table["source"]) == {"measured"}
    assert report.repeats_the_paper
