"""The experiments of Jing & Gao, "Attitude measurement system based on six axis MEMS devices", Computer Measurement &
Control 29(6), 2021.

It prints numbers of one experiment, the static run; it describes a sweep of two axes, and names temperature as what is
left to do. All three are run here, the paper's way and ours.
"""

from __future__ import annotations

from .experiment import Experiment
from .paper_a_static import STATIC
from .paper_a_sweep import SWEEP
from .paper_a_temperature import TEMPERATURE

EXPERIMENTS: tuple[Experiment, ...] = (STATIC, SWEEP, TEMPERATURE)
"""In the order of the paper."""
