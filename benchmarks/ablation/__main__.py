"""Switches each heuristic off and prints what that costs.

    make ablation ARGUMENTS="--only edges"
    python -m benchmarks.ablation [--only SYSTEM or SYSTEM.RULE ...] [--keep FILE] [--data FOLDER] [--jobs N]

Needs jacoflow built with the feature `ablation`. Every run is a child process on one thread with the
environment variable JACOFLOW_WITHOUT; `--jobs` of them run at once. `--keep` names a JSON file: runs that it
holds are not repeated, new ones are added to it. The difference is "without minus with", paired by scene or
seed, with its standard error. Verdict: a heuristic `pays` if some row is worse without it by more than two
standard errors, or if a test fails that passes with it (row `tests`); it `harms` if none is worse and some
row is better by as much; else it has `no effect`. Times (`ms`) are shown only: the runs of a pair lie minutes
apart, and what else the machine does differs.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks import report

Values = dict[str, list[float]]
THRESHOLD = 2.0
"""Standard errors from which on a difference counts."""
RESULT = "RESULT "
"""First word of the line of results that a child prints."""
PROGRAM = f"""
import importlib, json, sys
print({RESULT!r} + json.dumps(importlib.import_module(sys.argv[1]).rows()))
"""


def main() -> None:
    """Prints a table for each heuristic and a summary."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", help="systems (`edges`) or heuristics (`edges.contrast`)")
    parser.add_argument("--keep", type=Path, help="JSON file of the runs, read and added to")
    parser.add_argument(
        "--data", default=os.environ.get("JACOFLOW_DATA"), help="folder of recordings with truth"
    )
    parser.add_argument("--jobs", type=int, default=1, help="runs at once (default 1)")
    options = parser.parse_args()
    chosen = {
        name: why for name, why in heuristics() if options.only is None or is_chosen(name, options.only)
    }
    chosen = {name: why for name, why in chosen.items() if has_rows(system_of(name))}
    values = all_values([*dict.fromkeys(map(system_of, chosen)), *chosen], options)
    summary: report.Rows = []
    for name, why in chosen.items():
        system = system_of(name)
        larger = getattr(importlib.import_module(f"benchmarks.ablation.{system}"), "LARGER_IS_BETTER", ())
        with_it, without = values[system], values[name]
        if isinstance(with_it, str) or isinstance(without, str):
            problem = with_it if isinstance(with_it, str) else without
            summary.append({"heuristic": name, "purpose": why, "verdict": f"failed: {problem}"})
            continue
        rows = comparison(with_it, without, larger)
        said = verdict(rows)
        print(
            f"## {name}: {why}\n\n" + "\n".join(report.table_lines(rows)) + f"\n\n{said}\n",
            flush=True,
        )
        summary.append({"heuristic": name, "purpose": why, "verdict": said})
    print("## Summary\n\n" + "\n".join(report.table_lines(summary)))


def heuristics() -> list[tuple[str, str]]:
    """Names and purposes of those that can be switched off."""
    from jacoflow import _jacoflow

    if not hasattr(_jacoflow, "heuristics"):
        sys.exit("jacoflow: expected a build with the feature `ablation` (make ablation), got one without")
    found: list[tuple[str, str]] = _jacoflow.heuristics()
    return found


def is_chosen(name: str, only: Sequence[str]) -> bool:
    """Whether a heuristic or its system is listed."""
    return name in only or name.split(".")[0] in only


def system_of(name: str) -> str:
    """First part of a heuristic's name."""
    return name.split(".")[0]


def has_rows(system: str) -> bool:
    """Whether there is a module for the system."""
    return importlib.util.find_spec(f"benchmarks.ablation.{system}") is not None


def all_values(keys: Sequence[str], options: argparse.Namespace) -> dict[str, Values | str]:
    """The rows of systems (`edges`) and of systems without a heuristic (`edges.contrast`), or what went
    wrong."""
    keep: Path | None = options.keep
    known: dict[str, Values] = json.loads(keep.read_text()) if keep and keep.exists() else {}
    values: dict[str, Values | str] = {}

    def find(key: str) -> Values | str:
        if key in known:
            return known[key]
        try:
            return run(system_of(key), key if "." in key else "", options.data)
        except subprocess.CalledProcessError as problem:
            return f"exit status {problem.returncode}"

    with ThreadPoolExecutor(options.jobs) as pool:
        for key, found in zip(keys, pool.map(find, keys), strict=True):
            values[key] = found
            if keep and not isinstance(found, str):
                known[key] = found
                keep.write_text(json.dumps(known, indent=1) + "\n")
    return values


def run(system: str, without: str, data: str | None) -> Values:
    """The rows of a system with one heuristic switched off (`""`: none), from a process of its own."""
    environment = {**os.environ, "JACOFLOW_WITHOUT": without, "JACOFLOW_THREADS": "1"}
    if data:
        environment["JACOFLOW_DATA"] = str(data)
    command = [sys.executable, "-c", PROGRAM, f"benchmarks.ablation.{system}"]
    output = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout
    line = next(line for line in output.splitlines() if line.startswith(RESULT))
    found: Values = json.loads(line.removeprefix(RESULT))
    return found


def comparison(with_it: Values, without: Values, larger_is_better: Sequence[str]) -> report.Rows:
    """One row for each figure: means, paired difference, its standard error, and whether it is better or
    worse."""
    rows: report.Rows = []
    for name, before in with_it.items():
        after = without[name]
        differences = [b - a for a, b in zip(before, after, strict=True)]
        mean, error = report.mean_and_error(differences)
        loss = -mean if name in larger_is_better else mean
        is_clear = abs(mean) > THRESHOLD * error
        effect = ("worse" if loss > 0 else "better") if is_clear else "-"
        if name == "tests":
            effect = "worse" if min(differences, default=0.0) < 0 else "-"
        ends = {"with": report.mean_and_error(before)[0], "without": report.mean_and_error(after)[0]}
        rows.append(
            {
                "row": name,
                "n": len(before),
                **ends,
                "difference": mean,
                "standard error": error,
                "without it": effect,
            }
        )
    return rows


def verdict(rows: Sequence[Mapping[str, object]]) -> str:
    """`pays`, `harms` or `no effect`, with the rows that say so; times do not count."""
    rows = [row for row in rows if not str(row["row"]).endswith("ms")]
    for effect, word in (("worse", "pays"), ("better", "harms")):
        if found := [str(row["row"]) for row in rows if row["without it"] == effect]:
            return f"{word}: {', '.join(found)}"
    same = all(row["difference"] == 0.0 for row in rows)
    return "no effect" + (", results are the same" if same else "")


if __name__ == "__main__":
    main()
