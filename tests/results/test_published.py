"""Published figures stand beside a run's own, each as it is printed."""

import numpy as np
import pytest

from tests.fixtures.chance import reseeded
from uwbbench import load_detector
from uwbbench.api.locate import config_folder
from uwbbench.api.yaml_file import read_yaml
from uwbbench.cli.render import print_leaderboard
from uwbbench.results import Report, published
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.show.page import Content, page
from uwbbench.show.text.report import sheets
from uwbbench.show.text.sheet import Sheet

DATASETS = "".join(
    f"  - {{use: approach, name: {material} {channel}, params: "
    f"{{channel: {channel}, material: {material}, speed_m_s: 3.0}}}}\n"
    for channel in (5, 9)
    for material in ("metal", "concrete", "plywood")
)


def report_on(folder, datasets: str) -> Report:
    folder.mkdir()
    text = f"schema: 1\ndetectors: [paper]\ndatasets:\n{datasets}scoring: peak\nlatency: false\nstability: false\n"
    (folder / "small.yaml").write_text(reseeded(text))
    return Report(run_experiment(read_experiment(folder / "small.yaml"), folder / "run", jobs=1))


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """Report of a run over both channels and all three materials."""
    return report_on(tmp_path_factory.mktemp("published") / "all", DATASETS)


def titled(report: Report, part: str) -> Sheet:
    (sheet,) = [sheet for sheet in sheets(report) if part in sheet.title and "peak scoring" not in sheet.title]
    return sheet


def test_each_published_row_follows_the_run_rows_of_its_channel_and_material(report: Report) -> None:
    sheet = titled(report, "after filtering")
    assert [row[3:5] for row in sheet.rows] == sorted(row[3:5] for row in sheet.rows)
    for index, row in enumerate(sheet.rows):
        if row[0] == published.NAME:
            assert sheet.rows[index - 1][0] == "paper"
            assert sheet.rows[index - 1][3:5] == row[3:5]
    assert sum(row[0] == published.NAME for row in sheet.rows) == 6


def test_rows_of_simulated_captures_say_so(report: Report) -> None:
    sheet = titled(report, "after filtering")
    source = sheet.columns.index("source")
    assert {(row[0], row[source]) for row in sheet.rows} == {
        ("paper", "simulated"),
        (published.NAME, "reported by source"),
    }


def test_published_rows_carry_the_printed_figures(report: Report) -> None:
    for part, expected in (("after filtering", "10.50"), ("after mapping", "16.89")):
        sheet = titled(report, part)
        cells = {row[3:5]: dict(zip(sheet.columns, row, strict=True)) for row in sheet.rows if row[0] == published.NAME}
        assert cells["9", "concrete"]["MAE (cm)"] == expected
        unknown = {head for row in cells.values() for head, text in row.items() if text == "not known"}
        assert unknown == {"bias (cm)", "scatter (cm)", "n", "frames"}
        assert any("reported by source" in note for note in sheet.notes)


def test_a_small_table_opens_the_report_and_gives_published_here_and_difference(report: Report) -> None:
    sheet = sheets(report)[0]
    assert sheet.columns[:3] == ("after", "channel", "material")
    assert sheet.columns[3:6] == ("precision published", "here (SIMULATED)", "difference")
    assert [name for name in sheet.columns if name.endswith("published")] == [
        "precision published",
        "recall published",
        "MAE (cm) published",
    ]
    assert [row[1:3] for row in sheet.rows] == [(str(channel), material) for channel, material in published.ROWS] * 2
    cells = {tuple(row[key] for key in ("table", "channel", "material", "metric")): row for row in report.published}
    assert len(cells) == 84
    here = report.paper_tables.set_index(["table", "channel", "material"])["mae"]
    for (table, channel, material, metric), cell in cells.items():
        if metric == "mae":
            np.testing.assert_equal(cell["here"], here.get((table, channel, material), np.nan))
            np.testing.assert_allclose(cell["difference"], cell["here"] - cell["published"])
            assert not cell["low"] > cell["here"]
            assert not cell["high"] < cell["here"]
    assert {cell["source"] for cell in cells.values() if cell["source"]} == {"simulated"}
    assert "reported by source" in sheet.notes[0]


def test_page_and_terminal_show_the_small_table(report: Report, capsys: pytest.CaptureFixture[str]) -> None:
    print_leaderboard(report)
    assert capsys.readouterr().out.startswith("Published and here")
    made = page(Content(report))
    assert made.index('id="published"') < made.index('id="leaderboard"')


def test_peaks_through_the_chain_stand_beside_those_of_the_paper(report: Report) -> None:
    sheet = titled(report, "Peaks through the chain")
    assert sheet.rows[-1][2:] == ("1", "5601", "444", "225", "89")
    for row in sheet.rows[:-1]:
        counts = [int(count) for count in row[3:]]
        assert counts == sorted(counts, reverse=True)
        assert counts[0] > 0
    chains = report.chains.set_index(["dataset", "step"])["count"]
    assert sheet.rows[0][3] == str(chains["metal 5", "peaks"])


def test_a_run_that_does_not_cover_the_paper_is_not_compared_with_it(tmp_path) -> None:
    made = report_on(tmp_path / "part", DATASETS.splitlines(keepends=True)[0])
    assert not made.repeats_the_paper
    assert not any(row[0] == published.NAME for sheet in sheets(made) for row in sheet.rows)


def test_all_84_cells_are_there_as_they_are_printed() -> None:
    printed = {
        ("filtering", 5, "metal"): (6.49, 12.34, 12.34, 14.25, 98.93, 100.00, 99.46),
        ("filtering", 5, "concrete"): (19.92, 44.24, 116.62, 36.96, 81.25, 93.77, 87.06),
        ("filtering", 5, "plywood"): (30.74, 48.02, 231.51, 63.08, 79.30, 68.04, 73.24),
        ("filtering", 9, "concrete"): (10.50, 18.49, 33.32, 11.37, 90.71, 88.40, 89.54),
        ("mapping", 5, "plywood"): (11.24, 19.71, 29.65, 8.63, 93.31, 79.26, 85.71),
        ("mapping", 9, "metal"): (6.85, 14.73, 17.40, 5.87, 96.93, 99.11, 98.01),
        ("mapping", 9, "concrete"): (16.89, 39.19, 46.47, 13.90, 73.42, 83.38, 78.08),
    }
    assert sum(map(len, published.FIGURES.values())) == 84
    assert set(published.FIGURES) == {(table, *row) for table in ("filtering", "mapping") for row in published.ROWS}
    for row, cells in printed.items():
        assert [100 * value for value in published.FIGURES[row].values()] == pytest.approx(cells, abs=1e-9)
    assert min(cells["mae"] for row, cells in published.FIGURES.items() if row[0] == "mapping") == 0.0685
    assert published.known("filtering", None, "concrete", "mae") is None


def test_f1_of_every_row_follows_from_its_precision_and_recall() -> None:
    for cells in published.FIGURES.values():
        both = 2 * cells["precision"] * cells["recall"] / (cells["precision"] + cells["recall"])
        assert cells["f1"] == pytest.approx(both, abs=1e-4)


def test_every_figure_has_its_line_and_thresholds_are_those_of_the_shipped_detector() -> None:
    paper = read_yaml(config_folder() / "published" / "arxiv-2512-01018.yaml").data
    lines = [row[-1] for rows in paper["figures"].values() for row in rows]
    lines += [row["line"] for rows in paper["parameters"].values() for row in rows]
    lines += [row["line"] for part in ("chain", "findings") for row in paper[part]]
    assert all(isinstance(line, int) and 1 <= line <= 752 for line in lines)
    overall = {row["channel"]: row for row in paper["parameters"]["filtering"] if row["material"] == "overall"}
    steps = {step.label: step for step in load_detector("paper").config.steps}
    for channel, row in overall.items():
        assert steps["filter.width"].params_for(channel)[0]["minimum"] == row["width"]
        assert steps["filter.prominence"].params_for(channel)[0]["minimum"] == row["prominence"]
        assert steps["filter.snr"].params_for(channel)[0]["minimum_db"] == row["snr_score_db"]
