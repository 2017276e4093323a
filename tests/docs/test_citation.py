"""The citation file says what is released, in the format that it names."""

import datetime
import re
from pathlib import Path

import yaml

import uwbbench

ROOT = Path(__file__).parents[2]
KEYS = {"cff-version", "message", "title", "type", "version", "date-released", "license", "abstract", "authors"}
KEYS |= {"keywords", "references"}
REFERENCE = {"type", "title", "authors", "year", "identifiers", "notes"}


def citation():
    return yaml.safe_load((ROOT / "CITATION.cff").read_text())


def test_it_has_the_keys_that_version_1_2_0_requires_and_no_unknown_ones():
    found = citation()
    assert found["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= set(found) <= KEYS
    assert all(set(one) <= REFERENCE and {"type", "title", "authors"} <= set(one) for one in found["references"])
    assert all("name" in one or "family-names" in one for one in found["authors"])
    assert found["type"] == "software"


def test_its_version_is_that_of_the_package():
    assert citation()["version"] == uwbbench.__version__


def test_its_licence_is_that_of_the_package():
    assert f'license = "{citation()["license"]}"' in (ROOT / "pyproject.toml").read_text()


def test_its_date_is_that_of_the_release_where_there_was_one():
    found = citation()
    heading = re.search(rf"^## {re.escape(found['version'])} \(([\d-]+)\)", (ROOT / "CHANGELOG.md").read_text(), re.M)
    stated = found.get("date-released")
    assert (None if stated is None else stated.isoformat()) == (heading[1] if heading else None)
    assert stated is None or isinstance(stated, datetime.date)
