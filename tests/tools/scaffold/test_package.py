"""New plugin packages: what is written, what is refused, and that they install, conform and pass their tests."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from uwbbench.api import ConfigError, StoreError
from uwbbench.api.registry import AUTHORED_KINDS
from uwbbench.tools.scaffold import PluginName, write_package

WORDS = {
    "stage": "clutter.my-own",
    "mapper": "slam.my-own",
    "detector": "my-detector",
    "dataset": "my.data",
    "metric": "rmse2",
}


def installed(package: Path, site: Path) -> dict[str, str]:
    """Environment in which the package is installed; nothing is downloaded."""
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-build-isolation"]
    done = subprocess.run([*command, "--target", site, package], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {**os.environ, "PYTHONPATH": str(site)}


@pytest.mark.slow
@pytest.mark.parametrize("kind", AUTHORED_KINDS)
def test_a_new_package_installs_and_its_own_tests_pass(kind, tmp_path):
    package = write_package(kind, WORDS[kind], tmp_path)
    environment = installed(package, tmp_path / "site")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", package / "tests"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=package)
    assert done.returncode == 0, done.stdout
    assert "failed" not in done.stdout
    assert int(done.stdout.rpartition("\n")[0].rpartition("\n")[2].split()[0]) > 20


@pytest.mark.slow
def test_an_installed_package_is_listed_and_checked_by_name(tmp_path):
    environment = installed(write_package("metric", "rmse2", tmp_path), tmp_path / "site")
    for words, expected in ((("list", "metrics"), "uwbbench-rmse2 0.1.0"), (("check", "rmse2"), "0 failed, 0 error")):
        command = [sys.executable, "-m", "uwbbench.cli", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert expected in done.stdout


@pytest.mark.parametrize("kind", AUTHORED_KINDS)
def test_a_new_package_is_small_and_clean(kind, tmp_path):
    package = write_package(kind, WORDS[kind], tmp_path)
    ruff = Path(sys.executable).with_name("ruff")
    for words in (("check",), ("format", "--check")):
        done = subprocess.run([ruff, *words, "--isolated"], cwd=package, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
    for module in package.rglob("*.py"):
        ast.parse(module.read_text())
        assert len(module.read_text().splitlines()) <= 90
    assert (package / ".gitignore").is_file()
    assert "uwbbench check" in (package / "README.md").read_text()
    assert not list(package.rglob("LICENSE*"))
    assert 'dependencies = ["uwbbench>=0.' in (package / "pyproject.toml").read_text()
    assert "$" not in "".join(path.read_text() for path in package.rglob("*.py"))


@pytest.mark.parametrize("name", ["Mine", "a1", "clutter.mine", "first-path", "a_b.c-d", "x" * 60])
def test_such_names_may_be_used(name):
    names = PluginName("stage", name)
    assert names.package.isidentifier()
    assert names.class_name.isidentifier()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("", "must start with a letter"),
        ("1st", "must start with a letter"),
        ("a..b", "single dots"),
        ("../evil", "single dots"),
        ("a/b", "single dots"),
        ("a b", "single dots"),
        ("mine\n", "single dots"),
        ("größe", "ASCII letters"),
        ("-a", "must start"),
        ("a" * 61, "at most 60"),
        ("x" * 10_000, "10000 characters"),
        ("lambda", "Python keyword; choose another, such as 'my.lambda'"),
        ("None", "Python keyword"),
        ("peaks", r"taken by uwbbench .*uwbbench_detectors\.peaks\.peaks:Peaks.*such as 'my\.peaks'"),
        ("filter-width", r"mistaken for 'filter\.width'"),
        ("Peaks", "mistaken for 'peaks'"),
        ("detectors", "a package uwbbench_detectors is installed"),
    ],
)
def test_such_names_are_refused_with_the_reason(name, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        write_package("stage", name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_name_of_a_shipped_detector_is_taken(tmp_path):
    with pytest.raises(ConfigError, match="'paper' is taken by uwbbench, which ships it"):
        write_package("detector", "paper", tmp_path)


def test_nothing_that_exists_is_overwritten(tmp_path):
    package = write_package("metric", "rmse2", tmp_path)
    before = {path: path.read_bytes() for path in package.rglob("*") if path.is_file()}
    with pytest.raises(StoreError, match="is there already; nothing was written"):
        write_package("stage", "rmse2", tmp_path)
    assert {path: path.read_bytes() for path in package.rglob("*") if path.is_file()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["uwbbench-rmse2"]


@pytest.mark.parametrize("kind_of_thing", ["file", "dangling link"])
def test_neither_is_a_file_or_a_link_in_its_place(kind_of_thing, tmp_path):
    place = tmp_path / "uwbbench-rmse2"
    if kind_of_thing == "file":
        place.write_text("mine")
    else:
        place.symlink_to("nowhere")
    with pytest.raises(StoreError, match="is there already"):
        write_package("metric", "rmse2", tmp_path)
    assert place.is_symlink() or place.read_text() == "mine"


def test_a_folder_that_is_a_file_is_one_message_and_leaves_nothing(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(StoreError, match=r"file: (is there already|cannot be written)"):
        write_package("metric", "rmse2", tmp_path / "file")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_missing_folders_are_made(tmp_path):
    assert write_package("metric", "rmse2", tmp_path / "a" / "b").is_dir()
