"""Every example of the documentation is run as a reader would run it, in an empty folder, page by page.

A comment before a fenced block says what to do with it: ``<!-- run -->`` runs the ``$`` lines of a console block or the
``>>>`` lines of a Python block and compares what they print, ``<!-- run: exit 1 -->`` expects that exit code, and
``<!-- file: NAME -->`` writes the block to a file.
"""

import doctest
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
BLOCK = re.compile(
    r"<!-- (run(?:: exit (?P<code>\d+))?|file: (?P<file>[\w./-]+)) -->\n+```(?P<kind>\w+)\n(?P<text>.*?)^```$",
    re.M | re.S,
)
MARK = re.compile(r"<!-- (run|file)\b")
PAGES = sorted(str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md") if MARK.search(page.read_text()))
LIKE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_the_examples_of_a_page_do_what_the_page_says(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (DOCS / name).read_text()
    blocks = list(BLOCK.finditer(text))
    assert len(blocks) == len(MARK.findall(text)), f"{name}: a mark without a block right below it"
    names: dict[str, object] = {}
    for block in blocks:
        if block["file"]:
            path = tmp_path / block["file"]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block["text"])
        elif block["kind"] == "console":
            _run_commands(block["text"], int(block["code"] or 0), tmp_path)
        else:
            _run_python(block["text"], name, names)


def _run_commands(text, expected_code, folder):
    binaries = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{binaries}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "120"}
    for part in re.split(r"^\$ ", text, flags=re.M)[1:]:
        command, wanted = _command_and_output(part)
        done = subprocess.run(  # noqa: S602 - the project's own documentation
            command,
            shell=True,
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert done.returncode == expected_code, f"$ {command}\n{done.stdout}"
        if wanted.strip():
            assert doctest.OutputChecker().check_output(wanted, done.stdout, LIKE), f"$ {command}\n{done.stdout}"


def _command_and_output(part):
    """A command, with the lines that a backslash joins to it, and the lines below."""
    lines = part.splitlines(keepends=True)
    last = next(place for place, line in enumerate(lines) if not line.rstrip().endswith("\\"))
    return "".join(lines[: last + 1]).strip(), "".join(lines[last + 1 :])


def _run_python(text, name, names):
    example = doctest.DocTestParser().get_doctest(text, names, name, name, 0)
    assert example.examples, f"{name}: a block marked to be run has no >>> lines"
    runner = doctest.DocTestRunner(optionflags=LIKE)
    report: list[str] = []
    runner.run(example, out=report.append, clear_globs=False)
    names.update(example.globs)
    assert not runner.failures, "".join(report)


def test_a_wrong_output_fails(tmp_path):
    with pytest.raises(AssertionError):
        _run_commands("$ echo one\ntwo\n", 0, tmp_path)


def test_a_wrong_exit_code_fails(tmp_path):
    with pytest.raises(AssertionError):
        _run_commands("$ exit 3\n", 0, tmp_path)


def test_an_output_may_leave_out_lines(tmp_path):
    _run_commands("$ printf 'a\\nb\\nc\\n'\na\n...\nc\n", 0, tmp_path)


def test_a_command_goes_on_behind_a_backslash(tmp_path):
    _run_commands("$ echo one \\\n    two\none two\n", 0, tmp_path)
