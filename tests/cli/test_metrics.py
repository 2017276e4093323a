"""A metric of another package, in one class and one line, is in everything that a run is shown as."""

import base64
import csv
import json
import math
import re
import zlib
from pathlib import Path

import numpy as np
import pytest

from uwbbench.results import Report
from uwbbench.run.folder import RunFolder

pytestmark = pytest.mark.slow

METRIC = '''\
"""A metric of another package."""

import numpy as np

from uwbbench.api import Metric


class MedianAbsoluteError(Metric):
    """Median of the absolute errors."""

    title, unit, merge, better = "median error", "m", "stack", "lower"
    shown_as = ("mm", 1000.0, 2)

    @staticmethod
    def partial(outcome):
        """Absolute errors."""
        return np.abs(outcome.error_m[np.isfinite(outcome.error_m)])

    @staticmethod
    def value(partial):
        """Their median."""
        return float(np.median(partial)) if len(partial) else float("nan")
'''
LINE = {"metrics": {"median": "median_error:MedianAbsoluteError"}}

EXPERIMENT = """\
schema: 1
name: small
detectors: [./simple.yaml, oracle, "null"]
datasets:
  - {use: capture, params: {files: ["*.h5"]}}
scoring: frame
latency: false
stability: false
intervals: {resamples: 100}
metrics: [METRICS]
"""
HEAD = "median error (mm)"


@pytest.fixture
def install_median(install_plugin):
    """Install the package."""
    return lambda: install_plugin("median-error", LINE, {"median_error.py": METRIC})


@pytest.fixture
def run(uwbbench, capture: Path, detector: Path, tmp_path: Path, install_median):
    """Run the small experiment with some metrics listed into a new folder."""
    install_median()

    def made(name: str, metrics: str = "median") -> Path:
        (tmp_path / "small.yaml").write_text(EXPERIMENT.replace("METRICS", metrics))
        uwbbench("run", "small.yaml", "--out", name, "--jobs", 1, "--quiet")
        return tmp_path / name

    return made


def expected(folder: Path) -> dict[str, str]:
    """Median error in millimetres of each detector, from the stored detections."""
    errors = {one.detector: np.abs(one.outcome.error_m) for one in Report(RunFolder(folder)).scored}
    return {name: f"{1000 * np.nanmedian(error_m):.2f}" for name, error_m in errors.items() if len(error_m)}


def column(table: list[list[str]], head: str) -> dict[str, str]:
    """Cells under a head, by the detector of their row."""
    heads, *rows = table
    return {row[heads.index("detector")].removesuffix(" (bound)"): row[heads.index(head)] for row in rows}


def cells(lines: list[str], separator: str, head: str) -> list[list[str]]:
    """Rows of the first table of text that has such a head."""
    start = next(number for number, line in enumerate(lines) if head in line)
    rows = [[cell.strip() for cell in re.split(separator, line.strip())] for line in lines[start : start + 8]]
    return [row for row in rows if len(row) == len(rows[0])]


def test_a_listed_metric_of_another_package_is_in_the_terminal_and_in_every_report(uwbbench, run, tmp_path: Path):
    folder = run("run")
    medians = expected(folder)
    assert set(medians) == {"simple", "oracle"}
    printed = uwbbench("report", "run").stdout.splitlines()
    markdown = (folder / "report.md").read_text().splitlines()
    latex = uwbbench("report", "run", "--format", "latex").stdout.replace(r" \\", "").splitlines()
    for lines, separator in ((printed, r"\s{2,}"), (markdown, r"\s*\|\s*"), (latex, " & ")):
        shown = column(cells(lines, separator, HEAD), HEAD)
        assert {name: shown[name].split()[0] for name in medians} == medians
        assert shown["null"] == "n/a"
    uwbbench("report", "run", "--format", "csv", "-o", "tables")
    rows = {row["detector"]: row for row in csv.DictReader((tmp_path / "tables" / "leaderboard.csv").open())}
    assert {name: f"{1000 * float(rows[name]['median']):.2f}" for name in medians} == medians
    report = json.loads(uwbbench("report", "run", "--json").stdout)
    values = {row["detector"]: row["median"]["value"] for row in report["leaderboard"]}
    assert {name: f"{1000 * values[name]:.2f}" for name in medians} == medians
    assert values["null"] is None


def test_a_listed_metric_is_printed_at_the_end_of_the_run(uwbbench, run):
    run("run")
    printed = uwbbench("rescore", "run").stdout.splitlines()
    assert HEAD in next(line for line in printed if "F1" in line)


def test_a_listed_metric_is_a_column_a_choice_and_a_chart_of_the_page(run):
    text = (run("run") / "report.html").read_text()
    packed = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)
    assert packed is not None
    data = json.loads(zlib.decompress(base64.b64decode(packed[1])))
    (board,) = data["boards"]
    assert (board["main"], board["charted"][0]) == ("median", "median")
    assert "median" in board["columns"]
    (quantity,) = [one for one in data["quantities"] if one["name"] == "median"]
    assert (quantity["title"], quantity["unit"], quantity["digits"]) == ("median error", "mm", 2)
    assert "simple has median error" in text


def test_a_listed_metric_is_compared_between_runs(uwbbench, run, detector: Path):
    run("before")
    detector.write_text(detector.read_text().replace("{use: range}", "{use: range, params: {bias_m: 0.1}}"))
    run("after")
    found = json.loads(uwbbench("diff", "before", "after", "--json").stdout)
    (one,) = [row for row in found["scores"] if (row["metric"], row["detector"]) == ("median", "simple")]
    assert math.isclose(one["difference"]["value"], one["after"] - one["before"])
    assert HEAD in uwbbench("diff", "before", "after").stdout


def test_a_listed_metric_is_ranked_by_and_compared_in_pairs_on_the_leaderboard(uwbbench, run, tmp_path: Path):
    medians = expected(run("run"))
    uwbbench("leaderboard", "run", "-o", "site")
    (suite,) = json.loads((tmp_path / "site" / "leaderboard.json").read_text())["suites"]
    (board,) = suite["boards"]
    assert board["ranked_by"] == "median"
    assert [one["detector"] for one in board["standings"]] == ["simple", "oracle", "null"]
    values = {one["detector"]: one["estimates"]["median"]["value"] for one in board["standings"]}
    assert {name: f"{1000 * values[name]:.2f}" for name in medians} == medians
    assert board["pairs"] == []  # the others are bounds
    for page in ("index.html", *(f"datasets/{one.name}" for one in (tmp_path / "site" / "datasets").iterdir())):
        text = (tmp_path / "site" / page).read_text()
        assert f'<th scope="col">{HEAD}</th>' in text
        assert "simple has median error" in text
    assert HEAD in uwbbench("leaderboard", "run").stdout


def test_a_metric_that_is_not_installed_is_shown_under_its_name_as_it_was_stored(uwbbench, run, tmp_path, request):
    folder = run("run")
    stored = RunFolder(folder).scores().set_index("detector")["median_m"]
    request.getfixturevalue("monkeypatch").undo()
    from uwbbench.api import registry

    registry.entries.cache_clear()
    registry.load_plugin.cache_clear()
    report = json.loads(uwbbench("report", folder, "--json").stdout)
    values = {row["detector"]: row["median"]["value"] for row in report["leaderboard"]}
    assert values["simple"] == stored["simple"] > 0
    assert values["null"] is None
    assert any("no metric named 'median' is installed" in note for note in report["notes"])
    shown = column(cells(uwbbench("report", folder).stdout.splitlines(), r"\s{2,}", "median"), "median")
    assert shown["simple"] == f"{stored['simple']:.3f}"
    board = json.loads(uwbbench("leaderboard", folder, "--json").stdout)["suites"][0]["boards"][0]
    assert board["ranked_by"] == "f1"
    assert {one["detector"]: one["estimates"]["median"]["value"] for one in board["standings"]} == values
    uwbbench("verify", folder)


def test_stored_values_of_a_listed_metric_are_verified(uwbbench, run):
    folder = run("run")
    assert "consistent" in uwbbench("verify", folder).stdout
    runs = RunFolder(folder)
    rows, rules = runs.scores().to_dict("records"), runs.rules
    rows[1]["median_m"] = 0.5
    runs.write_scores(rows, rules)
    assert "median_m 0.5, not" in uwbbench("verify", folder, code=1).stdout


def test_the_first_listed_metric_ranks_and_one_without_a_better_end_does_not(run):
    ranked = {metrics: Report(RunFolder(run(name, metrics))) for name, metrics in (("a", "bias, sd"), ("b", "p90"))}
    assert ranked["bias, sd"].metrics.ranking(exhaustive=True) == "f1"
    assert ranked["p90"].metrics.ranking(exhaustive=True) == "p90"


def test_a_metric_that_cannot_be_loaded_leaves_the_others_in_place(uwbbench, run, install_plugin):
    run("run")
    install_plugin("broken", {"metrics": {"broken": "broken_metric:Broken"}}, {"broken_metric.py": "1 / 0\n"})
    report = json.loads(uwbbench("report", "run", "--json").stdout)
    assert {"f1", "median"} <= set(report["leaderboard"][0])
    assert any("metric 'broken' of broken 1.0 cannot be loaded" in note for note in report["notes"])
