"""Results: the structured arrays of FMPy, filled row by row, kept on disk while a run goes on.

A recording that has a file lives in that file, a plain ``.npy`` mapped into memory. What has been recorded is therefore
safe even if an FMU takes the whole process down; rows that were not reached have the time NaN.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from .errors import ResultsError
from .workspace import whole_or_not

Results = NDArray[np.void]

_TRUTHS = ("True", "False")


class Recording:
    """Rows for the fields of `dtype` (``time`` first), at most `capacity` of them, in the file `path` if one is given.

    `length` rows are filled. Raises `ResultsError` if the disk does not take the file.
    """

    def __init__(self, dtype: np.dtype[np.void], capacity: int, path: Path | None = None) -> None:
        self.path = path
        self.length = 0
        self.rows: Results
        try:
            if path is None:
                self.rows = np.zeros(capacity, dtype)
            else:
                self.rows = open_memmap(path, mode="w+", dtype=dtype, shape=(capacity,))
                _allocate(path)
        except (OSError, MemoryError) as error:
            size = f"{capacity} rows of {dtype.itemsize} bytes ({capacity * dtype.itemsize / 1e6:.1f} MB)"
            if path is None:
                why = "in memory"
            else:
                with suppress(OSError):
                    path.unlink(missing_ok=True)
                why = f"in {path}: {getattr(error, 'strerror', None) or 'not enough memory'}"
            raise ResultsError(
                f"cannot keep {size} {why}; a longer recording interval (--interval) makes fewer"
            ) from error
        # a view of the plain kind, which is much faster to index than a memory map
        self.rows = self.rows.view(np.ndarray)
        self.address = self.rows.ctypes.data
        self._columns: dict[str, NDArray[Any]] = {}
        self.times = self.column("time")
        self.times[:] = np.nan

    def column(self, name: str) -> NDArray[Any]:
        """The memory of one field, all rows."""
        if name not in self._columns:
            self._columns[name] = self.rows[name]
        return self._columns[name]

    def filled(self) -> Results:
        """What has been recorded so far: a view, which must go before `close`."""
        return self.rows[: self.length]

    def close(self, keep_file: bool = False) -> Results:
        """What has been recorded, in memory; the file is removed, or nothing given and the file left to others."""
        results: Results = np.array(self.rows[: 0 if keep_file else self.length])
        # every view must go before the file can be removed on Windows
        self._columns.clear()
        del self.rows, self.times
        if self.path is not None and not keep_file:
            with suppress(OSError):
                self.path.unlink(missing_ok=True)
        return results


def _allocate(path: Path) -> None:
    # a full disk must show now, not as a bus error in the middle of a run
    if hasattr(os, "posix_fallocate"):
        with path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, path.stat().st_size)


def read_rows(path: Path) -> Results | None:
    """The rows in the file of a recording that was left or whose process crashed, None if there is no such file.

    Raises `ResultsError` for a damaged file.
    """
    if not path.is_file():
        return None
    try:
        # the header names every column; NumPy distrusts long ones
        rows: Results = np.load(path, max_header_size=path.stat().st_size)
    except (OSError, ValueError) as error:
        raise ResultsError(f"cannot read the rows in {path}: {error}") from error
    # filled from the first one on
    filled: Results = rows[: int(np.searchsorted(np.isnan(rows["time"]), True))]
    return filled


def keep(results: Results, path: Path, spill: Path | None) -> None:
    """Write results to the CSV file `path`.

    Raises `ResultsError` if the disk does not take it; the message names the file `spill` where the rows still are.
    """
    try:
        if len(results):
            write_csv(path, results)
    except ResultsError as error:
        raise ResultsError(f"{error}; the rows are kept in {spill}" if spill else str(error)) from error


def rescue(spill: Path, path: Path) -> Results | None:
    """Turn the file `spill` that a run left behind into the CSV file `path`; gives its rows, None if there is no file.

    Raises `ResultsError` if the CSV file cannot be written; `spill` stays then.
    """
    results = read_rows(spill)
    if results is not None:
        keep(results, path, spill)
        spill.unlink()
    return results


def write_csv(path: Path | str, results: Results, columns: Iterable[str] | None = None) -> Path:
    """Write results as ``fmpy.write_csv`` does, the same bytes, about a hundred times faster.

    Raises `ResultsError` if the file cannot be written.
    """
    path = Path(path)
    if columns is not None:
        results = results[["time", *columns]]
    names = results.dtype.names or ()
    with whole_or_not(path) as draft, draft.open("w", newline="\n", encoding="utf-8") as file:
        file.write(",".join(f'"{name}"' for name in names) + "\n")
        for start in range(0, len(results), 1000):
            block: list[tuple[Any, ...]] = results[start : start + 1000].tolist()
            file.writelines([",".join(map(str, row)) + "\n" for row in block])
    return path


def read_csv(path: Path | str) -> Results:
    """Read results that `write_csv` or FMPy wrote, Booleans included (on which ``fmpy.read_csv`` stumbles).

    Raises `ResultsError` if the file is missing or holds no table of results.
    """
    try:
        with Path(path).open(encoding="utf-8") as file:
            names = [name.strip().strip('"') for name in file.readline().split(",")]
            first = file.readline().strip().split(",")
            if names[0] != "time":
                raise ValueError("its first column is not the time")
            dtype = np.dtype([(name, _kind(text)) for name, text in zip(names, first, strict=True)])
            switches = {place: _is_true for place, text in enumerate(first) if text in _TRUTHS}
            file.seek(0)
            converters: Any = switches or None
            rows: Results = np.loadtxt(file, dtype, delimiter=",", skiprows=1, converters=converters, ndmin=1)
            return rows
    except (OSError, ValueError) as error:
        raise ResultsError(f"cannot read results from {path}: {error}") from error


def _kind(text: str) -> type:
    if text in _TRUTHS:
        return np.bool_
    return np.int32 if text.lstrip("-").isdigit() else np.float64


def _is_true(text: str) -> bool:
    return text == "True"
