"""What a part makes of the true signal: scale, axes, nonlinearity, temperature."""

from __future__ import annotations

from ..record import Matrix3, Vector3
from ..scalar import Scalar, cos, maximum, minimum, sin, sqrt, where
from ..vectors import each_axis, matrix_product
from .datasheet import REFERENCE_TEMPERATURE

_CUBIC_RESIDUAL = 0.15118578920369088
"""rms of u^3 - 3/5 u over -1..1, sqrt(1/7 - 6/25 + 9/75): what a straight line leaves of a cubic."""


def rotation_matrix(rotation: Vector3) -> Matrix3:
    """C = I + sin(a)/a [r x] + (1 - cos(a))/a^2 [r x]^2 of the rotation vector r of length a (Rodrigues)."""
    x, y, z = rotation
    square = x * x + y * y + z * z
    small = square < 1e-16
    angle = sqrt(where(small, 1.0, square))
    s = where(small, 1.0, sin(angle) / angle)
    c = where(small, 0.5, (1.0 - cos(angle)) / (angle * angle))
    return (
        (1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y),
        (c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x),
        (c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)),
    )


def skewed_axes(nonorthogonality: Vector3) -> Matrix3:
    """Rows: a triad whose y leans to x, z to x and z to y by these angles, each less than a right angle apart."""
    yx, zx, zy = nonorthogonality
    a = sin(zx)
    b = (sin(zy) - a * sin(yx)) / cos(yx)
    return (1.0, 0.0, 0.0), (sin(yx), cos(yx), 0.0), (a, b, sqrt(1.0 - a * a - b * b))


def sensitivity_matrix(
    scale_error: Vector3, cross_axis: Matrix3, nonorthogonality: Vector3, misalignment: Vector3, mounting: Matrix3
) -> Matrix3:
    """S = (I + diag(scale) + cross) N R' C_sb: what each sensitive axis makes of a vector in body coordinates.

    N are the axes of the skewed triad, R turns the triad against its package.
    """
    errors = each_axis(lambda i: each_axis(lambda j: cross_axis[i][j] + (1.0 + scale_error[i] if i == j else 0.0)))
    r = rotation_matrix(misalignment)
    turned = ((r[0][0], r[1][0], r[2][0]), (r[0][1], r[1][1], r[2][1]), (r[0][2], r[1][2], r[2][2]))
    return matrix_product(matrix_product(errors, skewed_axes(nonorthogonality)), matrix_product(turned, mounting))


def with_temperature(value: Scalar, slope: Scalar, curve: Scalar, temperature: Scalar) -> Scalar:
    """v + k1 (T - 25 degC) + k2 (T - 25 degC)^2; T in K."""
    warmer = temperature - REFERENCE_TEMPERATURE
    return value + warmer * (slope + curve * warmer)


def hysteresis_loop(loop: Scalar, temperature: Scalar, width: Scalar) -> Scalar:
    """The play operator: a point that T drags along at a distance of up to `width`, both in K."""
    return maximum(temperature - width, minimum(temperature + width, loop))


def hysteresis_offset(loop: Scalar, temperature: Scalar, width: Scalar, amplitude: Scalar) -> Scalar:
    """A (T - loop)/width: +A after long warming, -A after long cooling."""
    return amplitude * ((temperature - loop) / width)


def cubic_gains(nonlinearity: Scalar, full_scale: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """c1, c3 of e(x) = c3 x^3 - c1 x whose rms about the best straight line over +-FS is `nonlinearity` FS; c3 FS^2."""
    c = nonlinearity / _CUBIC_RESIDUAL
    return 0.6 * c, c / (full_scale * full_scale), c


def bent(x: Scalar, gains: tuple[Scalar, Scalar, Scalar]) -> Scalar:
    """x + c3 x^3 - c1 x within the range; beyond it the gain stays that at its end, 1 + c3 FS^2 - c1."""
    linear, cubic, most = gains
    return x + x * (minimum(cubic * (x * x), most) - linear)


def straightened(y: Scalar, cubic: Scalar) -> Scalar:
    """v of v + c v^3 = y by one Newton step from y, short of 3 (c y^2)^3 y; kept from dividing where c y^2 is large."""
    square = cubic * (y * y)
    return y - square * y / maximum(1.0 + 3.0 * square, 0.5)
