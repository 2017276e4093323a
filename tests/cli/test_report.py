"""``report``: formats, what is never written over, and run folders that are not as a run leaves them."""

import csv
import json
import shutil
from pathlib import Path

import pytest

EXPERIMENT = """\
schema: 1
name: small
detectors: [./simple.yaml, oracle]
datasets:
  - {use: capture, params: {files: ["*.h5"]}}
latency: false
stability: false
intervals: {resamples: 100}
"""


@pytest.fixture
def run(ran, tmp_path: Path) -> Path:
    """A run folder, beside its capture."""
    shutil.copytree(ran("run", EXPERIMENT), tmp_path, dirs_exist_ok=True)
    return tmp_path / "run"


def test_a_run_leaves_a_page_beside_the_markdown(run: Path) -> None:
    assert (run / "report.md").is_file()
    assert "<title>small (simulated)" in (run / "report.html").read_text()


def test_the_suffix_decides_the_format(uwbbench, run: Path, tmp_path: Path) -> None:
    for name, start in (
        ("a.html", "<!doctype html>"),
        ("a.md", "<!-- uwbbench"),
        ("a.tex", "% uwbbench"),
        ("a.json", "{"),
    ):
        uwbbench("report", "run", "-o", name)
        assert (tmp_path / name).read_text().startswith(start)
    assert "\\toprule" in (tmp_path / "a.tex").read_text()
    uwbbench("report", "run", "--format", "csv", "-o", "tables")
    (first, *_) = csv.DictReader((tmp_path / "tables/leaderboard.csv").open())
    assert first["detector"] == "simple"
    assert first["p50_us"] == ""  # not measured
    assert json.loads((tmp_path / "tables/tables.json").read_text())["rows"]["failures"] == 0


def test_texts_go_to_the_terminal_where_no_file_is_named(uwbbench, run: Path) -> None:
    assert "## Captures" in uwbbench("report", "run", "--format", "md").stdout
    assert "\\begin{table*}" in uwbbench("report", "run", "--format", "latex").stdout
    assert json.loads(uwbbench("report", "run", "--format", "json").stdout)["leaderboard"]


@pytest.mark.slow
def test_figures_are_written(uwbbench, run: Path, tmp_path: Path) -> None:
    assert "figures written to figures" in uwbbench("report", "run", "--figures", "figures").stderr
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert {"map-1.png", "map-1.svg", "map-1.vl.json"} <= names


def test_a_file_that_is_no_report_is_not_replaced(uwbbench, run: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("my thesis")
    assert "--force" in uwbbench("report", "run", "-o", "thesis.tex", code=2).stderr
    assert (tmp_path / "thesis.tex").read_text() == "my thesis"
    uwbbench("report", "run", "-o", "thesis.tex", "--force")
    uwbbench("report", "run", "-o", "thesis.tex")  # now it is one


def test_a_report_does_not_change_the_run(uwbbench, run: Path, tmp_path: Path) -> None:
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    uwbbench("report", "run", "-o", "a.html")
    uwbbench("report", "run", "--format", "csv", "-o", "tables")
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


def test_samples_that_are_gone_are_said_to_be(uwbbench, run: Path, tmp_path: Path) -> None:
    (tmp_path / "run.h5").unlink()
    uwbbench("report", "run", "-o", "a.html")
    assert "Capture not at hand" in (tmp_path / "a.html").read_text()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["-o", "a.docx"], "expected a name that ends in .html"),
        (["--format", "html"], "name it by -o"),
        (["--format", "csv"], "name it by -o"),
        (["--json", "-o", "a.html"], "--json prints JSON"),
    ],
)
def test_wrong_words_are_usage_errors(uwbbench, run: Path, words: list[str], says: str) -> None:
    assert says in uwbbench("report", "run", *words, code=2).stderr


def edit_manifest(run: Path, change) -> None:
    manifest = json.loads((run / "manifest.json").read_text())
    change(manifest)
    (run / "manifest.json").write_text(json.dumps(manifest))


def edit_journal(run: Path, old: str, new: str) -> None:
    text = (run / "journal.jsonl").read_text()
    assert old in text
    (run / "journal.jsonl").write_text(text.replace(old, new))


def first_of(run: Path, folder: str) -> Path:
    return min((run / folder).glob("*.parquet"))


DAMAGE = {
    "no experiment": (lambda run: edit_manifest(run, lambda m: m.pop("experiment")), "no 'experiment'"),
    "detectors are a number": (lambda run: edit_manifest(run, lambda m: m["experiment"].update(detectors=3)), "edited"),
    "no sessions": (lambda run: edit_manifest(run, lambda m: m.update(sessions=[])), "edited"),
    "a later format": (lambda run: edit_manifest(run, lambda m: m.update(format_version=9)), "expected uwbbench-run"),
    "manifest cut short": (
        lambda run: (run / "manifest.json").write_text((run / "manifest.json").read_text()[:500]),
        "not valid JSON",
    ),
    "no scores": (lambda run: (run / "scores.parquet").unlink(), "continue it with --resume"),
    "scores cut short": (
        lambda run: (run / "scores.parquet").write_bytes((run / "scores.parquet").read_bytes()[:100]),
        "not a readable Parquet file",
    ),
    "no detections": (lambda run: shutil.rmtree(run / "detections"), "detections"),
    "detections cut short": (
        lambda run: first_of(run, "detections").write_bytes(b"PAR1"),
        "not a readable Parquet file",
    ),
    "a way out of the folder": (
        lambda run: edit_journal(run, '"capture_id": "', '"capture_id": "../../'),
        "../../",
    ),
    "an older journal": (lambda run: edit_journal(run, '"materials"', '"things"'), "no 'materials'"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_run_folder_is_one_clear_message(uwbbench, run: Path, tmp_path: Path, damage: str) -> None:
    spoil, says = DAMAGE[damage]
    spoil(run)
    result = uwbbench("report", "run", "-o", "a.html", code=2)
    assert says in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "a.html").exists()
