"""Vectors of three scalars and 3x3 matrices of rows, as tuples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .record import Matrix3, Vector3
from .scalar import Scalar, sqrt

ZERO3: Vector3 = (0.0, 0.0, 0.0)
IDENTITY3: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def each_axis(of: Callable[[int], Any]) -> tuple[Any, Any, Any]:
    """of(0), of(1), of(2)."""
    return of(0), of(1), of(2)


def add(a: Vector3, b: Vector3) -> Vector3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector3, b: Vector3) -> Vector3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(k: Scalar, a: Vector3) -> Vector3:
    return k * a[0], k * a[1], k * a[2]


def dot(a: Vector3, b: Vector3) -> Scalar:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector3, b: Vector3) -> Vector3:
    ax, ay, az = a
    bx, by, bz = b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def norm(a: Vector3) -> Scalar:
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def multiply(m: Matrix3, a: Vector3) -> Vector3:
    """M a."""
    x, y, z = a
    r1, r2, r3 = m
    return (
        r1[0] * x + r1[1] * y + r1[2] * z,
        r2[0] * x + r2[1] * y + r2[2] * z,
        r3[0] * x + r3[1] * y + r3[2] * z,
    )


def multiply_transposed(m: Matrix3, a: Vector3) -> Vector3:
    """M' a."""
    x, y, z = a
    r1, r2, r3 = m
    return (
        r1[0] * x + r2[0] * y + r3[0] * z,
        r1[1] * x + r2[1] * y + r3[1] * z,
        r1[2] * x + r2[2] * y + r3[2] * z,
    )


def matrix_product(a: Matrix3, b: Matrix3) -> Matrix3:
    """A B."""
    columns = transpose(b)
    return each_axis(lambda i: each_axis(lambda j: dot(a[i], columns[j])))


def transpose(m: Matrix3) -> Matrix3:
    return (m[0][0], m[1][0], m[2][0]), (m[0][1], m[1][1], m[2][1]), (m[0][2], m[1][2], m[2][2])
