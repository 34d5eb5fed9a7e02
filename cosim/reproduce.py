"""The command ``attitude-fmu reproduce``: the papers' experiments run again, as tables and pictures."""

from __future__ import annotations

import csv
import importlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from attitude_fmu.fmu_src.build_messages import build_and_tell

from .errors import RunStoppedError
from .experiment import Claim, Experiment, Finding, Paper, by_case, findings, trials_of
from .monte_carlo import Figures, run_trials
from .workspace import whole_or_not

Papers = Literal["paper-a", "paper-b", "all"]

_TRIALS = "trials"
_COLUMNS = ("experiment", "what", "unit", "source", "published", "median", "5 %", "95 %", "verdict", "best", "because")
_COLOURS = {"inside": "green", "explained": "yellow", "outside": "red", "not printed": "dim"}
_MODULES: dict[Paper, str] = {"paper-a": ".paper_a", "paper-b": ".paper_b"}


def experiments(papers: Papers) -> tuple[Experiment, ...]:
    """The experiments of a paper, or of both."""
    chosen = _MODULES if papers == "all" else (papers,)
    modules = [importlib.import_module(_MODULES[paper], __package__) for paper in chosen]
    return tuple(one for module in modules for one in module.EXPERIMENTS)


def reproduce(papers: Papers, out: Path, dist: Path) -> dict[str, list[Finding]]:
    """Run the experiments and write their tables and pictures into `out`; gives the findings by experiment.

    Trials lie in ``out/trials`` as soon as they are done, so that an interrupted run goes on where it stopped.
    Raises `BuildError`, `RunStoppedError` or `ResultsError`.
    """
    chosen = experiments(papers)
    needed = dict.fromkeys(fmu for one in chosen for fmu in one.fmus)
    build_and_tell(dist, list(needed), Console(stderr=True), only_built=True)
    figures = _figures(chosen, out, dist)
    console = Console()
    found = {one.name: findings(one, by_case(one, figures)) for one in chosen}
    for one in chosen:
        console.print(table(one, found[one.name]))
        _tell_reasons(console, found[one.name])
        draw(one, figures, out / f"{one.name}.png")
    for paper in dict.fromkeys(one.paper for one in chosen):
        write_findings(out / f"{paper}.csv", {one.name: found[one.name] for one in chosen if one.paper == paper})
    _tell_sum(console, [finding for one in found.values() for finding in one], out)
    return found


def _figures(chosen: Sequence[Experiment], out: Path, dist: Path) -> dict[str, Figures]:
    trials = [trial for one in chosen for trial in trials_of(one, dist)]
    with _bar(len(trials)) as (bar, task):
        try:
            return run_trials(trials, out / _TRIALS, lambda done: bar.update(task, completed=done))
        except RunStoppedError as error:
            if not error.interrupted:
                raise
            message = f"stopped by the user; the same command goes on from the trials in {out / _TRIALS}"
            raise RunStoppedError(message, error.time, interrupted=True) from None


@contextmanager
def _bar(total: int) -> Iterator[tuple[Progress, object]]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    console = Console(stderr=True)
    with Progress(
        *columns,
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        yield bar, bar.add_task("trials", total=total)


# --- tables ---------------------------------------------------------------------------------------------------------


def table(experiment: Experiment, found: Sequence[Finding]) -> Table:
    """Published numbers beside ours, a row for each claim."""
    shown = Table(title=experiment.title, title_justify="left", title_style="bold")
    shown.add_column("")
    for heading in ("published", "ours", "5-95 %", "", "best", "gain"):
        shown.add_column(heading, justify="right")
    for one in found:
        claim = one.claim
        shown.add_row(
            f"{claim.what} [dim]({claim.source})[/dim]",
            _published(claim),
            _number(one.median),
            f"{_number(one.low)} .. {_number(one.high)}",
            f"[{_COLOURS[one.verdict]}]{one.verdict}[/]",
            "" if one.best is None else _number(one.best),
            "" if one.gain is None else f"{one.gain:.3g} x",
        )
    return shown


def _published(claim: Claim) -> str:
    if claim.published is None:
        return f"- {claim.unit}"
    return f"{'≤ ' if claim.bound else ''}{_number(claim.published)} {claim.unit}"


def _number(value: float) -> str:
    return f"{value:.4g}"


def _tell_reasons(console: Console, found: Sequence[Finding]) -> None:
    reasons = dict.fromkeys(one.claim.because for one in found if one.verdict != "inside" and one.claim.because)
    for reason in reasons:
        console.print(f"explained: {reason}", style="dim", highlight=False, markup=False)


def _tell_sum(console: Console, found: Sequence[Finding], out: Path) -> None:
    counts = {verdict: sum(one.verdict == verdict for one in found) for verdict in _COLOURS}
    said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    console.print(f"{len(found)} rows: {said}. Tables and pictures are in {out}.", markup=False)


def write_findings(path: Path, found: Mapping[str, Sequence[Finding]]) -> Path:
    """Write the rows of several experiments as a CSV file.

    Raises `ResultsError` if the file cannot be written.
    """
    with whole_or_not(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_COLUMNS)
        for name, rows in found.items():
            writer.writerows(_row(name, one) for one in rows)
    return path


def _row(experiment: str, one: Finding) -> tuple[object, ...]:
    claim = one.claim
    numbers = ("" if claim.published is None else claim.published, one.median, one.low, one.high, one.verdict)
    best = "" if one.best is None else one.best
    return (experiment, claim.what, claim.unit, claim.source, *numbers, best, claim.because)


# --- pictures -------------------------------------------------------------------------------------------------------


def draw(experiment: Experiment, figures: Mapping[str, Figures], path: Path) -> Path:
    """Draw an experiment's picture into a PNG file.

    Raises `ResultsError` if the file cannot be written.
    """
    import matplotlib
    from matplotlib.figure import Figure

    from .plot import STYLE

    with matplotlib.rc_context(STYLE), whole_or_not(path) as draft:
        figure = Figure(figsize=(10.0, 7.0), layout="constrained")
        experiment.draw(figure, by_case(experiment, figures))
        figure.savefig(draft, dpi=150)
    return path
