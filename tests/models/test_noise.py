"""Philox and the normals drawn from it."""

from __future__ import annotations

import numpy as np
import pytest

from attitude_fmu.models.noise import normals, philox4x64, stream_of


@pytest.mark.parametrize("counter", [(1, 0, 0, 0), (2**64 - 1, 5, 0, 0), (7, 3, 2**63, 11)])
@pytest.mark.parametrize("key", [(0, 0), (1, 2**32 - 1), (2**64 - 1, 2**64 - 1)])
def test_philox_gives_the_raw_words_of_numpy(counter: tuple[int, ...], key: tuple[int, int]) -> None:
    whole = sum(word << (64 * i) for i, word in enumerate(counter)) - 1  # numpy counts up before it draws
    words = np.random.Philox(counter=whole % 2**256, key=key[0] + (key[1] << 64)).random_raw(4)
    assert philox4x64(counter, key) == tuple(int(word) for word in words)  # type: ignore[arg-type]


def test_a_call_draws_the_same_normals_whatever_was_drawn_before() -> None:
    key = (3, stream_of("gyro_1_register"))
    later = normals(key, 1000, 6)
    first = [normals(key, call, 6) for call in range(5)][0:1]
    assert first == [normals(key, 0, 6)]
    assert normals(key, 1000, 6) == later
    assert normals(key, 1000, 2) == later[:2]


def test_normals_are_standard_and_independent_between_calls_and_streams() -> None:
    calls = 20_000
    a = np.array([normals((1, stream_of("a")), call, 4) for call in range(calls)])
    b = np.array([normals((1, stream_of("b")), call, 4) for call in range(calls)])
    # 5 sigma of mean, variance, kurtosis and correlation of n Gaussian samples
    n = a.size
    assert abs(a.mean()) < 5 / np.sqrt(n)
    assert abs(a.var() - 1) < 5 * np.sqrt(2 / n)
    assert abs((a**4).mean() - 3) < 5 * np.sqrt(96 / n)
    assert abs(np.corrcoef(a.T) - np.eye(4)).max() < 5 / np.sqrt(calls)
    assert abs((a * b).mean()) < 5 / np.sqrt(n)
    assert abs((a[1:] * a[:-1]).mean()) < 5 / np.sqrt(n)
