"""Verdicts, exit codes, and what CI is shown."""

import datetime
import re
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.tools.gate.check import Check, GateResult, GateVerdict
from uwbbench.tools.gate.publish import junit, markdown

HOSTILE = "<script>alert('&\"')</script> | `x` [a](http://b) *\x1b[31m\x00\ud800\n## title\r\n]]>"


def result(*verdicts: GateVerdict, text: str = "plate") -> GateResult:
    checks = [
        Check(kind="latency", name=f"{text} {number}", verdict=verdict, reason=text, advice=text, elapsed_s=1.5)
        for number, verdict in enumerate(verdicts)
    ]
    return GateResult(text, text, text, checks, {"cpu": text})


@pytest.mark.parametrize(
    ("verdicts", "gravest", "code"),
    [
        ((), GateVerdict.PASS, 0),
        (
            (GateVerdict.PASS, GateVerdict.REGRESSION, GateVerdict.INVALID, GateVerdict.INCONCLUSIVE),
            GateVerdict.REGRESSION,
            1,
        ),
        ((GateVerdict.PASS, GateVerdict.INCONCLUSIVE), GateVerdict.INCONCLUSIVE, 2),
        ((GateVerdict.INCONCLUSIVE, GateVerdict.INVALID), GateVerdict.INVALID, 3),
    ],
)
def test_the_gravest_verdict_is_the_gates_and_has_its_own_exit_code(verdicts, gravest, code) -> None:
    found = result(*verdicts)
    assert found.verdict is gravest
    assert found.verdict.exit_code == found.to_dict()["exit_code"] == code


ATTRIBUTES = {
    "testsuites": set(),
    "testsuite": {
        *("id", "package", "name", "timestamp", "hostname"),
        *("tests", "failures", "errors", "skipped", "time"),
    },
    "properties": set(),
    "property": {"name", "value"},
    "testcase": {"classname", "name", "time"},
    "failure": {"message", "type"},
    "error": {"message", "type"},
    "system-out": set(),
    "system-err": set(),
}
"""Attributes that the schemas of Ant and Jenkins both allow, all of those that Ant's requires among them."""

CHILDREN = {
    "testsuites": r"(testsuite )*",
    "testsuite": r"properties (testcase )*system-out system-err ",
    "properties": r"(property )*",
    "testcase": r"((failure|error) )?",
}
"""Order of children that both allow."""


def assert_junit(root: ET.Element) -> None:
    """Hold a document against the schemas: elements, their order, their attributes, and the types of these."""
    assert root.tag == "testsuites"
    for element in root.iter():
        assert set(element.attrib) == ATTRIBUTES[element.tag]
        assert re.fullmatch(CHILDREN.get(element.tag, ""), "".join(f"{child.tag} " for child in element))
    assert [suite.get("id") for suite in root] == [str(number) for number in range(len(root))]
    for suite in root:
        assert re.fullmatch(r"\d{4}(-\d\d){2}T\d\d(:\d\d){2}", suite.get("timestamp"))  # no zone, no fractions
        datetime.datetime.fromisoformat(suite.get("timestamp"))
        counted = {"tests": "testcase", "failures": "testcase/failure", "errors": "testcase/error"}
        for name, path in counted.items():
            assert suite.get(name) == str(len(suite.findall(path)))
        assert suite.get("skipped") == "0"
        for element in (suite, *suite.findall("testcase")):
            assert re.fullmatch(r"\d+\.\d{3}", element.get("time"))
        assert all(suite.get(name) for name in ("package", "name", "hostname"))


@given(st.lists(st.sampled_from(GateVerdict), max_size=6), st.text())
def test_junit_keeps_to_the_common_schemas(verdicts, name: str) -> None:
    assert_junit(ET.fromstring(junit(result(*verdicts, text=f"a{name}"))))  # noqa: S314 - our own text


def test_each_verdict_has_its_outcome_in_junit_and_only_a_pass_is_green() -> None:
    root = ET.fromstring(junit(result(*GateVerdict)))  # noqa: S314
    found = [[(child.tag, child.get("type")) for child in case] for case in root.iter("testcase")]
    assert found == [[], [("failure", "regression")], [("error", "inconclusive")], [("error", "invalid")]]
    assert float(root[0].get("time")) == 6.0


def test_hostile_names_are_shown_as_they_are_in_xml_and_break_nothing() -> None:
    root = ET.fromstring(junit(result(GateVerdict.REGRESSION, GateVerdict.INVALID, text=HOSTILE)))  # noqa: S314
    (suite,) = root
    assert len(suite.findall("testcase")) == 2
    name = suite.find("testcase").get("name")
    assert name.startswith("<script>alert('&\"')</script> | `x`")
    assert "\\x1b[31m\\x00\\ud800 ## title ]]>" in name


def test_hostile_names_stay_in_their_cell_of_the_summary() -> None:
    text = markdown(result(GateVerdict.REGRESSION, text=HOSTILE))
    assert "<" not in text
    assert "\x1b" not in text
    assert [line for line in text.splitlines() if line.startswith("#")] == [text.splitlines()[0]]
    (row,) = [line for line in text.splitlines() if line.startswith("| &lt;script")]
    assert row.replace("\\|", "").count("|") == 6
    assert "\\[a\\](http" in row


@given(st.text())
def test_any_name_makes_xml_that_can_be_read_and_a_summary_of_one_table(name: str) -> None:
    found = result(GateVerdict.REGRESSION, text=f"a{name}")
    assert len(ET.fromstring(junit(found)).findall(".//failure")) == 1  # noqa: S314
    markdown(found).encode()
    assert sum(line.startswith("| ---") for line in markdown(found).splitlines()) == 1


def test_numbers_are_for_people_in_text_and_si_in_json() -> None:
    check = Check(
        kind="accuracy", name="MAE", verdict=GateVerdict.PASS, quantity="MAE", value=0.0312, low=0.03, high=0.04, n=12,
        counted="errors", unit="m", limit=0.05,
    )  # fmt: skip
    assert check.measured_text == "MAE 3.12 cm [3.00 cm, 4.00 cm], 12 errors"
    assert check.limit_text == "<= 5.00 cm"
    (told,) = GateResult("g", "h", "", [check], {"cpu": ""}).to_dict()["checks"]
    assert (told["value"], told["limit"], told["verdict"]) == (0.0312, 0.05, "pass")
