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

FEW = 20
"""Fewer seeds than these have no such percentiles: least and largest stand for them."""


class Case(NamedTuple):
    """One arrangement of an experiment: `trial` makes the run of a seed; `seeds` is how many there are."""

    name: str
    trial: Callable[[int], Trial]
    seeds: int


class Claim(NamedTuple):
    """A number that a paper prints, where it prints it, and which figure of which case stands beside it.

    `published` is None where the paper describes an experiment without printing what came out. `bound` says that it
    gives a limit that nothing exceeded, not a value; `one_piece` that the one piece tested kept it, which tells of all
    pieces no more than that some do. `sets` says that the arrangement was set so that this number comes out: it then
    tells nothing. `because` is the physical reason why the printed number cannot come from the paper's own description,
    empty where it can.

    `best` is the case with our default solution, under the same figure, `tuned` that with one that was told of the
    bench, and `target` what a flawless sensor would show.
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
    tuned: str = ""
    sets: bool = False
    one_piece: bool = False


class Experiment(NamedTuple):
    """What a paper did: `fmus` that it takes, `cases` made of those in a folder, `claims`, and the paper's picture.

    `ours` tells in a sentence or two what our default solution is here, and what the tuned one was told.
    """

    name: str
    paper: Paper
    title: str
    fmus: tuple[str, ...]
    cases: Callable[[Path], tuple[Case, ...]]
    claims: tuple[Claim, ...]
    draw: Callable[[Figure, Cases], None]
    ours: str = ""


Verdict = Literal["inside", "set", "outside", "explained", "not printed"]


class Ours(NamedTuple):
    """Our solution's figure, median over the seeds, and how many times nearer to the target it is than theirs.

    The gain is the ratio of the medians of the distances; None where ours is on the target.
    """

    median: float
    gain: float | None


class Finding(NamedTuple):
    """A claim beside our figures: the band over the seeds, the verdict, and our default and our tuned solution.

    `kept` is the share of seeds that keep a limit; None where the claim is none.
    """

    claim: Claim
    low: float
    median: float
    high: float
    verdict: Verdict
    best: Ours | None
    tuned: Ours | None
    kept: float | None


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


def band(values: Sequence[float]) -> tuple[float, float, float]:
    """The percentiles of `BAND`; of fewer than `FEW` seeds least, median and largest."""
    low, median, high = np.percentile(values, BAND if len(values) >= FEW else (0.0, 50.0, 100.0))
    return float(low), float(median), float(high)


def _finding(claim: Claim, cases: Cases) -> Finding:
    values = _values(cases[claim.case], claim.figure)
    low, median, high = band(values)
    best, tuned = (_ours(claim, values, cases[case]) if case else None for case in (claim.best, claim.tuned))
    return Finding(claim, low, median, high, _verdict(claim, low, high), best, tuned, _kept(claim, values))


def _kept(claim: Claim, values: Sequence[float]) -> float | None:
    if claim.published is None or not claim.bound:
        return None
    return float(np.mean(np.asarray(values) <= claim.published))


def _ours(claim: Claim, theirs: Sequence[float], trials: Sequence[Figures]) -> Ours:
    values = _values(trials, claim.figure)
    their_distance, our_distance = (float(np.median(np.abs(np.subtract(x, claim.target)))) for x in (theirs, values))
    return Ours(float(np.median(values)), their_distance / our_distance if our_distance > 0.0 else None)


def _verdict(claim: Claim, low: float, high: float) -> Verdict:
    if claim.published is None:
        return "not printed"
    # a limit is kept if nineteen of twenty runs keep it; or one of them, if one piece was all that was tested
    least, most = (low if claim.one_piece else high, np.inf) if claim.bound else (low, high)
    if least <= claim.published <= most:
        return "set" if claim.sets else "inside"
    return "explained" if claim.because else "outside"


def _values(trials: Sequence[Figures], figure: str) -> list[float]:
    return [float(figures[figure]) for figures in trials]
