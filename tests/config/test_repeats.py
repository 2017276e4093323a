"""Which captures repeat a scene: as the dataset says, or as a file says of it."""

import pytest

from uwbbench.api import CaptureError
from uwbbench.config.datasets import DatasetSource, DatasetUse
from uwbbench.config.source import open_dataset

NAMES = ["lab-run1", "lab-run2", "hall-run1", "yard"]


def source(repeats):
    return DatasetSource("mine", "approach", {"runs": 3}, repeats=repeats)


def test_a_pattern_is_the_part_of_names_by_which_repeats_differ():
    expected = {"lab-run1": "lab", "lab-run2": "lab", "hall-run1": "hall", "yard": "yard"}
    assert source("-run[0-9]+$").scenes(NAMES) == expected


def test_lists_name_captures_that_repeat_one_another():
    found = source((("lab-*",), ("yard", "hall-run1"))).scenes(NAMES)
    assert found == {"lab-run1": "lab-run1", "lab-run2": "lab-run1", "hall-run1": "hall-run1", "yard": "hall-run1"}


def test_an_empty_list_makes_each_capture_a_scene_of_its_own():
    assert source(()).scenes(NAMES) == {name: name for name in NAMES}


@pytest.mark.parametrize(
    ("repeats", "says"),
    [("-take[0-9]", r"'mine': 'repeats: -take\[0-9\]' fits no"), ((("lab-run3",),), r"no capture 'lab-run3'.*lab-run")],
)
def test_what_fits_no_capture_is_refused(repeats, says):
    with pytest.raises(CaptureError, match=says):
        source(repeats).scenes(NAMES)


def test_a_broken_pattern_is_refused():
    with pytest.raises(ValueError, match="no regular expression"):
        DatasetUse(use="approach", repeats="run(")


def test_runs_of_the_built_in_approach_are_one_scene():
    dataset = open_dataset("approach", {"runs": 3}, [])
    assert {dataset.scene(name) for name in dataset.names()} == {"approach-ch9-metal"}


def test_runs_and_receivers_of_a_simulated_scene_are_one_scene_and_variants_are_not():
    dataset = open_dataset("simulated", {"scenes": ["two-plates"], "runs": 2}, [])
    assert len(dataset.names()) == 4 * len({dataset.scene(name) for name in dataset.names()})
    assert len({dataset.scene(name) for name in dataset.names()}) == 10


def test_a_file_without_repeats_is_stored_as_before():
    assert source(None).to_dict() == {"label": "mine", "use": "approach", "params": {"runs": 3}, "captures": None}
    assert source("-[0-9]$").to_dict()["repeats"] == "-[0-9]$"
