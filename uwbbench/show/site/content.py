"""What the pages of a site say: rows of cells, sentences and charts, made of suites and rankings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from uwbbench.measure.accuracy.evidence import least_units
from uwbbench.results.leaderboard.ranking import Ranking, Standing, rankings, reference_of
from uwbbench.results.leaderboard.runs import Run
from uwbbench.results.leaderboard.suites import Contender, Suite
from uwbbench.results.results import errors_in
from uwbbench.results.times import WORDS as TIMED
from uwbbench.results.verdicts import BOUNDS, RUN_INTERVALS, WITHIN, WORDS, listed
from uwbbench.run.folder.identity import digest
from uwbbench.show.html.cell import Cell, Table
from uwbbench.show.looks import Look, looks
from uwbbench.show.site import charts
from uwbbench.show.site.cells import metric_cell, pair_cell, pair_text, quantity, rank_cell, speed_cell
from uwbbench.show.site.error_pictures import error_pictures
from uwbbench.show.site.halves import halves_dict
from uwbbench.show.site.names import Names
from uwbbench.show.text.numbers import p_value
from uwbbench.show.text.quantity import undefined_titles
from uwbbench.show.text.sheet import sentence, shown
from uwbbench.show.text.wording import table_name


@dataclass(frozen=True)
class Section:
    """A dataset of a suite, as the index and its own page show it.

    Attributes
    ----------
    suite : Suite
    dataset, source : str
    label, address : str
    rankings : tuple of Ranking
        The first is the one that the index shows.
    """

    suite: Suite
    dataset: str
    source: str
    label: str
    address: str
    rankings: tuple[Ranking, ...] = field(repr=False)

    @property
    def main(self) -> Ranking:
        """The first board."""
        return self.rankings[0]

    @property
    def title(self) -> str:
        """Name with what the captures are; simulated ones always say so."""
        return f"{self.label}, {'SIMULATED' if self.source == 'simulated' else 'measured'}"


class Content:
    """All that a site shows.

    Parameters
    ----------
    suites : sequence of Suite
    runs : sequence of Run
        The oldest first.
    """

    def __init__(self, suites: Sequence[Suite], runs: Sequence[Run]) -> None:
        self.suites, self.runs = suites, runs
        self.names = Names(suites)

    @cached_property
    def sections(self) -> list[Section]:
        """Every dataset of every suite that anything could be scored on."""
        sections = []
        for suite in self.suites:
            boards: dict[tuple[str, str], list[Ranking]] = {}
            for ranking in rankings(suite):
                boards.setdefault(ranking.board[:2], []).append(ranking)
            for (dataset, source), of_dataset in boards.items():
                address = self.names.dataset_page(suite, dataset)
                sections.append(Section(suite, dataset, source, shown(dataset), address, tuple(of_dataset)))
        return sections

    @cached_property
    def labels(self) -> dict[str, str]:
        """Label of each contender by its key, in the order of their looks: as the runs list them, the oldest first."""
        there = {one.key: self.names.detectors[one.key] for suite in self.suites for one in suite.contenders}
        listed = [
            digest([config["name"], run.manifest["detectors"].get(config["name"])])
            for run in self.runs
            for config in run.experiment["detectors"]
        ]
        return {key: there[key] for key in dict.fromkeys([*listed, *there]) if key in there}

    @cached_property
    def looks(self) -> dict[str, Look]:
        """Look of each detector by its label."""
        return looks(self.labels.values())

    def of_suite(self, suite: Suite) -> list[Section]:
        """Datasets of one suite."""
        return [section for section in self.sections if section.suite is suite]

    # Boards ----------------------------------------------------------------------------------------------------

    def board(self, ranking: Ranking, *, headline: bool = False) -> Table:
        """Leaderboard of one board, with all metrics or the headline ones."""
        _, _, scoring, table = ranking.board
        names = ranking.headline if headline else ranking.metrics.defined(exhaustive=ranking.exhaustive)
        names = sorted(names, key=lambda name: name != ranking.main)  # the one that ranks stands first, then the time
        quantities = {name: quantity(ranking, name) for name in names}
        heads = [one.axis for one in quantities.values()]
        columns = (
            "detector",
            "rank",
            heads[0],
            "time ratio",
            "against the first",
            *heads[1:],
            "captures",
            "frames (n)",
            "errors (n)",
        )
        leader = ranking.standings[0]
        rows = []
        for one in ranking.standings:
            rank = rank_cell(one)
            first, *others = [metric_cell(by, one.estimates[name]) for name, by in quantities.items()]
            cells = [
                self.detector_cell(one),
                rank,
                first,
                speed_cell(one),
                self._against(ranking, leader, one),
                *others,
            ]
            cells.append(Cell(f"{len(one.scored)} of {ranking.captures}", key=str(len(one.scored))))
            frames = sum(len(part.outcome.group) for part in one.scored)
            errors = errors_in(part.outcome for part in one.scored)
            rows.append((*cells, Cell(str(frames)), Cell(str(errors))))
        title = f"{scoring} scoring, {table_name(scoring, table)}"
        return Table(title, columns, tuple(rows), tuple(self._board_notes(ranking)))

    def detector_cell(self, standing: Standing) -> Cell:
        """Name of a detector with a link to its page."""
        return self.cell_of(standing.contender)

    def cell_of(self, contender: Contender) -> Cell:
        """Name of a detector with its mark and a link to its page."""
        label = self.labels[contender.key]
        title = f"{shown(contender.name)}, identity {contender.identity[:12]}"
        return Cell(label, title=title, link=self.names.detector_page(contender), look=self.looks[label])

    def _against(self, ranking: Ranking, leader: Standing, standing: Standing) -> Cell:
        if standing is leader:
            return Cell("first", key="-1")
        if standing.contender.bound:
            return Cell("bound", key="n/a")
        pair = ranking.pair(standing.contender.key, leader.contender.key, ranking.main)
        if pair is None:
            return Cell("n/a")
        word = {"differs": "worse" if pair.better == pair.second else "better", "equal": "equal"}.get(pair.verdict)
        difference = pair_text(ranking, pair)
        return Cell(word or WORDS[pair.verdict], small=difference, title=f"adjusted p {p_value(pair.adjusted)}")

    @staticmethod
    def _board_notes(ranking: Ranking) -> Iterator[str]:
        if not ranking.exhaustive:
            yield (
                f"The truth does not name all that is visible: {undefined_titles(ranking.metrics)} are undefined, "
                f"errors are of matches, and the rank is by {quantity(ranking, ranking.main).title}."
            )
        elif ranking.metrics.listed:
            yield f"The rank is by {quantity(ranking, ranking.main).title}."
        yield from ranking.metrics.notes
        if ranking.ranks.bounds:
            yield BOUNDS
        if ranking.ranks.unit == "run":
            yield RUN_INTERVALS
        if not ranking.ranks.sets:
            there = "is 1" if ranking.ranks.scenes == 1 else f"are {ranking.ranks.scenes}"
            least = least_units(ranking.metrics[ranking.main])
            yield f"No ranks: {least} {ranking.ranks.unit}s are needed, and there {there}."
            if any(one.estimates[ranking.main].within for one in ranking.standings):
                yield f"Intervals: {WITHIN}."
        elif any(one.ranks is None and not one.contender.bound for one in ranking.standings):
            yield "– : no rank, as the detector was not scored on all captures of this board; its numbers are of fewer."

    def sentence(self, section: Section) -> str:
        """Who comes first, whether it leads, and who is as good."""
        ranking = section.main
        first, others = ranking.standings[0], ranking.standings[1:]
        by = quantity(ranking, ranking.main)
        names = self.names.detectors
        figures = f"{by.title} {by.value_of(first.estimates[ranking.main])} ({ranking.board[2]} scoring)"
        text = ranking.ranks.opening(names, figures)
        words: dict[str, list[str]] = {}
        for one in others:
            pair = ranking.pair(first.contender.key, one.contender.key, ranking.main)
            if pair is not None:
                words.setdefault(pair.verdict, []).append(names[one.contender.key])
        for verdict, said in (
            ("equal", "practically equal to it: {}"),
            ("not told apart", "not told apart from it: {}"),
            ("differs", "significantly different from it: {}"),
            ("undefined", "nothing to compare it with: {}"),
        ):
            if verdict in words:
                text += "; " + said.format(listed(words[verdict]))
        return text + "."

    # Charts ----------------------------------------------------------------------------------------------------

    def pareto(self, section: Section, metric: str) -> tuple[str, str] | None:
        """Chart of speed against a metric on the first board, with what it says in words."""
        spec = charts.pareto(section.main, metric, section.title, self.labels)
        return None if spec is None else (charts.svg(spec), _described(spec))

    def errors(self, section: Section) -> tuple[str, str] | None:
        """Chart of the errors on the first board."""
        spec = charts.errors(section.main, section.title, self.labels)
        return None if spec is None else (charts.svg(spec), _described(spec))

    def causes_and_curves(self, section: Section) -> tuple[tuple[str, str], ...]:
        """Charts of where errors come from, and of detectors without their thresholds."""
        drawn = error_pictures(section.main, section.title, self.labels)
        return tuple((charts.svg(spec), _described(spec)) for spec in drawn)

    def pairs(self, ranking: Ranking) -> Table:
        """All comparisons of a board."""
        rows = []
        for pair in ranking.pairs:
            by = quantity(ranking, pair.metric)
            names = [Cell(self.names.detectors[key]) for key in (pair.first, pair.second)]
            counts = [Cell(str(pair.captures)), Cell(str(pair.difference.groups))]
            verdict = Cell(WORDS[pair.verdict])
            rows.append(
                (*names, Cell(by.title), pair_cell(ranking, pair), Cell(p_value(pair.adjusted)), verdict, *counts)
            )
        columns = (
            "first",
            "second",
            "metric",
            "difference",
            "adjusted p",
            "verdict",
            "captures",
            f"{ranking.ranks.unit}s (n)",
        )
        return Table("Compared in pairs", columns, tuple(rows))

    def suite_facts(self, suite: Suite) -> list[tuple[str, str]]:
        """What a version of a suite is made of."""
        reference = reference_of(suite)
        rules = suite.newest.rules
        machines = dict.fromkeys(machine for run in suite.runs for machine in run.machines)
        return [
            (
                "version",
                f"{suite.version[:12]}, of the content of {len(suite.captures)} captures and the scoring rules",
            ),
            *self._frozen_facts(suite),
            ("scoring", f"{', '.join(rule.scoring for rule in rules)}; gate {100 * rules[0].gate_m:g} cm"),
            ("runs", ", ".join(shown(run.name) for run in suite.runs)),
            ("machines", "; ".join(sentence(machine) for machine in machines)),
            ("reference of times", "none" if reference is None else f"{shown(reference[0])}, {TIMED[reference[2]]}"),
        ]

    @staticmethod
    def _frozen_facts(suite: Suite) -> Iterator[tuple[str, str]]:
        """Which part of a frozen suite it is."""
        part = suite.part
        if part["version"]:
            yield "frozen as", f"{part['version'][:12]}; every capture was checked against it"
        if part["quick"]:
            yield "quick", "some of the captures only; not to be compared with the whole suite"
        if part["seeds"]:
            yield "private half", f"secret seeds {part['seeds'][:12]}; nobody could tune to these captures"

    def to_dict(self) -> dict[str, Any]:
        """Everything for programs; undefined numbers are NaN, which the store writes as null."""
        return {
            "generator": "uwbbench leaderboard",
            "halves": halves_dict(self),
            "suites": [
                {
                    "name": suite.name,
                    "version": suite.version,
                    "part": dict(suite.part),
                    "runs": [run.name for run in suite.runs],
                    "captures": [
                        {"dataset": dataset, "capture": capture, "sha256": content}
                        for (dataset, capture), content in suite.captures.items()
                    ],
                    "boards": [_board_dict(one) for section in self.of_suite(suite) for one in section.rankings],
                }
                for suite in self.suites
            ],
        }


def _board_dict(ranking: Ranking) -> dict[str, Any]:
    dataset, source, scoring, table = ranking.board
    who = {
        one.contender.key: {"detector": one.contender.name, "identity": one.contender.identity}
        for one in ranking.standings
    }
    return {
        "dataset": dataset,
        "source": source,
        "scoring": scoring,
        "table": table,
        "ranked_by": ranking.main,
        "captures": ranking.captures,
        "scenes": ranking.ranks.scenes,
        "standings": [
            {
                **who[one.contender.key],
                "bound": one.contender.bound,
                "rank": None if one.ranks is None else one.ranks[0],
                "rank_high": None if one.ranks is None else one.ranks[1],
                "captures": len(one.scored),
                "runs": [run.name for run in one.contender.runs],
                "estimates": {name: vars(estimate) for name, estimate in one.estimates.items()},
                "time_ratio": None
                if one.speed is None
                else {key: getattr(one.speed, key) for key in ("reference", "ratio", "low", "high")},
            }
            for one in ranking.standings
        ],
        "pairs": [
            {
                "first": who[pair.first],
                "second": who[pair.second],
                "metric": pair.metric,
                "captures": pair.captures,
                "difference": pair.difference.value,
                "low": pair.difference.low,
                "high": pair.difference.high,
                "p_adjusted": pair.adjusted,
                "verdict": pair.verdict,
            }
            for pair in ranking.pairs
        ],
    }


def _described(spec: Mapping[str, Any]) -> str:
    return f"{spec['title']['text']}. {spec['title'].get('subtitle', '')}"
