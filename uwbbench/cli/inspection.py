"""Commands that look and change nothing: ``list``, ``show``, ``info``, ``validate``, ``schema``, ``version``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

import uwbbench
from uwbbench.api.errors import UwbbenchError
from uwbbench.cli import options, render
from uwbbench.cli.exit_codes import USAGE_ERROR


class ListedKind(StrEnum):
    """What can be listed."""

    STAGES = "stages"
    DETECTORS = "detectors"
    DATASETS = "datasets"
    METRICS = "metrics"
    TERMS = "terms"


class File(StrEnum):
    """Files that have a schema."""

    DETECTOR = "detector"
    EXPERIMENT = "experiment"
    SCENE = "scene"
    GATE = "gate"
    TUNING = "tuning"
    TRAINING = "training"
    FIT = "fit"
    ROBOT = "robot"


def list_names(
    kind: Annotated[ListedKind | None, typer.Argument(help="Only this kind.", show_default=False)] = None,
    json: options.Json = False,
) -> None:
    """List what is installed. Nothing of it is loaded."""
    from uwbbench.api import registry

    listed = {name: _listed(name) for name in ([kind.value] if kind else registry.KINDS)}
    if json:
        render.print_json(listed)
        return
    for name, rows in listed.items():
        problems = ["problem"] if any(row["problem"] for row in rows) else []
        shown = ["name", "package", "target", *problems]
        render.print_table(name, shown, [[row[column] for column in shown] for row in rows])


def _listed(kind: Any) -> list[dict[str, str]]:
    from uwbbench.api import registry
    from uwbbench.api.locate import shipped

    files = shipped("detectors") if kind == "detectors" else {}
    own = {"package": f"uwbbench {uwbbench.__version__}", "problem": ""}
    rows = [{"name": name, "target": str(path), **own} for name, path in files.items()]
    for entry in registry.entries(kind).values():
        rivals = [*entry.rivals, *([own["package"]] if entry.name in files else [])]
        problem = f"unusable: also in {', '.join(rivals)}" if rivals else ""
        rows.append({"name": entry.name, "package": entry.package, "target": entry.target, "problem": problem})
    return rows


def show(
    name: Annotated[str, typer.Argument(help="Stage, detector, dataset, metric or term; or a detector file.")],
    json: options.Json = False,
) -> None:
    """Explain a plugin, or print a detector as YAML."""
    from uwbbench.cli import describe

    facts_by_kind = describe.everything_named(name)
    if json:
        render.print_json(facts_by_kind)
        return
    for kind, facts in facts_by_kind.items():
        if kind == "detector":
            typer.echo(describe.detector_yaml(facts), nl=False)
            continue
        typer.echo(f"{kind} {name}  ({facts.pop('package')}, {facts.pop('target')})\n\n{facts.pop('doc')}\n")
        params = facts.pop("params", [])
        files, more = facts.pop("files", []), facts.pop("more", [])
        render.print_facts({key: ", ".join(v) if isinstance(v, list) else v for key, v in facts.items()})
        if params:
            typer.echo()
            columns = ("name", "type", "default", "description")
            render.print_table("parameters", columns, [[row[key] for key in columns] for row in params])
        if files:
            render.print_table("files", ("path", "sha256"), [(file["path"], file["sha256"]) for file in files])
        if more:
            rows = [(folder["name"], folder["listing"]) for folder in more]
            render.print_table("more: no hash known before the first download", ("name", "listed at"), rows)


def info(capture: options.CaptureFile, json: options.Json = False) -> None:
    """Print what a capture file holds."""
    from uwbbench.cli import describe

    content = describe.capture_file(capture)
    if json:
        render.print_json(content)
        return
    label = "SIMULATED" if content["source"] == "simulated" else content["source"]
    about = {key: content[key] for key in ("name", "description", "license", "citation", "recording", "robot")}
    if about["recording"] == about["name"]:
        del about["recording"]
    render.print_facts({"capture": about.pop("name"), "source": label, **about, "radar": content["radar"]["text"]})
    texts = describe.receiver_texts(content["receivers"])
    render.print_table("receivers", list(texts[0]), [list(text.values()) for text in texts])
    truth = content["truth"]
    if truth is None:
        typer.echo("no ground truth: detectors can run on it, but it cannot be scored")
        return
    coverage = "exhaustive" if truth["exhaustive"] else "not exhaustive: unmatched detections prove nothing"
    typer.echo(f"ground truth ({coverage})")
    objects = [(t["name"], t["material"], _object_text(t)) for t in truth["objects"]]
    render.print_table("objects", ("name", "material", "kind"), objects)


def _object_text(obstacle: dict[str, Any]) -> str:
    what = "structure" if obstacle["structure"] else "obstacle"
    return f"moving {what}" if obstacle["moves"] else what


def validate(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Detector, experiment, scene, gate, tuning, training, fit."),
    ],
) -> None:
    """Check files: detectors, experiments, scenes, fits, gates. Mistakes are named with file, line and key."""
    from uwbbench.cli import describe

    wrong = False
    for path in files:
        try:
            typer.echo(f"{path}: {describe.checked_file(path)}")
        except UwbbenchError as error:
            wrong = True
            text = str(error)
            typer.echo(text if text.startswith(str(path)) else f"{path}: {text}", err=True)
    if wrong:
        raise typer.Exit(USAGE_ERROR)


def schema(
    file: Annotated[File, typer.Argument(help="Kind of file.")] = File.DETECTOR,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.json", help="Write here.", show_default=False)
    ] = None,
) -> None:
    """Print a JSON Schema of such a file, for editors."""
    from uwbbench.tools.schema import (
        detector_schema,
        experiment_schema,
        fit_schema,
        gate_schema,
        robot_schema,
        scene_schema,
        training_schema,
        tuning_schema,
    )

    makers = {
        File.DETECTOR: detector_schema,
        File.EXPERIMENT: experiment_schema,
        File.SCENE: scene_schema,
        File.GATE: gate_schema,
        File.TUNING: tuning_schema,
        File.TRAINING: training_schema,
        File.FIT: fit_schema,
        File.ROBOT: robot_schema,
    }
    document = makers[file]()
    if output is None:
        render.print_json(document)
        return
    options.format_of(output, ".json")
    from uwbbench.run.folder.files import write_json

    write_json(output, document)
    typer.echo(f"{file.value} schema written to {output}")


def version(json: options.Json = False) -> None:
    """Print versions. Results depend on all of them."""
    import platform
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    versions = {"uwbbench": uwbbench.__version__, "python": platform.python_version(), "platform": platform.platform()}
    for name in ("numpy", "scipy", "scikit-learn", "pandas", "h5py", "pyarrow"):
        try:
            versions[name] = installed(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    if json:
        render.print_json(versions)
    else:
        for name, text in versions.items():
            typer.echo(f"{name} {text}")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    app.command("list", epilog="Example: uwbbench list stages")(list_names)
    app.command(epilog="Example: uwbbench show filter.prominence")(show)
    app.command(epilog="Example: uwbbench info run.h5")(info)
    app.command(epilog="Example: uwbbench validate mine.yaml")(validate)
    app.command(epilog="Example: uwbbench schema detector -o detector.schema.json")(schema)
    app.command(epilog="Example: uwbbench version --json")(version)
