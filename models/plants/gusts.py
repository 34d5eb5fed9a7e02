"""Gusts: white noise through shaping filters that are discretised exactly, so that rms and spectrum do not depend on
the period.

Dryden (MIL-F-8785C; holds from 10 ft up, its use at a camera's height is an extrapolation), tau = L/V::

    H_u(s) = sigma_u sqrt(2 tau/pi) / (1 + tau s)
    H_v(s) = sigma_v sqrt(tau/pi) (1 + sqrt(3) tau s) / (1 + tau s)^2

Davenport (Q. J. R. Met. Soc. 87 (1961) 194), one-sided, of the wind U10 at 10 m::

    f S(f) = 4 kappa U10^2 x^2 / (1 + x^2)^(4/3),   x = 1200 f/U10,   rms sqrt(6 kappa) U10

whose x/(1 + x^2)^(4/3) is no filter's spectrum: four real poles and three zeros stand for it, within 9 % from
x = 0.05 to 1000 (0.4 mHz to 8 Hz at 10 m/s). Below, they stay where it falls; above, they fall by the square.
"""

from __future__ import annotations

from math import prod
from typing import Annotated, NamedTuple

from ..record import Real, Vector3
from ..scalar import PI, Scalar, exp, log, maximum, sqrt, where

Vector4 = tuple[Scalar, Scalar, Scalar, Scalar]

_FOOT = 0.3048
_SQRT_HALF = 0.5 * sqrt(2.0)
_SQRT_3 = sqrt(3.0)
_SQRT_6 = sqrt(6.0)

# of the Davenport spectrum, in units of x: least largest error of log S over 0.05..1000
_GAIN = 0.19962935657643072
_POLES = (333.178211, 25.9900470, 1.87065781, 0.282903211)
_ZEROS = (0.0785915384, 17.0336154, 215.329906)
_WAVE = 1200.0
"""m; the length in Davenport's x."""

_LEAST_PIVOT = 1e-10
"""Of the noise's covariance, against its diagonal: what is smaller is rounding."""


# --- Dryden -----------------------------------------------------------------------------------------------------------


class DrydenCoefficients(NamedTuple):
    """The discrete filters along and across."""

    rms: Annotated[float, Real("m/s", "rms gust along and across")]
    memory: Annotated[float, Real("1", "exp(-T V/L)")]
    coupling: Annotated[float, Real("1", "of the across filter's second state to its first")]
    noise: Annotated[Vector3, Real("1", "lower triangle of the noise's root: 11, 21, 22")]


def dryden_scale(height: Scalar) -> Scalar:
    """0.177 + 0.000823 h with h in feet: L_u = h / it^1.2, sigma_u = sigma_w / it^0.4 (MIL-F-8785C)."""
    return 0.177 + 0.000823 * height / _FOOT


def dryden_coefficients(speed: Scalar, height: Scalar, vertical_rms: Scalar, period: Scalar) -> DrydenCoefficients:
    """Exact discretisation over a period (Van Loan 1978, in closed form)."""
    stretch = log(dryden_scale(height))
    length = height * exp(-1.2 * stretch)
    p = speed * period / length
    memory = exp(-p)
    # of the chain x1' = -x1/tau + n, x2' = -x2/tau + x1, scaled to unit variances (their correlation is sqrt(1/2))
    lost = memory * memory
    q11 = 1.0 - lost
    q21 = _SQRT_HALF * (1.0 - lost * (1.0 + 2.0 * p))
    q22 = 1.0 - lost * (1.0 + 2.0 * p + 2.0 * p * p)
    n11 = sqrt(q11)
    n21 = q21 / n11
    return DrydenCoefficients(
        rms=vertical_rms * exp(-0.4 * stretch),
        memory=memory,
        coupling=2.0 * _SQRT_HALF * p * memory,
        noise=(n11, n21, sqrt(maximum(q22 - n21 * n21, 0.0))),
    )


def dryden_after(
    filters: tuple[Vector4, Vector4], first: Scalar, c: DrydenCoefficients, normals: tuple[Scalar, ...]
) -> tuple[tuple[Vector4, Vector4], tuple[Scalar, Scalar]]:
    """The filters and the gusts along and across (m/s) a period later; the first are drawn stationary."""
    n0, n1, n2 = normals
    n11, n21, n22 = c.noise
    (x0, *_), (x1, x2, *_) = filters
    y0 = where(first, n0, c.memory * x0 + n11 * n0)
    y1 = where(first, n1, c.memory * x1 + n11 * n1)
    y2 = where(first, _SQRT_HALF * (n1 + n2), c.memory * x2 + c.coupling * x1 + n21 * n1 + n22 * n2)
    across = 0.5 * (_SQRT_6 * y1 + (1.0 - _SQRT_3) * y2)
    return ((y0, 0.0, 0.0, 0.0), (y1, y2, 0.0, 0.0)), (c.rms * y0, c.rms * across)


# --- Davenport --------------------------------------------------------------------------------------------------------


def _residues() -> Vector4:
    """r of sum r_i/(s + p_i) = gain prod(1 + s/z) / prod(1 + s/p)."""

    def residue(i: int) -> float:
        p, others = _POLES[i], [q for j, q in enumerate(_POLES) if j != i]
        return _GAIN * p * prod(1.0 - p / z for z in _ZEROS) / prod(1.0 - p / q for q in others)

    return residue(0), residue(1), residue(2), residue(3)


_RESIDUES = _residues()
_VARIANCES = tuple([tuple([PI / (p + q) for q in _POLES]) for p in _POLES])
"""Stationary covariance of x_i' = -p_i x_i + w, where w makes the spectrum of x_i 1/(x^2 + p_i^2)."""

_SHARE = sum(_RESIDUES[i] * _RESIDUES[j] * _VARIANCES[i][j] for i in range(4) for j in range(4))
"""Variance of the fit; the formula's is 3/2."""


class DavenportCoefficients(NamedTuple):
    """The discrete filter, the same along and across."""

    rms: Annotated[tuple[float, float], Real("m/s", "rms gust along and across")]
    memory: Annotated[Vector4, Real("1", "what a mode keeps in a period")]
    noise: Annotated[tuple[Vector4, Vector4, Vector4, Vector4], Real("1", "root of the noise's covariance, rows")]
    start: Annotated[tuple[Vector4, Vector4, Vector4, Vector4], Real("1", "root of the stationary covariance, rows")]


def lower_root(m: tuple[tuple[Scalar, ...], ...]) -> tuple[Vector4, Vector4, Vector4, Vector4]:
    """L of L L' = M, 4x4 and positive semidefinite (Cholesky); a pivot within rounding counts as none."""
    rows: list[list[Scalar]] = []
    for i in range(4):
        row: list[Scalar] = []
        for j in range(i + 1):
            left = m[i][j] - sum([a * b for a, b in zip(row, (rows[j] if j < i else row)[:j], strict=True)])
            if i == j:
                sound = left > _LEAST_PIVOT * m[i][i]
                row.append(where(sound, sqrt(where(sound, left, 1.0)), 0.0))
            else:
                pivot = rows[j][j]
                row.append(where(pivot > 0.0, left / where(pivot > 0.0, pivot, 1.0), 0.0))
        rows.append(row)
    full = [(*row, *[0.0] * (4 - len(row))) for row in rows]
    return full[0], full[1], full[2], full[3]


def davenport_coefficients(
    speed: Scalar, surface_drag: Scalar, across: Scalar, period: Scalar
) -> DavenportCoefficients:
    """Exact discretisation over a period of the filter for U10 = `speed`; across: rms across over along."""
    rms = sqrt(6.0 * surface_drag) * speed
    lost = [exp(-2.0 * PI * speed / _WAVE * period * p) for p in _POLES]
    noise = tuple(
        [tuple([v * (1.0 - lost[i] * lost[j]) for j, v in enumerate(row)]) for i, row in enumerate(_VARIANCES)]
    )
    return DavenportCoefficients(
        rms=(rms, across * rms),
        memory=(lost[0], lost[1], lost[2], lost[3]),
        noise=lower_root(noise),
        start=lower_root(_VARIANCES),
    )


def _shaped(x: Vector4, first: Scalar, c: DavenportCoefficients, normals: tuple[Scalar, ...]) -> Vector4:
    def drawn(row: Vector4) -> Scalar:
        return row[0] * normals[0] + row[1] * normals[1] + row[2] * normals[2] + row[3] * normals[3]

    after = [where(first, drawn(c.start[i]), c.memory[i] * x[i] + drawn(c.noise[i])) for i in range(4)]
    return after[0], after[1], after[2], after[3]


def davenport_after(
    filters: tuple[Vector4, Vector4], first: Scalar, c: DavenportCoefficients, normals: tuple[Scalar, ...]
) -> tuple[tuple[Vector4, Vector4], tuple[Scalar, Scalar]]:
    """The filters and the gusts along and across (m/s) a period later; the first are drawn stationary."""
    shaped = _shaped(filters[0], first, c, normals[0:4]), _shaped(filters[1], first, c, normals[4:8])
    along, across = [
        rms / sqrt(_SHARE) * sum([r * x for r, x in zip(_RESIDUES, states, strict=True)])
        for rms, states in zip(c.rms, shaped, strict=True)
    ]
    return shaped, (along, across)
