"""Speed and accuracy beside the usual tools, both sides in one process; writes a dated table.

    python benchmarks/compare.py [--quick] [--only SECTION ...] [--data FOLDER] [--out FOLDER] [--simd avx2]

Needs jacoflow and, for the other side, `pip install "jacoflow[bench]"`; rows whose rival is missing say so. Times are CPU time of the busiest thread, best
of several rounds taken in turns. `--data` (or the environment variable JACOFLOW_DATA) is a folder of recordings with known truth; without it their tables
are left out. `--only flow memory filter accuracy controlled coverage tracking mixture stereo stereo_tracking particle_tracking motion3d` chooses among the sections; its table is then printed and not kept,
unless `--out` names a folder: the newest table there is written anew with those sections, and the others as they were. A section tells its machine where that is another than the head's.
"""

from __future__ import annotations

import argparse
import datetime
import importlib
import importlib.metadata
import json
import os
import platform
from dataclasses import dataclass, field
from pathlib import Path

Rows = list[dict[str, object]]
SECTIONS = ("flow", "memory", "filter", "controlled", "coverage", "accuracy", "tracking", "mixture", "stereo", "stereo_tracking", "particle_tracking", "motion3d")


def main() -> None:
    """Runs the comparisons; writes `<date>.md` and `<date>.json` when it was all of them or a folder was named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer rounds, frames and scenes")
    parser.add_argument("--only", choices=SECTIONS, nargs="+", default=SECTIONS, help="sections to run")
    parser.add_argument("--data", type=Path, default=os.environ.get("JACOFLOW_DATA"), help="folder of recordings with truth")
    parser.add_argument("--out", type=Path, help="where the table goes")
    parser.add_argument("--simd", default="avx2", help="instruction set of our side: scalar, avx2 or avx512")
    options = parser.parse_args()
    # Read once, when the compiled part is first used.
    os.environ["JACOFLOW_SIMD"] = options.simd
    data = None if options.data is None else Path(options.data)
    sections: dict[str, Rows] = {}
    for name in SECTIONS:
        if name in options.only:
            sections |= run(name, options.quick, data)
    machine = describe_machine(options.simd)
    date = datetime.date.today().isoformat()
    record = Record(date, machine, sections)
    print(record.markdown())
    everything = set(options.only) == set(SECTIONS)
    if options.out is None and not everything:
        return
    folder = options.out or Path(__file__).parent / "results"
    before = None if everything else newest(folder)
    (record if before is None else before.updated(record)).keep(folder)


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
        parts += ["Written by `python benchmarks/compare.py`. Times: CPU time of the busiest thread.", ""]
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


def run(name: str, quick: bool, data: Path | None) -> dict[str, Rows]:
    """The tables of one section, by title."""
    rounds = 3 if quick else 10
    if name == "flow":
        import flow_speed

        sizes = flow_speed.SIZES[:1] if quick else flow_speed.SIZES
        return {f"Flow per second, {width} x {height}": flow_speed.speed(rounds, width, height) for width, height in sizes}
    if name == "memory":
        import memory

        width, height = (640, 480) if quick else (1920, 1080)
        title = f"Peak of resident memory, planes of one 4-byte number per pixel, {width} x {height}"
        return {title: list(memory.rows(width, height))}
    if name == "filter":
        import filter_speed

        return {
            "Flow filter, microseconds per pixel and frame, 640 x 480": filter_speed.speed(max(2, rounds // 2)),
            "Flow filter, agreement with the reference": filter_speed.agreement(60 if quick else 400),
        }
    if name == "controlled":
        import controlled

        return {"Accuracy on scenes with exact truth": controlled.default_table(quick)}
    if name == "coverage":
        import coverage

        return coverage.sections(quick, data)
    if name == "tracking":
        import tracking

        return tracking.sections(quick, data)
    if name == "mixture":
        import dirichlet_mixture
        import mixture

        return {
            "Weighted mixtures, a round": mixture.table(rounds),
            "Dirichlet-process mixtures: components (range), largest weight, adjusted Rand index": dirichlet_mixture.outcomes(3 if quick else 10),
            "Dirichlet-process mixtures: milliseconds of a fit on one thread (scikit-learn's time over it)": dirichlet_mixture.times(rounds),
        }
    if name == "stereo":
        import stereo

        return stereo.sections(quick, data)
    if name == "stereo_tracking":
        import stereo_tracking

        return stereo_tracking.sections(quick)
    if name == "particle_tracking":
        import particle_tracking

        return particle_tracking.sections(data, recordings=(10,), runs=1) if quick else particle_tracking.sections(data)
    if name == "motion3d":
        import motion3d

        return motion3d.sections(factor=0.1 if quick else 1.0, data=data, rounds=rounds)
    if data is None:
        return {}
    import accuracy

    return {"Accuracy on recordings": accuracy.table(data), "Strain from image correlation": accuracy.strain(data)}


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


if __name__ == "__main__":
    main()
