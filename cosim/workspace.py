"""Files and folders of a run: where FMUs are unpacked, and how a file is written whole or not at all."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import ResultsError

_SAFE_PATH = re.compile(r"[A-Za-z0-9_./\\:~-]+")


@contextmanager
def claimed(path: Path) -> Iterator[None]:
    """Keep other runs away from a file or folder, until the end of the block or of the process, however that ends.

    Raises `ResultsError` if another run has it.
    """
    lock = path / ".run.lock" if path.is_dir() else path.with_name(f".{path.name}.lock")
    try:
        handle = _locked(lock)
    except OSError as error:
        raise ResultsError(f"cannot write {'into ' * path.is_dir()}{path}: {error.strerror or error}") from error
    if handle is None:
        raise ResultsError(f"another run is writing into {path}; let it end, or choose another place")
    try:
        yield
    finally:
        if sys.platform != "win32":
            lock.unlink(missing_ok=True)
        os.close(handle)


if sys.platform == "win32":

    def _locked(lock: Path) -> int | None:
        try:
            # the system removes the file when the process is gone
            return os.open(lock, os.O_CREAT | os.O_EXCL | os.O_TEMPORARY)
        except (FileExistsError, PermissionError):
            return None

else:
    import fcntl

    def _locked(lock: Path) -> int | None:
        while True:
            handle = os.open(lock, os.O_CREAT | os.O_RDWR, 0o644)
            try:
                # the system takes the lock back when the process is gone; the file may stay
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(handle)
                return None
            except OSError:
                # a file system without locks
                return handle
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), os.stat(lock)):
                    return handle
            # the one who had it removed the file in between
            os.close(handle)


@contextmanager
def whole_or_not(path: Path) -> Iterator[Path]:
    """A file beside `path` to write to; it takes the place of `path` when all went well, else it is removed.

    Raises `ResultsError` if the disk does not take it.
    """
    if not path.name or path.is_dir():
        raise ResultsError(f"cannot write {path}: it is a folder; name a file")
    draft = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield draft
        draft.replace(path)
    except OSError as error:
        raise ResultsError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


@contextmanager
def fmu_folder(workspace: Path | None) -> Iterator[Path]:
    """A folder for the unpacked FMUs, removed afterwards together with what it left in the interpreter.

    Raises `ResultsError` if none can be made.
    """
    try:
        folder = Path(tempfile.mkdtemp(prefix="attitude_fmu_", dir=safe_folder(workspace)))
    except OSError as error:
        raise ResultsError(f"no folder to unpack FMUs: {error}") from error
    try:
        yield folder
    finally:
        _forget_modules(folder)
        shutil.rmtree(folder, ignore_errors=True)


def safe_folder(workspace: Path | None = None) -> Path:
    """A folder for temporary files whose name is plain: `workspace` if given, else the system's own or another.

    FMUs made with pythonfmu crash the host when their path needs escaping in a URI.
    Raises `ResultsError` if there is none.
    """
    candidates = [workspace] if workspace else [Path(tempfile.gettempdir()), Path("/tmp"), Path.cwd(), Path.home()]
    for candidate in candidates:
        if _SAFE_PATH.fullmatch(str(candidate.resolve())) and candidate.is_dir():
            return candidate.resolve()
    raise ResultsError(
        f"no folder for temporary files has a plain name (tried {candidates[0]}); set TMPDIR to one made of letters, "
        "digits, '-' and '_'"
    )


def _forget_modules(folder: Path) -> None:
    """Take back what FMUs in Python imported from `folder`, so that the next run gets its own code."""
    inside = str(folder)
    sys.path[:] = [entry for entry in sys.path if not entry.startswith(inside)]
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(inside):
            del sys.modules[name]
