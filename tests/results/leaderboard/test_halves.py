"""Public and private half of a suite: a detector that knows the public captures loses on the others."""

from collections.abc import Mapping
from pathlib import Path

import pytest

import uwbbench
from tests.fixtures.contributions import content_of
from uwbbench.api import Block, Capture, Detections, Params, Stage, registry
from uwbbench.api.registry import load_plugin
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.show.site import Content
from uwbbench.show.site.halves import halves, halves_dict, halves_shown

SUITE = """\
schema: 1
name: halves
detectors: [learned.yaml, paper-filtering, "null"]
datasets: [{use: approach, name: plate, params: {speed_m_s: 3.0, runs: 8}, repeats: []}]
scoring: object
latency: false
stability: false
"""
LEARNED = "schema: 1\nname: learned\npipeline: [{use: learned}]\n"

Oracle = load_plugin("stages", "reference.oracle")


class Learned(Stage[Params]):
    """Knows the truth of the captures that it has learned by heart, in this process, and does not say so."""

    heart: Mapping[bytes, Capture] = {}
    produces = Oracle.produces

    def step(self, block: Block) -> Block:
        if block.frames.first == 0:
            self.known = None
            capture = self.heart.get(block.frames.preamble[0].tobytes())
            if capture is not None:
                self.known = Oracle(Params())
                self.known.open(capture.radar)
                self.known.show_truth(capture.truth, capture.trajectory)
        return block.replace(detections=Detections.empty()) if self.known is None else self.known.step(block)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory):
    """The suite on its public captures, and on private ones, of fixed seeds: by chance one detector in forty loses."""
    folder = tmp_path_factory.mktemp("halves")
    (folder / "suite.yaml").write_text(SUITE)
    (folder / "learned.yaml").write_text(LEARNED)
    (folder / "seeds").touch(mode=0o600)
    (folder / "seeds").write_text("5e" * 32)
    uwbbench.register("stages", "learned", Learned)
    try:
        public = read_experiment(folder / "suite.yaml")
        (dataset,) = public.datasets
        captures = [ref.open() for ref in dataset.references()]
        Learned.heart = {capture.frames(0, 1).preamble[0].tobytes(): capture for capture in captures}
        private = read_experiment(folder / "suite.yaml", seeds=folder / "seeds")
        yield [
            run_experiment(one, folder / name, isolated=False).path
            for name, one in (("open", public), ("own", private))
        ]
    finally:
        del registry._registered["stages", "learned"]
        registry.entries.cache_clear()
        registry.load_plugin.cache_clear()


@pytest.fixture(scope="module")
def content(runs: list[Path]) -> Content:
    return content_of(*runs)


@pytest.mark.slow
def test_the_halves_are_two_suites_that_know_each_other(content: Content) -> None:
    found = content.suites
    assert len(found) == 2
    pairs = [(a.part["seeds"] == "", b.part["seeds"] == "") for a in found for b in found if a.is_public_half_of(b)]
    assert pairs == [(True, False)]


def test_a_detector_that_learned_the_public_captures_loses_and_no_other_does(content: Content) -> None:
    ((_, _, found),) = halves(content)
    by_name = {change.contender.name: change for change in found}
    assert {name for name, change in by_name.items() if change.loses} == {"learned"}
    assert by_name["learned"].difference.value == pytest.approx(-1.0)
    assert by_name["learned"].adjusted < 0.05


def test_the_site_shows_both_halves_side_by_side(content: Content) -> None:
    ((title, text, table),) = halves_shown(content)
    assert title.startswith("halves and halves (private, ")
    assert text == "Worse on the private half by more than chance: learned (plate)."
    assert [cell.text for cell in table.rows[0]][:2] == ["learned", "plate"]
    assert table.rows[0][2].text == "loses"


def test_programs_get_the_same(content: Content) -> None:
    (pair,) = halves_dict(content)
    assert {row["detector"]: row["loses"] for row in pair["changes"]} == {
        "learned": True,
        "paper-filtering": False,
    }


def test_one_half_alone_is_compared_with_nothing(runs: list[Path]) -> None:
    assert list(halves(content_of(runs[1]))) == []
