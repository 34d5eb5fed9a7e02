"""Claims beside distributions: the verdicts, and how trials are named and found again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from attitude_fmu.cosim.experiment import Case, Claim, Experiment, by_case, findings, trials_of
from attitude_fmu.cosim.monte_carlo import Figures, Trial
from attitude_fmu.cosim.recording import Results
from attitude_fmu.cosim.system import System

# of 0 to 100 the 5th, 50th and 95th percentiles are 5, 50 and 95
TRIALS: list[Figures] = [{"x": np.array(float(value))} for value in range(101)]
CLAIM = Claim("x", 50.0, "deg", "table 1", "paper", "x")


def experiment(*claims: Claim, cases: tuple[Case, ...] = ()) -> Experiment:
    return Experiment("sums", "paper-a", "Sums", (), lambda _dist: cases, claims, lambda _figure, _cases: None)


def verdict(claim: Claim) -> str:
    return findings(experiment(claim), {"paper": TRIALS})[0].verdict


@pytest.mark.parametrize(
    ("published", "expected"), [(4.9, "outside"), (5.0, "inside"), (95.0, "inside"), (95.1, "outside")]
)
def test_printed_value_is_inside_between_the_percentiles(published: float, expected: str) -> None:
    assert verdict(CLAIM._replace(published=published)) == expected


@pytest.mark.parametrize(("published", "expected"), [(94.9, "outside"), (95.0, "inside"), (1e6, "inside")])
def test_printed_limit_is_inside_if_nineteen_of_twenty_keep_it(published: float, expected: str) -> None:
    assert verdict(CLAIM._replace(published=published, bound=True)) == expected


def test_reason_explains_only_what_is_outside() -> None:
    because = "the printed number is of one run"
    assert verdict(CLAIM._replace(because=because)) == "inside"
    assert verdict(CLAIM._replace(because=because, published=100.0)) == "explained"


def test_figure_that_the_paper_does_not_print_has_no_verdict() -> None:
    assert verdict(CLAIM._replace(published=None)) == "not printed"


def test_gain_is_the_ratio_of_distances_from_the_target() -> None:
    best: list[Figures] = [{"x": np.array(43.0)}, {"x": np.array(44.0)}]
    claim = CLAIM._replace(target=42.0, best="ours")
    found = findings(experiment(claim), {"paper": TRIALS, "ours": best})[0]
    assert (found.median, found.best) == (50.0, 43.5)
    assert found.gain == pytest.approx(8.0 / 1.5)
    assert findings(experiment(claim._replace(target=43.5)), {"paper": TRIALS, "ours": best})[0].gain is None
    assert findings(experiment(CLAIM), {"paper": TRIALS})[0].gain is None


def no_figures(_results: Results) -> dict[str, float]:
    return {}


def test_trials_are_found_again_by_experiment_and_case(tmp_path: Path) -> None:
    def trial(seed: int) -> Trial:
        return Trial("", System("s", ()), no_figures, float(seed))

    one = experiment(cases=(Case("raw", trial, 2), Case("raw-down", trial, 1)))
    made = trials_of(one, tmp_path)
    assert [(trial.name, trial.stop_time) for trial in made] == [
        ("sums/raw/1", 1.0),
        ("sums/raw/2", 2.0),
        ("sums/raw-down/1", 1.0),
    ]
    figures: dict[str, Figures] = {trial.name: {"x": np.array(trial.stop_time)} for trial in made}
    figures["others/raw/1"] = {"x": np.array(7.0)}
    found = by_case(one, figures)
    assert {name: [float(values["x"]) for values in trials] for name, trials in found.items()} == {
        "raw": [1.0, 2.0],
        "raw-down": [1.0],
    }
