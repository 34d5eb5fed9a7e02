"""The figures of `attitude-fmu design`: jitter predicted and co-simulated, margins, and what makes the jitter."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from .recording import Results
from .report import EXPOSURE, Jitter
from .workspace import whole_or_not

CAUSES = ("wind", "friction", "gyro noise", "accelerometer noise", "rounding")


class Run(NamedTuple):
    """A co-simulation: which sensor and controller, its results, its jitter and that one's standard error (rad)."""

    label: str
    kind: str
    results: Results
    jitter: Jitter
    error: float
    since: float


_NAMES = ("sensor", "controller")
_JITTER = ("co-simulated (urad)", "predicted (urad)", "held / this")
_MARGINS = ("disk margin", "least phase margin (deg)", "least gain margin (dB)")
_MORE = ("standard error (urad)", "predicted / co-simulated", "crossover of pitch (Hz)", "states")
_MADE = ("before reduction (urad)", "largest pole of the controller")
_OF_CAUSES = tuple(f"{cause} (urad)" for cause in CAUSES)
_COLUMNS = (*_NAMES, *_JITTER, *_MARGINS, *_MORE, *_MADE, *_OF_CAUSES)
_HEADS = {
    "controller": "control",
    "co-simulated (urad)": "co-simu-\nlated",
    "predicted (urad)": "pre-\ndicted",
    "held / this": "times\nless",
    "disk margin": "disk\nmargin",
    "least phase margin (deg)": "phase\n(°)",
    "least gain margin (dB)": "gain\n(dB)",
    "accelerometer noise (urad)": "accel.\nnoise",
    "gyro noise (urad)": "gyro\nnoise",
}
"""Of the printed tables, where they differ from the written one's."""


def rows_of(designs: list[Any], runs: list[Run]) -> list[dict[str, str]]:
    """The table: jitter of the line of sight within exposures, predicted and co-simulated, and what makes it."""
    found = {(run.label, run.kind): run for run in runs}
    held = runs[0]
    rows = [{"sensor": "joints held", "controller": "held", **_jitters(designs[0].held, held, held)}]
    for design in designs:
        for one in design.controllers:
            gains = [min(margin.gain_up, _inverse(margin.gain_down)) for margin in one.margins]
            rows.append(
                {
                    "sensor": design.sensor.label,
                    "controller": one.kind,
                    **_jitters(one.jitter, found[design.sensor.label, one.kind], held),
                    "disk margin": f"{one.disk.min():.2f}",
                    "least phase margin (deg)": f"{np.degrees(min(margin.phase for margin in one.margins)):.0f}",
                    "least gain margin (dB)": f"{20.0 * np.log10(min(gains)):.1f}",
                    "crossover of pitch (Hz)": f"{one.margins[1].crossover:.1f}",
                    "states": str(one.order),
                    "before reduction (urad)": f"{_microradians(one.whole):.1f}",
                    "largest pole of the controller": f"{one.own_radius:.3f}",
                    **{f"{cause} (urad)": f"{_microradians(value):.1f}" for cause, value in one.causes.items()},
                }
            )
    return rows


def _jitters(jitter: Any, run: Run, held: Run) -> dict[str, str]:
    predicted, simulated = _microradians(jitter), 1e6 * run.jitter.rms
    return {
        "co-simulated (urad)": f"{simulated:.1f}",
        "predicted (urad)": f"{predicted:.1f}",
        "held / this": f"{held.jitter.rms / run.jitter.rms:.1f}",
        "standard error (urad)": f"{1e6 * run.error:.1f}",
        "predicted / co-simulated": f"{predicted / simulated:.2f}",
    }


def _inverse(factor: float) -> float:
    return 1.0 / factor if factor > 0.0 else np.inf


def _microradians(jitter: Any) -> float:
    return 1e6 * float(np.hypot(jitter[0], jitter[1]))


def write_rows(path: Path, rows: list[dict[str, str]]) -> None:
    """Write the table as CSV. Raises `ResultsError` if that cannot be done."""
    with whole_or_not(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, _COLUMNS, restval="")
        table.writeheader()
        table.writerows(rows)


def show_rows(console: Console, rows: list[dict[str, str]], wind: float) -> None:
    """Print what matters of the table, in two that fit 80 columns; `wind` in m/s."""
    title = f"Jitter of the line of sight in exposures of {EXPOSURE:g} s, µrad rms, {wind:g} m/s of wind"
    console.print(_table(title, (*_NAMES, *_JITTER, *_MARGINS), rows))
    console.print(_table("What makes the predicted jitter, µrad rms", (*_NAMES, *_OF_CAUSES), rows[1:]))


def _table(title: str, columns: tuple[str, ...], rows: list[dict[str, str]]) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_style="bold", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in columns:
        head = _HEADS.get(name, name.removesuffix(" (urad)"))
        justify: Any = "left" if name in _NAMES else "right"
        table.add_column(head, justify=justify, overflow="fold", no_wrap=name not in _NAMES)
    for row in rows:
        table.add_row(*[row.get(name, "").replace("inf", "∞") for name in columns])
    return table
