"""Published experiments: what a paper printed, beside what the same experiment gives in our simulation over many seeds.

An experiment is data: cases (each a coupled system for every seed), claims (each a printed number and the figure of a
case that stands beside it), and a picture. `findings` turns the figures of all trials into rows of a table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from .monte_carlo import Figures, Trial

# matplotlib is imported where a picture is made
if TYPE_CHECKING:
    from matplotlib.figure import Figure

Paper = Literal["paper-a", "paper-b"]
Cases = Mapping[str, Sequence[Figures]]
"""The figures of every trial, in the order of the seeds, by the name of the case."""

BAND = (5.0, 50.0, 95.0)
"""Percentiles over the seeds: a published number counts as ours between the first and the last."""


class Case(NamedTuple):
    """One arrangement of an experiment: `trial` makes the run of a seed; `seeds` is how many there are."""

    name: str
    trial: Callable[[int], Trial]
    seeds: int


class Claim(NamedTuple):
    """A number that a paper prints, where it prints it, and which figure of which case stands beside it.

    `published` is None where the paper describes an experiment without printing what came out. `bound` says that it
    gives a limit that nothing exceeded, not a value. `best` is the case with our best filter and solver, under the
    same figure, and `target` what a flawless sensor would show. `because` is the physical reason why the printed
    number cannot come from the paper's own description, empty where it can.
    """

    what: str
    published: float | None
    unit: str
    source: str
    case: str
    figure: str
    bound: bool = False
    best: str = ""
    because: str = ""
    target: float = 0.0


class Experiment(NamedTuple):
    """What a paper did: `fmus` that it takes, `cases` made of those in a folder, `claims`, and the paper's picture."""

    name: str
    paper: Paper
    title: str
    fmus: tuple[str, ...]
    cases: Callable[[Path], tuple[Case, ...]]
    claims: tuple[Claim, ...]
    draw: Callable[[Figure, Cases], None]


Verdict = Literal["inside", "outside", "explained", "not printed"]


class Finding(NamedTuple):
    """A claim beside our figures: the percentiles of `BAND`, the verdict, and the median of our best solution."""

    claim: Claim
    low: float
    median: float
    high: float
    verdict: Verdict
    best: float | None

    @property
    def gain(self) -> float | None:
        """How many times nearer to the target our best solution's figure is than that of the paper's own method."""
        if self.best is None or self.best == self.claim.target:
            return None
        return abs(self.median - self.claim.target) / abs(self.best - self.claim.target)


def trials_of(experiment: Experiment, dist: Path) -> list[Trial]:
    """Every trial of an experiment, named ``experiment/case/seed``."""
    return [
        case.trial(seed)._replace(name=f"{experiment.name}/{case.name}/{seed}")
        for case in experiment.cases(dist)
        for seed in range(1, case.seeds + 1)
    ]


def by_case(experiment: Experiment, figures: Mapping[str, Figures]) -> dict[str, list[Figures]]:
    """The figures of an experiment's trials by case, in the order of the trials."""
    cases: dict[str, list[Figures]] = {}
    for name, values in figures.items():
        owner, _, rest = name.partition("/")
        if owner == experiment.name:
            cases.setdefault(rest.rpartition("/")[0], []).append(values)
    return cases


def findings(experiment: Experiment, cases: Cases) -> list[Finding]:
    """Each claim of an experiment beside the distribution of our figure over the seeds."""
    return [_finding(claim, cases) for claim in experiment.claims]


def _finding(claim: Claim, cases: Cases) -> Finding:
    low, median, high = np.percentile(_values(cases[claim.case], claim.figure), BAND)
    best = float(np.median(_values(cases[claim.best], claim.figure))) if claim.best else None
    return Finding(claim, float(low), float(median), float(high), _verdict(claim, float(low), float(high)), best)


def _verdict(claim: Claim, low: float, high: float) -> Verdict:
    if claim.published is None:
        return "not printed"
    # a limit is kept if nineteen of twenty runs keep it
    inside = high <= claim.published if claim.bound else low <= claim.published <= high
    return "inside" if inside else "explained" if claim.because else "outside"


def _values(trials: Sequence[Figures], figure: str) -> list[float]:
    return [float(figures[figure]) for figures in trials]
