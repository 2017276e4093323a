"""Text for people: one line whatever a name holds, and docstrings without markup."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api.text import one_line, printable, summary, without_markup


@settings(max_examples=40)
@given(st.text(), st.integers(3, 40))
def test_every_name_is_one_printable_line_within_the_length(name, longest):
    assert printable(name).isprintable()
    assert printable(name, longest).isprintable()
    assert len(printable(name, longest)) <= longest


@given(st.text(alphabet=" \t\n\r\u2028\u202e\x1b\u200bab"))
def test_a_name_keeps_its_white_space_and_prose_does_not(text):
    assert printable(text).count(" ") == text.count(" ")
    assert "  " not in one_line(text)
    assert one_line(text) == one_line(f" {text}\n")


@pytest.mark.parametrize(
    ("char", "escape"), [("\u202e", "\\u202e"), ("\u200f", "\\u200f"), ("\x1b", "\\x1b"), ("\ud800", "\\ud800")]
)
def test_marks_that_turn_the_writing_and_control_characters_are_spelled_out(char, escape):
    assert printable(f"a{char}b") == one_line(f"a{char}b") == f"a{escape}b"


@pytest.mark.parametrize(
    ("docstring", "read"),
    [
        ("Score ``20 log10(A / A_noise)``, in dB.", "Score 20 log10(A / A_noise), in dB."),
        ("See :meth:`amplitude` and :class:`~uwbbench.api.Frames`.", "See amplitude and Frames."),
        ("After :func:`all of it <uwbbench.run>`.", "After all of it."),
        ("Glob patterns; ``**`` stands for folders.", "Glob patterns; ** stands for folders."),
        ("**Range.** The *leading* edge.", "Range. The leading edge."),
        ("Of a * b * c, 2*a and b**2.", "Of a * b * c, 2*a and b**2."),
        ("One.\n\nReferences\n----------\nRohling.", "One.\n\nReferences\nRohling."),
        ("`Table 3 <https://itu.int>`_ has it, and `x` too.", "Table 3 has it, and x too."),
    ],
)
def test_markup_is_gone_and_the_words_stay(docstring, read):
    assert without_markup(docstring) == read


def test_the_summary_is_the_first_paragraph_on_one_line():
    assert summary("\n    Peaks of a\n    ``profile``.\n\n    More.\n    ") == "Peaks of a profile."
    assert summary(None) == ""
