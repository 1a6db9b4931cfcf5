"""The line that `progress=True` draws."""

import sys
from typing import TextIO


class Line:
    """Shows `done/total frames` on one line of standard error (counts, no unit); total 0: not known."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr

    def __call__(self, done: int, total: int) -> None:
        """Overwrites the line; ends it when all `total` frames are done."""
        end = "\n" if done == total else ""
        self._stream.write(f"\r{done}/{total} frames{end}" if total else f"\r{done} frames")
        self._stream.flush()
