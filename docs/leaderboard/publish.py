"""Run a suite, and publish what it says: ``make leaderboard``.

The full suite is run (or a run of it continued), its site is built, and what the README, the page "Which detector
should I use?" and the table of scores say of it is written anew. With ``--check``, the quick version is run instead,
nothing is written, and whatever is out of date or differs is an error.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
from advice import advice_text
from tables import board_of, readme_text

import uwbbench
from uwbbench.api.locate import shipped
from uwbbench.run.experiment import read_experiment
from uwbbench.run.suite import read_frozen
from uwbbench.show.charts.theme import PRINT
from uwbbench.show.page.render import FIGURE_WIDTH
from uwbbench.show.site.charts import pareto
from uwbbench.tools.leaderboard import Leaderboard

SUITE = "robot-1"
DOCS = Path(__file__).parents[1]
README = DOCS.parent / "README.md"
PAGE = DOCS / "which-detector.md"
SCORES = Path(__file__).parent / f"{SUITE}.csv"
CHART = DOCS / "images" / f"{SUITE}.svg"
PICTURE = DOCS / "images" / "report.png"
COUNTS = ["tp", "fp", "fn"]
FLIPS = 3
"""Detections of a capture that may hang on the last digit, and be found on one processor only."""


def main(folder: Path, *, check: bool) -> int:
    """Publish, or check what is published."""
    run = folder / (f"{SUITE}-quick" if check else SUITE)
    if check:
        shutil.rmtree(run, ignore_errors=True)
    words = ["--resume" if (run / "manifest.json").is_file() else "--out", run]
    command = [sys.executable, "-m", "uwbbench.cli", "run", SUITE, *(["--quick"] if check else []), *map(str, words)]
    subprocess.run(command, check=True)  # noqa: S603 - fixed words
    opened = uwbbench.open_run(run)
    site = folder / ("site-quick" if check else "site")
    combined = uwbbench.leaderboard([opened], site, progress=lambda text: print(text, file=sys.stderr))  # noqa: T201
    return _checked(opened) if check else _published(opened, combined, folder)


def _published(run: uwbbench.Run, combined: Leaderboard, folder: Path) -> int:
    """Write everything that is made of a full run."""
    board = board_of(run, combined)
    _replace(README, readme_text(board))
    _replace(PAGE, advice_text(board, combined))
    counts, quick = _counts(run), _quick()
    kept = [key in quick for key in zip(counts["dataset"], counts["capture"], strict=True)]
    counts[kept].to_csv(SCORES, index=False)
    CHART.write_text(_chart(combined, board.timed[0]), encoding="utf-8")
    _photograph(run.path / "report.html", folder / "report.png")
    print(f"written: {README}, {PAGE}, {SCORES}, {CHART}; the site is in {folder / 'site'}")  # noqa: T201
    return 0


def _checked(run: uwbbench.Run) -> int:
    """Hold what is published against the suite as it is now, and against a quick run."""
    frozen = read_frozen(shipped("suites")[SUITE])
    version = "" if frozen is None else frozen.version[:12]
    problems = []
    for path in (README, PAGE):
        block = _block(path.read_text(encoding="utf-8"))[1]
        if f"version {version}" not in block:
            problems.append(f"{path.name}: is of another version of {SUITE} than {version}")
        names = [detector.name for detector in read_experiment(SUITE).detectors]
        problems += [f"{path.name}: lacks detector {name}" for name in names if f"`{name}`" not in block]
    known = pd.read_csv(SCORES, keep_default_na=False).set_index(["detector", "dataset", "capture"])
    for row in _counts(run).itertuples(index=False):
        key = row.detector, row.dataset, row.capture
        if key not in known.index:
            problems.append(f"{SCORES.name}: lacks {key}")
            continue
        stored = known.loc[key]
        if any(abs(int(stored[name]) - int(getattr(row, name))) > FLIPS for name in COUNTS):
            now = {name: int(getattr(row, name)) for name in COUNTS}
            problems.append(f"{SCORES.name}: {key} has {dict(stored[COUNTS])}, this run {now}")
    for problem in problems[:20]:
        print(f"error: {problem}", file=sys.stderr)  # noqa: T201
    if problems:
        print(f"{len(problems)} problems; 'make leaderboard' writes it anew", file=sys.stderr)  # noqa: T201
    return 1 if problems else 0


def _counts(run: uwbbench.Run) -> pd.DataFrame:
    """True and false detections and misses of each unit on frozen captures."""
    scores = run.scores
    scores = scores[(scores["table"] == "filtering") & scores["dataset"].isin(run.manifest["frozen"])]
    table = scores[["detector", "dataset", "capture", *COUNTS]].sort_values(["dataset", "capture", "detector"])
    return table.astype(dict.fromkeys(COUNTS, int))


def _quick() -> set[tuple[str, str]]:
    """Captures of the quick version."""
    datasets = read_experiment(SUITE, quick=True).datasets
    return {(one.label, ref.name) for one in datasets if not one.optional for ref in one.references()}


MARKS = "<!-- leaderboard: made by 'make leaderboard', not by hand -->", "<!-- leaderboard: end -->"


def _block(text: str) -> tuple[str, str, str]:
    """What stands before, between and behind the marks of a page."""
    found = re.fullmatch(f"(.*{re.escape(MARKS[0])}\n)(.*)({re.escape(MARKS[1])}.*)", text, re.DOTALL)
    if found is None:
        raise SystemExit(f"no marks of the leaderboard in {text[:40]!r}...")
    return found[1], found[2], found[3]


def _replace(path: Path, block: str) -> None:
    before, _, behind = _block(path.read_text(encoding="utf-8"))
    path.write_text(f"{before}\n{block.strip()}\n\n{behind}", encoding="utf-8")


def _chart(combined: Leaderboard, dataset: str) -> str:
    """Speed against F1 on a dataset as SVG."""
    import vl_convert

    content = combined.content
    section = next(one for one in content.sections if one.dataset == dataset)
    drawn = pareto(section.main, "f1", section.title, content.labels)
    if drawn is None:
        raise SystemExit(f"no detector was timed on {dataset}: there is no chart to draw")
    svg: str = vl_convert.vegalite_to_svg({**drawn, "width": FIGURE_WIDTH, "config": {**PRINT, "background": "white"}})
    return svg


def _photograph(page: Path, target: Path) -> None:
    """Picture of the top of the report; left as it was where there is no browser."""
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        print(f"no browser: {PICTURE} stays as it is", file=sys.stderr)  # noqa: T201
        return
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1400,1500"]
    words = [browser, *options, "--virtual-time-budget=20000", f"--screenshot={target}", page.resolve().as_uri()]
    subprocess.run(words, check=True, capture_output=True)  # noqa: S603 - fixed words
    sys.path.insert(0, str(DOCS / "pictures"))
    from draw import shrink

    shrink(target, PICTURE)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="for the run, the site and the pictures")
    parser.add_argument("--check", action="store_true", help="run the quick version, and write nothing")
    given = parser.parse_args()
    sys.exit(main(given.folder, check=given.check))
