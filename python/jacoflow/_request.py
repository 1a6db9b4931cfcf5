"""The arguments of `jacoflow.io.frames` as one value."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Request:
    """The arguments of `jacoflow.io.frames`, by their names."""

    source: str
    colour: str | None
    grey: str | None
    channel: int | None
    z: int | str | None
    key: str | None
    start: int
    stop: int | None
    step: int
