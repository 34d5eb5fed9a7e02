"""Deterministic errors of a triad: S = (I + diag(scale) + cross) C_sb, offset b + k (T - T0)."""

from __future__ import annotations

from ..record import Matrix3, Vector3
from ..scalar import Scalar
from ..vectors import each_axis, matrix_product
from .devices import REFERENCE_TEMPERATURE


def sensitivity_matrix(scale_error: Vector3, cross_axis: Matrix3, mounting: Matrix3) -> Matrix3:
    """S = (I + diag(scale) + cross) C_sb: what each sensitive axis makes of a vector in body coordinates."""
    errors = each_axis(lambda i: each_axis(lambda j: cross_axis[i][j] + (1.0 + scale_error[i] if i == j else 0.0)))
    return matrix_product(errors, mounting)


def offset_at(bias: Scalar, slope: Scalar, temperature: Scalar) -> Scalar:
    """b + k (T - 25 degC); T in K."""
    return bias + slope * (temperature - REFERENCE_TEMPERATURE)
