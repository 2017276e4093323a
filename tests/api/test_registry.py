"""The registry: names without imports, and one bad plugin that spoils nothing else."""

import json
import subprocess
import sys

import pytest

from uwbbench.api import PluginError, Stage, registry

STAGE = "from uwbbench.api import Stage\n\nclass Mine(Stage):\n    '''A stage.'''\n"


def test_built_in_plugins_are_registered_like_any_other():
    assert registry.entry("datasets", "approach").package.startswith("uwbbench ")
    assert list(registry.entries("stages")) == sorted(registry.entries("stages"))


def test_listing_names_imports_no_plugin_and_no_numpy():
    script = (
        "import json, sys\n"
        "from uwbbench.api import registry\n"
        "names = {kind: list(registry.entries(kind)) for kind in registry.KINDS}\n"
        "heavy = ('numpy', 'scipy', 'pandas', 'sklearn', 'h5py', 'uwbbench_detectors', 'uwbbench_datasets')\n"
        "print(json.dumps([names, [name for name in heavy if name in sys.modules]]))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    names, imported = json.loads(done.stdout)
    assert "peaks" in names["stages"]
    assert "approach" in names["datasets"]
    assert "f1" in names["metrics"]
    assert imported == []


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        ("stages", "peeks", r"no stage named 'peeks' is installed\. Did you mean 'peaks'\?"),
        ("datasets", "pulson440-trail", r"no dataset named .* Did you mean 'pulson440-rail'\?"),
        ("metrics", "qqqq", r"no metric named 'qqqq' is installed\. Known: ate, ate_median, "),
    ],
)
def test_an_unknown_name_suggests_the_nearest(kind, name, message):
    with pytest.raises(PluginError, match=message):
        registry.load_plugin(kind, name)


def test_a_plugin_of_another_package_is_found_and_loaded(install_plugin):
    install_plugin("other", {"stages": {"other.mine": "other_mod:Mine"}}, {"other_mod.py": STAGE})
    assert registry.entry("stages", "other.mine").package == "other 1.0"
    assert issubclass(registry.load_plugin("stages", "other.mine"), Stage)


def test_a_name_of_two_packages_is_an_error_that_names_both(install_plugin):
    for name in ("first", "second"):
        install_plugin(name, {"stages": {"twice": f"{name}_mod:Mine"}}, {f"{name}_mod.py": STAGE})
    with pytest.raises(PluginError, match=r"'twice' is registered by several packages") as caught:
        registry.load_plugin("stages", "twice")
    assert "first 1.0" in str(caught.value)
    assert "second 1.0" in str(caught.value)
    assert registry.entry("stages", "peaks")


def test_a_name_taken_from_the_project_is_an_error_that_names_both(install_plugin):
    install_plugin("thief", {"datasets": {"approach": "thief_mod:Mine"}}, {"thief_mod.py": STAGE})
    with pytest.raises(PluginError, match=r"several packages \(.*(thief 1\.0.*uwbbench|uwbbench.*thief 1\.0)"):
        registry.load_plugin("datasets", "approach")


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import a_library_that_is_missing", "ModuleNotFoundError: No module named 'a_library_that_is_missing'"),
        ("1 / 0", "ZeroDivisionError"),
        ("class Mine(", "SyntaxError"),
        ("Other = 1", "AttributeError"),
        ("Mine = 5", "is not a class"),
    ],
)
def test_a_broken_plugin_is_listed_fails_with_its_cause_and_hides_no_other(install_plugin, source, message):
    install_plugin("broken", {"stages": {"broken.stage": "broken_mod:Mine"}}, {"broken_mod.py": source})
    assert "broken.stage" in registry.entries("stages")
    with pytest.raises(PluginError, match=rf"stage 'broken\.stage' of broken 1\.0.*{message}"):
        registry.load_plugin("stages", "broken.stage")
    assert registry.load_plugin("datasets", "approach").card.title


def test_a_detector_file_is_found_inside_its_package(install_plugin):
    folder = install_plugin(
        "pack",
        {"detectors": {"packed": "pack.detectors:mine.yaml"}},
        {"pack/__init__.py": "", "pack/detectors/__init__.py": "", "pack/detectors/mine.yaml": "schema: 1\n"},
    )
    assert registry.detector_file("packed") == folder / "pack" / "detectors" / "mine.yaml"


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("pack:none.yaml", "no file none.yaml in package pack"),
        ("pack.nowhere:mine.yaml", "no file mine.yaml in package pack.nowhere"),
        ("nowhere_at_all.deep:mine.yaml", "no package nowhere_at_all.deep"),
        ("bad.deep:mine.yaml", "no package bad.deep .*division"),
    ],
)
def test_a_detector_whose_file_is_missing_is_named_with_its_package(install_plugin, target, message):
    files = {"pack/__init__.py": "", "bad/__init__.py": "1 / 0\n"}
    install_plugin("pack", {"detectors": {"packed": target}}, files)
    with pytest.raises(PluginError, match=rf"detector 'packed' of pack 1\.0: {message}"):
        registry.detector_file("packed")
