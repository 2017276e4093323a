"""Published figures stand beside a run's own, and what is not known is never filled in."""

import pytest

from tests.fixtures.chance import reseeded
from uwbbench.results import Report, published
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
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
    assert {(row[0], row[source]) for row in sheet.rows} == {("paper", "simulated"), (published.NAME, "published")}


def test_known_cells_carry_the_published_value_and_all_others_say_not_known(report: Report) -> None:
    sheet = titled(report, "after filtering")
    cells = {
        (row[3], row[4]): dict(zip(sheet.columns, row, strict=True)) for row in sheet.rows if row[5] == "published"
    }
    assert cells["5", "plywood"]["MAE (cm)"] == "30.74"
    assert cells["9", "concrete"]["MAE (cm)"] == "16.89"
    assert cells["5", "concrete"]["recall"] == "0.9380"
    shown = [cells[key][head] for key in cells for head in sheet.columns[6:]]
    assert shown.count("not known") == len(shown) - sum(map(len, published.FIGURES.values()))
    mapping = titled(report, "after mapping")
    assert all(set(row[6:]) == {"not known"} for row in mapping.rows if row[5] == "published")


def test_peaks_through_the_chain_stand_beside_those_of_the_paper(report: Report) -> None:
    sheet = titled(report, "Peaks through the chain")
    assert sheet.rows[-1][2:] == ("5601", "444", "225", "89")
    for row in sheet.rows[:-1]:
        counts = [int(count) for count in row[2:]]
        assert counts == sorted(counts, reverse=True)
        assert counts[0] > 0
    chains = report.chains.set_index(["dataset", "step"])["count"]
    assert sheet.rows[0][2] == str(chains["metal 5", "peaks"])


def test_a_run_that_does_not_cover_the_paper_is_not_compared_with_it(tmp_path) -> None:
    made = report_on(tmp_path / "part", DATASETS.splitlines(keepends=True)[0])
    assert not made.repeats_the_paper
    assert not any(row[0] == published.NAME for sheet in sheets(made) for row in sheet.rows)


def test_figures_belong_to_rows_that_the_paper_has() -> None:
    assert {row[1:] for row in published.FIGURES} <= set(published.ROWS)
    assert published.known("mapping", 9, "concrete", "mae") is None
    assert published.known("filtering", None, "concrete", "mae") is None
