"""Texts of tables: safe wherever they are shown."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.show.text.numbers import interval, number, p_value, probability, rounded
from uwbbench.show.text.sheet import LONGEST_NAME, Sheet, escaped, shown


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("a|b", r"a\|b"),
        ("<script>", "&lt;script&gt;"),
        ("*x* _y_ `z`", r"\*x\* \_y\_ \`z\`"),
        ("[a](b)", r"\[a\](b)"),
        ("a\\|b", r"a\\\|b"),
    ],
)
def test_names_show_as_they_are_in_markdown(name: str, expected: str) -> None:
    assert escaped(name) == expected


@given(st.text(max_size=200))
def test_a_shown_name_is_one_short_printable_line(name: str) -> None:
    assert shown(name).isprintable()
    assert len(shown(name)) <= LONGEST_NAME


def test_control_characters_are_spelled_out() -> None:
    assert shown("a\n\x1b[31mb") == "a\\n\\x1b[31mb"


@given(st.lists(st.tuples(st.text(max_size=20), st.text(max_size=20)), min_size=1, max_size=4))
def test_every_row_of_a_markdown_table_has_its_cells_and_no_more(rows: list[tuple[str, str]]) -> None:
    sheet = Sheet("t", ("a", "b"), tuple((shown(one), shown(other)) for one, other in rows))
    lines = sheet.markdown().splitlines()[2:]
    assert len(lines) == len(rows) + 2
    assert all(line.replace("\\\\", "").replace("\\|", "").count("|") == 3 for line in lines)


def test_undefined_numbers_are_not_available() -> None:
    assert number(float("nan"), 1) == number(None, 1) == number(float("inf"), 1) == "n/a"
    assert interval(0.5, float("nan"), float("nan"), 2) == "0.50"
    assert interval(0.051, 0.049, 0.06, 1, 100.0) == "5.1 [4.9, 6.0]"
    assert interval(float("nan"), 0.1, 0.2, 2) == "n/a"


def test_a_probability_is_never_rounded_to_certainty() -> None:
    assert [p_value(p) for p in (0.0, 0.0009, 0.03, 1.0, float("nan"))] == ["<0.001", "<0.001", "0.030", "1.000", "n/a"]
    assert [probability(share) for share in (0.0, 0.5, 1.0, float("nan"))] == ["<0.01", "0.50", ">0.99", "n/a"]


def test_numbers_for_programs_have_five_digits_or_are_none() -> None:
    assert (rounded(1234567.0), rounded(None), rounded(float("inf"))) == (1234600.0, None, None)


def test_an_empty_sheet_says_so() -> None:
    assert "None." in Sheet("Failed", ("a",), ()).markdown()
