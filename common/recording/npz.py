"""Reads the arrays of an npz file, or raises a clear error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.errors import RecordingError

Arrays = dict[str, NDArray[np.generic]]


def read_arrays(path: Path) -> Arrays:
    """Every array of a file, by name; objects are never unpickled.

    Raises RecordingError with the file, what is wrong with it, and what to do.
    """
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    try:
        with path.open("rb") as stream:  # np.load by path leaves a broken archive open
            found = np.load(stream, allow_pickle=False)
            if isinstance(found, np.lib.npyio.NpzFile):
                return {name: found[name] for name in found.files}
    except OSError as error:
        raise RecordingError(f"{path}: not a readable npz file ({error.strerror or error})") from None
    except Exception as error:  # a torn archive raises what zip, its codecs and numpy's headers have
        raise RecordingError(
            f"{path}: not an npz file of plain arrays ({type(error).__name__}); save it again by np.savez"
        ) from None
    raise RecordingError(f"{path}: one array (npy), not an npz file; save it by np.savez(gyr=…, acc=…, …)")
