"""Symmetric linear equations of six unknowns, written out for scalars."""

from __future__ import annotations

from ..scalar import Scalar

Symmetric6 = tuple[Scalar, ...]
"""Lower triangle of a symmetric 6x6 matrix, row by row: 21 numbers."""

Vector6 = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]


def solve_symmetric(m: Symmetric6, b: Vector6) -> Vector6:
    """x of M x = b by M = L D L', for a positive definite M (no pivoting).

    Source: Golub & Van Loan, Matrix Computations, algorithm 4.1.2; written out, since a loop over lists costs thrice.
    """
    m00, m10, m11, m20, m21, m22, m30, m31, m32, m33, m40, m41, m42, m43, m44, m50, m51, m52, m53, m54, m55 = m
    b0, b1, b2, b3, b4, b5 = b
    # v_ij = l_ij d_j
    i0 = 1.0 / m00
    l10, l20, l30, l40, l50 = m10 * i0, m20 * i0, m30 * i0, m40 * i0, m50 * i0
    i1 = 1.0 / (m11 - l10 * m10)
    v21, v31 = m21 - l20 * m10, m31 - l30 * m10
    v41, v51 = m41 - l40 * m10, m51 - l50 * m10
    l21, l31, l41, l51 = v21 * i1, v31 * i1, v41 * i1, v51 * i1
    i2 = 1.0 / (m22 - l20 * m20 - l21 * v21)
    v32 = m32 - l30 * m20 - l31 * v21
    v42 = m42 - l40 * m20 - l41 * v21
    v52 = m52 - l50 * m20 - l51 * v21
    l32, l42, l52 = v32 * i2, v42 * i2, v52 * i2
    i3 = 1.0 / (m33 - l30 * m30 - l31 * v31 - l32 * v32)
    v43 = m43 - l40 * m30 - l41 * v31 - l42 * v32
    v53 = m53 - l50 * m30 - l51 * v31 - l52 * v32
    l43, l53 = v43 * i3, v53 * i3
    i4 = 1.0 / (m44 - l40 * m40 - l41 * v41 - l42 * v42 - l43 * v43)
    v54 = m54 - l50 * m40 - l51 * v41 - l52 * v42 - l53 * v43
    l54 = v54 * i4
    i5 = 1.0 / (m55 - l50 * m50 - l51 * v51 - l52 * v52 - l53 * v53 - l54 * v54)
    # L y = b
    y1 = b1 - l10 * b0
    y2 = b2 - l20 * b0 - l21 * y1
    y3 = b3 - l30 * b0 - l31 * y1 - l32 * y2
    y4 = b4 - l40 * b0 - l41 * y1 - l42 * y2 - l43 * y3
    y5 = b5 - l50 * b0 - l51 * y1 - l52 * y2 - l53 * y3 - l54 * y4
    # D L' x = y
    x5 = y5 * i5
    x4 = y4 * i4 - l54 * x5
    x3 = y3 * i3 - l43 * x4 - l53 * x5
    x2 = y2 * i2 - l32 * x3 - l42 * x4 - l52 * x5
    x1 = y1 * i1 - l21 * x2 - l31 * x3 - l41 * x4 - l51 * x5
    x0 = b0 * i0 - l10 * x1 - l20 * x2 - l30 * x3 - l40 * x4 - l50 * x5
    return x0, x1, x2, x3, x4, x5
