"""The line that `progress=True` draws."""

import sys
from typing import TextIO


class Line:
    """Shows `done/total frames` on one line of standard error (counts, no unit)."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr

    def __call__(self, done: int, total: int) -> None:
        """Overwrites the line; ends it when all `total` frames are done."""
        end = "\n" if done == total else ""
        self._stream.write(f"\r{done}/{total} frames{end}")
        self._stream.flush()
