"""Puts this folder on the path, so that every room's tests find the helpers in it."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def _heeded_interrupts() -> Iterator[None]:
    """A shell's background job ignores Ctrl-C, and with it what the tests of interrupted runs send themselves."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
