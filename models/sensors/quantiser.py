"""Range and register word: code = round(clip(y, -range, range)/LSB), within the word."""

from __future__ import annotations

from ..scalar import Scalar, absolute, clip, round_half_up, where


def register_code(value: Scalar, full_scale: Scalar, resolution: Scalar, limit: Scalar) -> Scalar:
    """Code -limit..limit - 1 of a value held within +-full_scale; resolution is one LSB in the value's unit."""
    return clip(round_half_up(clip(value, -full_scale, full_scale) / resolution), -limit, limit - 1.0)


def over_range(value: Scalar, full_scale: Scalar) -> Scalar:
    """1.0 where the value lies beyond the range, else 0.0."""
    return where(absolute(value) > full_scale, 1.0, 0.0)
