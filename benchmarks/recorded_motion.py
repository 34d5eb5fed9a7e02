"""Inclination RMSE of the default solver on recorded motion, beside VQF's from the same run.

    python benchmarks/recorded_motion.py [FOLDER]

FOLDER holds the trials as .npz; by default ``broad`` in the folder that ATTITUDE_FMU_DATA names.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from attitude_fmu.cosim import recorded_motion


def errors_of(path: Path) -> tuple[str, float, float]:
    """Trial, our RMSE and VQF's, in degrees."""
    from vqf import VQF

    trial = recorded_motion.load(path)
    ours = recorded_motion.attitudes(trial, recorded_motion.ideal_parameters(trial.period))
    peer = VQF(trial.period).updateBatch(np.ascontiguousarray(trial.rate), np.ascontiguousarray(trial.specific_force))[
        "quat6D"
    ]
    rmse = [np.degrees(recorded_motion.inclination_rmse(trial, q_nb)) for q_nb in (ours, peer)]
    return trial.name, rmse[0], rmse[1]


def main() -> None:
    """Print the table."""
    if len(sys.argv) > 1:
        folder = Path(sys.argv[1])
    elif "ATTITUDE_FMU_DATA" in os.environ:
        folder = Path(os.environ["ATTITUDE_FMU_DATA"]) / "broad"
    else:
        sys.exit("name the folder of the trials, or set ATTITUDE_FMU_DATA")
    trials = sorted(folder.glob("*.npz"))
    with ProcessPoolExecutor() as pool:
        rows = list(track(pool.map(errors_of, trials), "trials", total=len(trials), console=Console(stderr=True)))
    table = Table("trial", "fused", "VQF", "ratio", title="inclination RMSE, deg")
    for name, ours, peer in [*rows, ("mean", *np.mean([row[1:] for row in rows], axis=0))]:
        table.add_row(name, f"{ours:.3f}", f"{peer:.3f}", f"{ours / peer:.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
