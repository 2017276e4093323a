"""Verdicts, exit codes, and what CI is shown."""

import datetime
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.gate.check import Check, Result, Verdict
from uwbbench.gate.publish import junit, markdown

HOSTILE = "<script>alert('&\"')</script> | `x` [a](http://b) *\x1b[31m\x00\ud800\n## title\r\n]]>"


def result(*verdicts: Verdict, text: str = "plate") -> Result:
    checks = [
        Check(kind="latency", name=f"{text} {number}", verdict=verdict, reason=text, advice=text, elapsed_s=1.5)
        for number, verdict in enumerate(verdicts)
    ]
    return Result(text, text, text, checks, {"cpu": text})


@pytest.mark.parametrize(
    ("verdicts", "gravest", "code"),
    [
        ((), Verdict.PASS, 0),
        ((Verdict.PASS, Verdict.REGRESSION, Verdict.INVALID, Verdict.INCONCLUSIVE), Verdict.REGRESSION, 1),
        ((Verdict.PASS, Verdict.INCONCLUSIVE), Verdict.INCONCLUSIVE, 2),
        ((Verdict.INCONCLUSIVE, Verdict.INVALID), Verdict.INVALID, 3),
    ],
)
def test_the_gravest_verdict_is_the_gates_and_has_its_own_exit_code(verdicts, gravest, code) -> None:
    found = result(*verdicts)
    assert found.verdict is gravest
    assert found.verdict.exit_code == found.to_dict()["exit_code"] == code


def test_junit_has_the_shape_that_readers_expect() -> None:
    root = ET.fromstring(junit(result(*Verdict)))  # noqa: S314 - our own text
    assert root.tag == "testsuites"
    (suite,) = root
    counts = {name: suite.get(name) for name in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "4", "failures": "1", "errors": "1", "skipped": "1"}
    for name in ("id", "package", "name", "hostname"):
        assert suite.get(name)
    assert datetime.datetime.fromisoformat(suite.get("timestamp"))
    assert [child.tag for child in suite] == ["properties", *["testcase"] * 4, "system-out", "system-err"]
    assert float(suite.get("time")) == 6.0
    outcomes = []
    for case in suite.findall("testcase"):
        assert case.get("name")
        assert case.get("classname")
        assert float(case.get("time")) == 1.5
        outcomes.append([child.tag for child in case])
        assert all(child.get("type") for child in case if child.tag != "skipped")
    assert outcomes == [[], ["failure"], ["skipped"], ["error"]]


def test_hostile_names_are_shown_as_they_are_in_xml_and_break_nothing() -> None:
    root = ET.fromstring(junit(result(Verdict.REGRESSION, Verdict.INVALID, text=HOSTILE)))  # noqa: S314
    (suite,) = root
    assert len(suite.findall("testcase")) == 2
    name = suite.find("testcase").get("name")
    assert name.startswith("<script>alert('&\"')</script> | `x`")
    assert "\\x1b[31m\\x00\\ud800 ## title ]]>" in name


def test_hostile_names_stay_in_their_cell_of_the_summary() -> None:
    text = markdown(result(Verdict.REGRESSION, text=HOSTILE))
    assert "<" not in text
    assert "\x1b" not in text
    assert [line for line in text.splitlines() if line.startswith("#")] == [text.splitlines()[0]]
    (row,) = [line for line in text.splitlines() if line.startswith("| &lt;script")]
    assert row.replace("\\|", "").count("|") == 6
    assert "\\[a\\](http" in row


@given(st.text())
def test_any_name_makes_xml_that_can_be_read_and_a_summary_of_one_table(name: str) -> None:
    found = result(Verdict.REGRESSION, text=f"a{name}")
    assert len(ET.fromstring(junit(found)).findall(".//failure")) == 1  # noqa: S314
    markdown(found).encode()
    assert sum(line.startswith("| ---") for line in markdown(found).splitlines()) == 1


def test_numbers_are_for_people_in_text_and_si_in_json() -> None:
    check = Check(
        kind="accuracy", name="MAE", verdict=Verdict.PASS, quantity="MAE", value=0.0312, low=0.03, high=0.04, n=12,
        counted="errors", unit="m", limit=0.05,
    )  # fmt: skip
    assert check.measured_text == "MAE 3.12 cm [3.00 cm, 4.00 cm], 12 errors"
    assert check.limit_text == "<= 5.00 cm"
    (told,) = Result("g", "h", "", [check], {"cpu": ""}).to_dict()["checks"]
    assert (told["value"], told["limit"], told["verdict"]) == (0.0312, 0.05, "pass")
