"""The experiments of the 2010 paper, "Design of attitude sensor using ADIS16354 chip", Chinese Journal of Sensors and
Actuators 23(2): one ADIS16354 and a TMS320F2812 on a non-magnetic turntable.

It prints four tables of angles; it tells in words of the noise at rest, the filter on it, and of causes of error.
"""

from __future__ import annotations

from .experiment import Experiment
from .paper_b_causes import CAUSES
from .paper_b_noise import NOISE
from .paper_b_static import STATIC
from .paper_b_turns import TURNS

EXPERIMENTS: tuple[Experiment, ...] = (NOISE, STATIC, TURNS, CAUSES)
"""In the order of the paper."""
