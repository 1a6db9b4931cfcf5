"""Speed and accuracy beside the usual tools, both sides in one process; writes a dated table.

    python benchmarks/compare.py [--quick] [--data FOLDER] [--out FOLDER] [--simd avx2]

Needs jacoflow and, for the other side, `pip install "jacoflow[bench]"`; rows whose rival is missing say so. Times are CPU time of the busiest thread, best
of several rounds taken in turns. `--data` (or the environment variable JACOFLOW_DATA) is a folder of recordings with known truth; without it that table
is left out.
"""

from __future__ import annotations

import argparse
import datetime
import importlib
import importlib.metadata
import json
import os
import platform
from pathlib import Path

Rows = list[dict[str, object]]


def main() -> None:
    """Runs every comparison and writes `<date>.md` and `<date>.json`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer rounds")
    parser.add_argument("--data", type=Path, default=os.environ.get("JACOFLOW_DATA"), help="folder of recordings with truth")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results", help="where the table goes")
    parser.add_argument("--simd", default="avx2", help="instruction set of our side: scalar, avx2 or avx512")
    options = parser.parse_args()
    # Read once, when the compiled part is first used.
    os.environ["JACOFLOW_SIMD"] = options.simd

    rounds = 3 if options.quick else 10
    import accuracy
    import filter_speed
    import flow_speed

    sections: dict[str, Rows] = {
        "Flow per second, 640 x 480": flow_speed.speed(rounds),
        "Flow filter, microseconds per pixel and frame, 640 x 480": filter_speed.speed(max(2, rounds // 2)),
        "Flow filter, agreement with the reference": filter_speed.agreement(60 if options.quick else 400),
    }
    if options.data is not None:
        sections["Accuracy on recordings"] = accuracy.table(Path(options.data))
    machine = describe_machine(options.simd)
    date = datetime.date.today().isoformat()
    options.out.mkdir(parents=True, exist_ok=True)
    text = markdown(date, machine, sections)
    (options.out / f"{date}.md").write_text(text, encoding="utf-8")
    record = {"date": date, "machine": machine, "sections": sections}
    (options.out / f"{date}.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(text)


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
    for package in ("numpy", "opencv-python-headless", "filterpy"):
        try:
            machine[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            machine[package] = "missing"
    return machine


def markdown(date: str, machine: dict[str, str], sections: dict[str, Rows]) -> str:
    """The tables as text."""
    parts = [f"# Comparison of {date}", "", ", ".join(f"{key} {value}" for key, value in machine.items()) + ".", ""]
    parts += ["Written by `python benchmarks/compare.py`. Times: CPU time of the busiest thread.", ""]
    for title, rows in sections.items():
        parts += [f"## {title}", ""]
        if not rows:
            parts += ["Skipped: the rival is missing.", ""]
            continue
        columns = list(dict.fromkeys(key for row in rows for key in row))
        parts.append("| " + " | ".join(name.replace("_", " ") for name in columns) + " |")
        parts.append("|" + "---|" * len(columns))
        parts += ["| " + " | ".join(show(row.get(name)) for name in columns) + " |" for row in rows]
        parts.append("")
    return "\n".join(parts)


def show(value: object) -> str:
    """A table cell."""
    if value is None:
        return "rival missing"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    return str(value)


if __name__ == "__main__":
    main()
