"""Formats for other programs, and what is never written over."""

import csv
import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.api import StoreError
from uwbbench.show.text.formats import MARK, check_replaceable, latex_escaped
from uwbbench.show.text.sheet import Sheet


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("50 % & more", r"50 \% \& more"),
        ("a_b^c~d", r"a\_b\textasciicircum{}c\textasciitilde{}d"),
        (r"\input{x}", r"\textbackslash{}input\{x\}"),
        ("$x$ #1 <b>", r"\$x\$ \#1 \textless{}b\textgreater{}"),
        ("[1]", "{}[1]"),
        ("a -- b", "a -{}- b"),
        ("two\nlines", "two lines"),
    ],
)
def test_latex_shows_names_as_they_are(text: str, expected: str) -> None:
    assert latex_escaped(text) == expected


@given(st.text())
def test_no_name_reaches_latex_as_a_command(text: str) -> None:
    escaped = latex_escaped(text)
    for known in ("textbackslash", "textasciicircum", "textasciitilde", "textless", "textgreater", "textbar"):
        escaped = escaped.replace(f"\\{known}{{}}", "")
    for known in ("textquotedbl", "textasciigrave"):
        escaped = escaped.replace(f"\\{known}{{}}", "")
    for char in "{}$&#%_":
        escaped = escaped.replace(f"\\{char}", "")
    assert "\\" not in escaped
    assert not set("$&#%_^~") & set(escaped)


def test_only_reports_are_replaced(tmp_path: Path) -> None:
    (tmp_path / "mine.html").write_text("<p>my own page")
    with pytest.raises(StoreError, match="no report of uwbbench"):
        check_replaceable(tmp_path / "mine.html", force=False)
    check_replaceable(tmp_path / "mine.html", force=True)
    (tmp_path / "old.html").write_text(f'<meta name="generator" content="{MARK}">')
    check_replaceable(tmp_path / "old.html", force=False)
    check_replaceable(tmp_path / "new.html", force=False)
    with pytest.raises(StoreError, match="no report of uwbbench"):
        check_replaceable(tmp_path, force=False)


def test_csv_tells_undefined_from_not_measured_and_starts_no_formula(tmp_path: Path) -> None:
    from uwbbench.show.text.formats import _csv

    rows = [{"name": "=cmd|' /C calc'!A0", "undefined": math.nan, "missing": None, "value": 0.125, "n": 3}]
    (row,) = csv.DictReader(_csv(rows).splitlines())
    assert row == {"name": "'=cmd|' /C calc'!A0", "undefined": "nan", "missing": "", "value": "0.125", "n": "3"}
    assert json.dumps(row)


def test_a_latex_table_holds_hostile_cells_and_says_where_it_is_empty() -> None:
    from uwbbench.show.text.formats import _latex_table

    text = _latex_table(Sheet("a_b", ("d & e", "n/a"), (("[x] 5 %", "0.5 [0.4, 0.6]"),), ("50 %",)))
    assert "{}[x] 5 \\% & 0.5 [0.4, 0.6] \\\\\n" in text
    assert "\\begin{tabular}{lr}\n\\toprule\nd \\& e & n/a \\\\\n\\midrule" in text
    assert text.splitlines()[-2:] == ["\\par\\footnotesize 50 \\%", "\\end{table*}"]
    assert "None. &" in _latex_table(Sheet("none", ("a", "b"), ()))
