"""The command ``attitude-fmu reproduce``: the papers' experiments run again, as tables and pictures."""

from __future__ import annotations

import csv
import importlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from attitude_fmu.fmu_src.build_messages import build_and_tell

from .errors import ResultsError, RunStoppedError
from .experiment import BAND, FEW, Case, Claim, Experiment, Finding, Ours, Paper, by_case, findings, trials_of
from .monte_carlo import Figures, run_trials
from .progress import shown_progress
from .ssp import write_ssp
from .workspace import whole_or_not

_COLUMNS_MEAN = (
    f"here: the paper's own method in our simulation, median over the seeds; from, to: their {BAND[0]:g} and "
    f"{BAND[-1]:g} %, of fewer than {FEW} least and largest. default, tuned: our solution as it comes and told of the "
    "bench; gain: how many times nearer to the truth the default is. set: the arrangement was set by this number."
)

Papers = Literal["paper-a", "paper-b", "all"]

_TRIALS = "trials"
_COLUMNS = (
    *("experiment", "what", "unit", "source", "published", "median", "from", "to", "verdict", "kept"),
    *("default", "default gain", "tuned", "tuned gain", "because"),
)
_COLOURS = {"inside": "green", "set": "cyan", "explained": "yellow", "outside": "red", "not printed": "dim"}
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
        _tell_ours(console, one)
        _tell_reasons(console, found[one.name])
        draw(one, figures, out / f"{one.name}.png")
        write_systems(one, dist, out / one.name)
    for paper in dict.fromkeys(one.paper for one in chosen):
        write_findings(out / f"{paper}.csv", {one.name: found[one.name] for one in chosen if one.paper == paper})
    _tell_sum(console, [finding for one in found.values() for finding in one], out)
    return found


def _figures(chosen: Sequence[Experiment], out: Path, dist: Path) -> dict[str, Figures]:
    trials = [trial for one in chosen for trial in trials_of(one, dist)]
    with shown_progress("trials", len(trials)) as told:
        try:
            return run_trials(trials, out / _TRIALS, told)
        except RunStoppedError as error:
            if not error.interrupted:
                raise
            message = f"stopped by the user; the same command goes on from the trials in {out / _TRIALS}"
            raise RunStoppedError(message, error.time, interrupted=True) from None


# --- tables ---------------------------------------------------------------------------------------------------------


def table(experiment: Experiment, found: Sequence[Finding]) -> Table:
    """Published numbers beside ours, a row for each claim."""
    shown = Table(title=experiment.title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, padding=0)
    shown.add_column("")
    for heading in ("paper", "here", "from", "to", "", "default", "gain", "tuned"):
        shown.add_column(heading, justify="right", no_wrap=bool(heading))
    for one in found:
        claim = one.claim
        shown.add_row(
            claim.what if claim.unit == "1" else f"{claim.what}, {claim.unit}",
            _published(claim),
            _number(one.median),
            _number(one.low),
            _number(one.high),
            _verdict(one),
            _median(one.best),
            _gain(one.best),
            _median(one.tuned),
        )
    return shown


def _verdict(one: Finding) -> str:
    if one.claim.published is None:
        return ""
    kept = "" if one.kept is None else f", {one.kept:.0%} keep it"
    return f"[{_COLOURS[one.verdict]}]{one.verdict}{kept}[/]"


def _published(claim: Claim) -> str:
    if claim.published is None:
        return "-"
    return f"{'≤ ' if claim.bound else ''}{claim.published:g}"


def _number(value: float) -> str:
    return f"{value:.4g}"


def _median(ours: Ours | None) -> str:
    return "" if ours is None else _number(ours.median)


def _gain(ours: Ours | None) -> str:
    if ours is None or ours.gain is None:
        return ""
    return f"{ours.gain:.3g}x" if ours.gain < 999.5 else ">999x"


def _tell_ours(console: Console, experiment: Experiment) -> None:
    if experiment.ours:
        console.print(f"ours: {experiment.ours}", style="dim", highlight=False, markup=False)


def _tell_reasons(console: Console, found: Sequence[Finding]) -> None:
    reasons = dict.fromkeys(one.claim.because for one in found if one.verdict == "explained")
    for reason in reasons:
        console.print(f"explained: {reason}", style="dim", highlight=False, markup=False)


def _tell_sum(console: Console, found: Sequence[Finding], out: Path) -> None:
    counts = {verdict: sum(one.verdict == verdict for one in found) for verdict in _COLOURS}
    said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    console.print(_COLUMNS_MEAN, style="dim", highlight=False, markup=False)
    console.print(f"{len(found)} rows: {said}. Tables, pictures and systems (.ssp) are in {out}.", markup=False)


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
    numbers = ("" if claim.published is None else claim.published, one.median, one.low, one.high)
    verdict = (one.verdict, "" if one.kept is None else one.kept)
    ours = [x for each in (one.best, one.tuned) for x in (each or ("", ""))]
    return (experiment, claim.what, claim.unit, claim.source, *numbers, *verdict, *ours, claim.because)


# --- systems --------------------------------------------------------------------------------------------------------


def write_systems(experiment: Experiment, dist: Path, folder: Path) -> list[Path]:
    """Write every case as ``folder/case.ssp``, with the values of the first seed, for `run` and for other tools.

    Raises `ResultsError` if a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultsError(f"cannot write {folder}: {error.strerror or error}") from error
    return [_write_system(experiment, case, dist, folder) for case in experiment.cases(dist)]


def _write_system(experiment: Experiment, case: Case, dist: Path, folder: Path) -> Path:
    trial = case.trial(1)
    told = f"{experiment.title}; case {case.name}, seed 1; --step {trial.step:g} --master {trial.order}"
    system = replace(trial.system, name=f"{experiment.name}-{case.name}", stop_time=trial.stop_time, description=told)
    return write_ssp(system, folder / f"{case.name}.ssp")


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
