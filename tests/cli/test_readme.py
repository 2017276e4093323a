"""What the README shows can be done."""

import re
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import typer.main

from uwbbench.api import Block
from uwbbench.api.locate import config_folder, shipped
from uwbbench.api.yaml_file import parse_yaml
from uwbbench.cli import app
from uwbbench.detect.pipeline import detector_from_yaml
from uwbbench.tools.schema import experiment_schema

_README = Path(__file__).parents[2] / "README.md"


def blocks(language: str, holding: str = "") -> list[str]:
    """Code blocks of the README in a language."""
    text = _README.read_text(encoding="utf-8")
    return [code for code in re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL) if holding in code]


COMMANDS = [line.split("#")[0].strip() for code in blocks("console") for line in code.splitlines()]


def test_the_set_up_commands_are_there() -> None:
    makefile = (config_folder().parent / "Makefile").read_text()
    for target in ("demo", "test"):
        assert f"make {target}" in COMMANDS
        assert f"\n{target}:" in makefile


@pytest.mark.parametrize("line", [line for line in COMMANDS if line.startswith("uwbbench ")])
def test_every_command_line_parses(line: str) -> None:
    name, *words = line.split()[1:]
    command = typer.main.get_command(app).commands[name]
    assert command.make_context(name, words).params


def test_every_command_is_shown() -> None:
    shown = {line.split()[1] for line in COMMANDS if line.startswith("uwbbench ")}
    assert shown == set(typer.main.get_command(app).commands)


@pytest.mark.parametrize("text", blocks("yaml", "pipeline"))
def test_the_detectors_are_valid_and_run(text: str, approach) -> None:
    assert len(detector_from_yaml(text).run(approach)) > 0


@pytest.mark.parametrize("text", blocks("yaml", "datasets:"))
def test_the_experiments_fit_the_schema(text: str) -> None:
    jsonschema.Draft202012Validator(experiment_schema()).validate(parse_yaml(text, "README.md").data)


def test_the_shipped_names_exist() -> None:
    text = _README.read_text(encoding="utf-8")
    assert "uwbbench run demo " in text
    assert "demo" in shipped("experiments")
    assert (config_folder() / "mappings/template.yaml").is_file()


def test_the_python_example_runs(capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(capture.parent)
    (code,) = blocks("python", "open_capture")
    names: dict = {}
    exec(code, names)  # noqa: S102
    assert len(names["table"]) == len(names["found"]) > 0


def test_the_stage_filters(approach) -> None:
    (code,) = blocks("python", "class RelativeAmplitude(")
    names: dict = {}
    exec(code, names)  # noqa: S102
    stage = names["RelativeAmplitude"](names["RelativeAmplitudeParams"](minimum_db=-6.0))
    stage.open(approach.radar)
    found = detector_from_yaml(blocks("yaml", "name: mine")[0].replace("select.strongest", "select.all")).run(approach)
    frames = approach.frames()
    kept = stage.step(Block(frames, detections=found)).detections
    share = kept["amplitude"] / frames.amplitude.max(axis=1)[kept.frame]
    assert 0 < len(kept) < len(found)
    assert share.min() >= 10 ** (-6 / 20)


def test_the_dataset_reads(tmp_path: Path) -> None:
    cir = np.arange(6, dtype=np.complex64).reshape(2, 3)
    np.savez(tmp_path / "one.npz", cir=cir, time_s=np.array([0.0, 0.02]))
    (code,) = blocks("python", "class NpzRuns(")
    names: dict = {}
    exec(code, names)  # noqa: S102
    dataset = names["NpzRuns"](names["NpzRunsParams"](files=["one.npz"]), [tmp_path])
    assert np.array_equal(dataset.open("one.npz").frames().preamble, cir)


def test_the_entry_points_have_the_groups_that_are_read() -> None:
    (code,) = blocks("toml")
    groups = tomllib.loads(code)["project"]["entry-points"]
    assert set(groups) <= {f"uwbbench.{kind}" for kind in ("stages", "datasets", "metrics", "detectors")}
