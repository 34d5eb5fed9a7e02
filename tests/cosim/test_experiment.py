"""Claims beside distributions: the verdicts, and how trials are named and found again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from attitude_fmu.cosim.experiment import Case, Claim, Experiment, band, by_case, findings, trials_of
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


@pytest.mark.parametrize(("published", "expected", "kept"), [(4.9, "outside", 5), (5.0, "inside", 6)])
def test_limit_that_one_piece_kept_is_inside_if_one_of_twenty_keeps_it(
    published: float, expected: str, kept: int
) -> None:
    claim = CLAIM._replace(published=published, bound=True, one_piece=True)
    found = findings(experiment(claim), {"paper": TRIALS})[0]
    assert (found.verdict, found.kept) == (expected, kept / len(TRIALS))


def test_reason_explains_only_what_is_outside() -> None:
    because = "the printed number is of one run"
    assert verdict(CLAIM._replace(because=because)) == "inside"
    assert verdict(CLAIM._replace(because=because, published=100.0)) == "explained"


def test_figure_that_the_paper_does_not_print_has_no_verdict() -> None:
    assert verdict(CLAIM._replace(published=None)) == "not printed"


def test_number_that_set_the_arrangement_is_not_inside() -> None:
    assert verdict(CLAIM._replace(sets=True)) == "set"
    assert verdict(CLAIM._replace(sets=True, published=100.0)) == "outside"


def test_fewer_than_twenty_seeds_have_a_least_and_a_largest() -> None:
    assert band([float(value) for value in range(19)]) == (0.0, 9.0, 18.0)
    assert band([float(value) for value in range(21)]) == (1.0, 10.0, 19.0)


def test_gain_is_the_ratio_of_the_median_distances_from_the_target() -> None:
    ours: list[Figures] = [{"x": np.array(x)} for x in (41.0, 43.0, 44.0)]
    told: list[Figures] = [{"x": np.array(42.5)}]
    claim = CLAIM._replace(target=42.0, best="ours", tuned="told")
    found = findings(experiment(claim), {"paper": TRIALS, "ours": ours, "told": told})[0]
    # |x - 42| of 0 to 100: each of 0 to 42 twice but 0, then 43 to 58; the 51st of 101 is 25
    assert found.median == 50.0
    assert found.best == (43.0, 25.0)
    assert found.tuned == (42.5, 50.0)


def test_gain_over_a_flawless_solution_is_none() -> None:
    flawless: list[Figures] = [{"x": np.array(42.0)}]
    claim = CLAIM._replace(target=42.0, best="ours")
    found = findings(experiment(claim), {"paper": TRIALS, "ours": flawless})[0]
    assert found.best == (42.0, None)
    assert found.tuned is None


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
