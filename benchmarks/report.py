"""What all tables share: rows as text, means with their standard errors, the machine, and the dated result file."""

from __future__ import annotations

import importlib.metadata
import json
import platform
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

Rows = list[dict[str, object]]


@dataclass(frozen=True)
class Record:
    """What is kept of a comparison."""

    date: str
    machine: dict[str, str]
    sections: dict[str, Rows]
    elsewhere: dict[str, dict[str, str]] = field(default_factory=dict)
    """Machines of sections that were measured on another, by title."""

    def updated(self, new: Record) -> Record:
        """With the sections of another one; titles that are new follow the one they follow there. The head stays."""
        titles = list(self.sections)
        before: str | None = None
        for title in new.sections:
            if title not in titles:
                titles.insert(len(titles) if before is None else titles.index(before) + 1, title)
            before = title
        sections = {**self.sections, **new.sections}
        elsewhere = {title: machine for title, machine in self.elsewhere.items() if title not in new.sections}
        if new.machine != self.machine:
            elsewhere |= dict.fromkeys(new.sections, new.machine)
        return Record(new.date, self.machine, {title: sections[title] for title in titles}, elsewhere)

    def keep(self, folder: Path) -> None:
        """Writes `<date>.md` and `<date>.json`."""
        folder.mkdir(parents=True, exist_ok=True)
        record = {"date": self.date, "machine": self.machine, "sections": self.sections, "elsewhere": self.elsewhere}
        for ending, text in (("md", self.markdown()), ("json", json.dumps(record, indent=1) + "\n")):
            temporary = folder / f".{self.date}.{ending}"
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(folder / f"{self.date}.{ending}")

    def markdown(self) -> str:
        """The tables as text."""
        parts = [f"# Comparison of {self.date}", "", told(self.machine), ""]
        parts += ["Written by `python -m benchmarks.compare`. Times: CPU time of the busiest thread.", ""]
        for title, rows in self.sections.items():
            parts += [f"## {title}", ""]
            if title in self.elsewhere:
                other = {key: value for key, value in self.elsewhere[title].items() if self.machine.get(key) != value}
                parts += [f"Measured on another machine: {told(other)}", ""]
            parts += [*(table_lines(rows) if rows else ["Skipped: the rival is missing."]), ""]
        return "\n".join(parts)


def newest(folder: Path) -> Record | None:
    """The last record kept in a folder, if there is one."""
    files = sorted(folder.glob("[0-9]*.json"))
    if not files:
        return None
    kept = json.loads(files[-1].read_text(encoding="utf-8"))
    return Record(kept["date"], kept["machine"], kept["sections"], kept.get("elsewhere", {}))


def told(machine: dict[str, str]) -> str:
    """A machine in a line."""
    return ", ".join(f"{key} {value}" for key, value in machine.items()) + "."


def describe_machine(simd: str) -> dict[str, str]:
    """What the figures depend on."""
    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    machine = {"processor": processor, "instruction set": simd, "python": platform.python_version()}
    import jacoflow

    machine["jacoflow"] = jacoflow.__version__
    for package in ("numpy", "opencv-contrib-python-headless", "filterpy", "scikit-learn"):
        try:
            machine[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            machine[package] = "missing"
    return machine


def mean_and_error(values: Iterable[float]) -> tuple[float, float]:
    """Mean of the finite values and its standard error; the error is NaN for fewer than two values."""
    known = np.asarray([value for value in values if np.isfinite(value)], float)
    if known.size == 0:
        return float("nan"), float("nan")
    error = known.std(ddof=1) / np.sqrt(known.size) if known.size > 1 else float("nan")
    return float(known.mean()), float(error)


def table_lines(rows: Rows) -> list[str]:
    """The rows as a table; a cell is empty where a row has no such column."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    lines = ["| " + " | ".join(name.replace("_", " ") for name in columns) + " |", "|" + "---|" * len(columns)]
    return lines + ["| " + " | ".join(show(row.get(name, "")) for name in columns) + " |" for row in rows]


def show(value: object) -> str:
    """A table cell."""
    if value is None:
        return "rival missing"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    return str(value)
