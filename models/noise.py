"""Philox4x64-10, the counter-based generator behind `numpy.random.Philox`, and standard normals from it.

The k-th call of a task draws from key (seed, stream) and counter (k, block, 0, 0), so noise carries no state and
does not depend on what else is drawn. Source: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as
1, 2, 3", SC11.
"""

from __future__ import annotations

import math
import zlib

_MASK = 0xFFFFFFFFFFFFFFFF
_MULTIPLIER_0 = 0xD2E7470EE14C6C93
_MULTIPLIER_1 = 0xCA5A826395121157
_WEYL_0 = 0x9E3779B97F4A7C15
_WEYL_1 = 0xBB67AE8584CAA73B
_ROUNDS = 10
_UNIT = 2.0**-53
_TWO_PI = 2.0 * math.pi


def philox4x64(counter: tuple[int, int, int, int], key: tuple[int, int]) -> tuple[int, int, int, int]:
    """Four uniform 64-bit words of one counter under one key (ten rounds)."""
    x0, x1, x2, x3 = counter
    k0, k1 = key
    for _ in range(_ROUNDS):
        p0 = _MULTIPLIER_0 * x0
        p1 = _MULTIPLIER_1 * x2
        x0, x1, x2, x3 = (p1 >> 64) ^ x1 ^ k0, p1 & _MASK, (p0 >> 64) ^ x3 ^ k1, p0 & _MASK
        k0 = (k0 + _WEYL_0) & _MASK
        k1 = (k1 + _WEYL_1) & _MASK
    return x0, x1, x2, x3


def stream_of(task_name: str) -> int:
    """Number of a task's noise stream: CRC-32 of its name, so that adding a task leaves the others' noise alone."""
    return zlib.crc32(task_name.encode())


def _normal_pair(a: int, b: int) -> tuple[float, float]:
    radius = math.sqrt(-2.0 * math.log(((a >> 11) + 1) * _UNIT))
    angle = _TWO_PI * ((b >> 11) * _UNIT)
    return radius * math.cos(angle), radius * math.sin(angle)


def normals(key: tuple[int, int], call: int, count: int) -> tuple[float, ...]:
    """`count` standard normals of a task's call number `call`.

    Box-Muller on the upper 53 bits: u = (a + 1) 2^-53 in (0, 1], v = b 2^-53; r = sqrt(-2 ln u);
    z = r cos(2 pi v), r sin(2 pi v).
    """
    drawn: tuple[float, ...] = ()
    for block in range((count + 3) // 4):
        a, b, c, d = philox4x64((call & _MASK, block, 0, 0), key)
        drawn += _normal_pair(a, b)
        if len(drawn) < count:
            drawn += _normal_pair(c, d)
    return drawn[:count]
