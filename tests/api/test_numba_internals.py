"""numba beside its documented interface."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_only_one_module_names_what_numba_does_not_document() -> None:
    undocumented = re.compile(r"\bnumba\.(core|np|cpython|misc|parfors)\b")
    sources = [path for room in ("uwbbench", "detectors", "datasets", "tests") for path in (ROOT / room).rglob("*.py")]
    named = [path.relative_to(ROOT).as_posix() for path in sources if undocumented.search(path.read_text("utf-8"))]
    assert named == ["uwbbench/api/numba_internals.py"]
