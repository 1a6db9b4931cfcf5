"""What all tables share: options, rows as text, means with standard errors, the machine, the dated result
file.

A module of `benchmarks.tables` ends with a dictionary `TABLES` of `Table` by name, and `main(__doc__,
TABLES)`.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import platform
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

Row = dict[str, object]
Rows = list[Row]
Options = argparse.Namespace
RESULTS = Path(__file__).parent / "results"
"""Folder of the dated files."""
ROUNDS, QUICK_ROUNDS = 10, 3
"""Rounds in which times are taken in turns; the best counts."""
QUICK_SHARE = 0.1
"""Share of the trials that `--quick` leaves."""
SUMMARY_LINES = 300
"""Maximum length of the dated text file."""
SUMMARY_ROWS, SUMMARY_COLUMNS = 8, 9
"""Longer or wider tables are in the JSON file only."""


@dataclass(frozen=True)
class Table:
    """A table's title, and the function that makes its rows; no rows: the table is left out."""

    title: str
    rows: Callable[[Options], Rows]


def parser(
    doc: str | None, names: Iterable[str], arguments: Mapping[str, dict[str, Any]]
) -> argparse.ArgumentParser:
    """The options of every table, and `arguments` of a module's own: flag -> what `add_argument` takes."""
    made = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = tuple(names)
    made.add_argument(
        "--only", choices=names, nargs="+", default=names, metavar="NAME", help=", ".join(names)
    )
    made.add_argument("--quick", action="store_true", help="fewer rounds, scenes and trials")
    made.add_argument("--trials", type=int, help="trials of each table instead of its own number")
    made.add_argument(
        "--data", type=Path, default=os.environ.get("JACOFLOW_DATA"), help="folder of recordings with truth"
    )
    made.add_argument("--out", type=Path, help="folder of the dated file that the tables are written into")
    for flag, how in arguments.items():
        made.add_argument(flag, **how)
    return made


def default_options(quick: bool, data: Path | None, arguments: Mapping[str, dict[str, Any]]) -> Options:
    """The options of a module that is run with others."""
    options = parser(None, (), arguments).parse_args([])
    options.quick, options.data = quick, data
    return options


def main(
    doc: str | None, tables: Mapping[str, Table], arguments: Mapping[str, dict[str, Any]] | None = None
) -> None:
    """Prints the tables chosen on the command line; with `--out` they replace those of the newest dated
    file there."""
    options = parser(doc, tables, arguments or {}).parse_args()
    options.data = None if options.data is None else Path(options.data)
    sections: dict[str, Rows] = {}
    for name in options.only:
        rows = tables[name].rows(options)
        if rows:
            sections[tables[name].title] = rows
            print(f"## {tables[name].title}\n\n" + "\n".join(table_lines(rows)) + "\n", flush=True)
    if options.out is not None:
        keep(sections, options.out, os.environ.get("JACOFLOW_SIMD", "best"))


def rounds(options: Options) -> int:
    """Number of rounds in which times are taken."""
    return QUICK_ROUNDS if options.quick else ROUNDS


def trials(options: Options, own: int, least: int = 4) -> int:
    """Number of trials of a table whose own number is `own`."""
    return options.trials or max(least, round(QUICK_SHARE * own) if options.quick else own)


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
    return lines(
        [name.replace("_", " ") for name in columns],
        [[show(row.get(name, "")) for name in columns] for row in rows],
    )


def lines(head: Iterable[str], body: Iterable[Iterable[str]]) -> list[str]:
    """A markdown table."""
    head = list(head)
    first, *others = (f"| {' | '.join(cells)} |" for cells in (head, *body))
    return [first, "|" + "---|" * len(head), *others]


def show(value: object) -> str:
    """A table cell."""
    if value is None:
        return "rival missing"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    return str(value)


@dataclass(frozen=True)
class Record:
    """The results that are kept: tables by title, with the date and the machine of the newest ones."""

    date: str
    machine: dict[str, str]
    sections: dict[str, Rows]
    elsewhere: dict[str, dict[str, str]] = field(default_factory=dict)
    """Machines of sections that were measured on another one, by title."""

    def updated(self, new: Record) -> Record:
        """With the sections of another record; a new title follows the title that it follows there."""
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

    def write(self, folder: Path) -> None:
        """Writes `<date>.json` with every row, and `<date>.md` with the short tables."""
        folder.mkdir(parents=True, exist_ok=True)
        record = {
            "date": self.date,
            "machine": self.machine,
            "sections": self.sections,
            "elsewhere": self.elsewhere,
        }
        for ending, text in (("md", self.markdown()), ("json", one_row_a_line(record))):
            temporary = folder / f".{self.date}.{ending}"
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(folder / f"{self.date}.{ending}")

    def markdown(self) -> str:
        """The short tables as text; the titles of the others."""
        parts = [f"# Comparison of {self.date}", "", machine_line(self.machine), ""]
        parts += ["Written by `python -m benchmarks.compare`. Times: CPU time of the busiest thread.", ""]
        left_out = []
        for title, rows in self.sections.items():
            columns = {key for row in rows for key in row}
            if len(rows) > SUMMARY_ROWS or len(columns) > SUMMARY_COLUMNS:
                left_out.append(f"- {title} ({len(rows)} rows)")
                continue
            parts += [f"## {title}", ""]
            if title in self.elsewhere:
                other = {
                    key: value
                    for key, value in self.elsewhere[title].items()
                    if self.machine.get(key) != value
                }
                parts += [f"Measured on another machine: {machine_line(other)}", ""]
            parts += [*(table_lines(rows) if rows else ["Skipped: the rival is missing."]), ""]
        if left_out:
            parts += [f"## In {self.date}.json only", "", *left_out, ""]
        return "\n".join(parts)


def one_row_a_line(record: dict[str, Any]) -> str:
    """JSON with one line for each row of a table, so that differences between files can be read."""
    titles = []
    for title, rows in record["sections"].items():
        body = ",\n".join("   " + json.dumps(row) for row in rows)
        titles.append(f"  {json.dumps(title)}: [\n{body}\n  ]")
    others = [
        f" {json.dumps(key)}: {json.dumps(value)}" for key, value in record.items() if key != "sections"
    ]
    return "{\n" + ",\n".join([*others, ' "sections": {\n' + ",\n".join(titles) + "\n }"]) + "\n}\n"


def newest(folder: Path = RESULTS) -> Record | None:
    """The last record kept in a folder, if there is one."""
    files = sorted(folder.glob("[0-9]*.json"))
    if not files:
        return None
    kept = json.loads(files[-1].read_text(encoding="utf-8"))
    return Record(kept["date"], kept["machine"], kept["sections"], kept.get("elsewhere", {}))


def keep(sections: dict[str, Rows], folder: Path, simd: str, alone: bool = False) -> None:
    """Writes the sections into the newest record of a folder, or (`alone`) into a new one."""
    record = Record(datetime.date.today().isoformat(), describe_machine(simd), sections)
    before = None if alone else newest(folder)
    (record if before is None else before.updated(record)).write(folder)


def machine_line(machine: dict[str, str]) -> str:
    """A machine in a line."""
    return ", ".join(f"{key} {value}" for key, value in machine.items()) + "."


def describe_machine(simd: str) -> dict[str, str]:
    """Processor, instruction set and versions that the figures depend on."""
    processor = platform.processor() or platform.machine()
    try:
        info = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":", 1)[1].strip() for line in info if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    machine = {"processor": processor, "instruction set": simd, "python": platform.python_version()}
    for package in ("jacoflow", "numpy", "opencv-contrib-python-headless", "filterpy", "scikit-learn"):
        try:
            machine[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            machine[package] = "missing"
    return machine
