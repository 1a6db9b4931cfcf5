"""What the build costs and what it buys: compile time, size and speed of the extension module, by settings of
the profile.

    python -m benchmarks.build [--variants ci thin ...] [--repeats 7]

Every variant compiles the extension and all it depends on from nothing in a folder of its own, so that it
takes minutes and a gigabyte each; the folders are deleted. Columns: seconds on the clock and of all threads;
size of the module, stripped as in the wheel, MB; time of one flow estimate over that of the first variant.
The variants take turns, and the least time of each counts. Needs cargo, `strip` and numpy.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VARIANTS: dict[str, list[str]] = {
    "ci": [],
    "lto thin": ["lto='thin'"],
    "lto off": ["lto='off'"],
    "1 unit": ["codegen-units=1"],
    "8 units": ["codegen-units=8"],
    "16 units": ["codegen-units=16"],
    "opt-level 2": ["package.jacoflow.opt-level=2"],
    "line tables": ["debug='line-tables-only'"],
    "as release": ["lto='thin'", "debug='line-tables-only'"],
    "cdylib alone": [],
}
"""What is changed in `[profile.ci]`."""
ESTIMATE = """
import time, numpy, jacoflow
frames = jacoflow.scenes.Scene("vortex", width=320, height=240, random_state=1).frames(3)
jacoflow.estimate(frames)
start = time.perf_counter()
jacoflow.estimate(frames)
print(time.perf_counter() - start)
"""


def compiled(name: str, into: Path) -> tuple[float, float, float]:
    """Seconds on the clock and of all threads, and MB; the package with its extension lies in `into`."""
    target = into / "target"
    settings = [part for setting in VARIANTS[name] for part in ("--config", f"profile.ci.{setting}")]
    kinds = ["--crate-type", "cdylib"] if name == "cdylib alone" else []
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        ["cargo", "rustc", "-q", "--profile", "ci", "--lib", "--features", "python", *settings, *kinds],
        cwd=ROOT,
        env={**os.environ, "CARGO_TARGET_DIR": str(target)},
        check=True,
    )
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    shutil.copytree(
        ROOT / "python" / "jacoflow", into / "jacoflow", ignore=shutil.ignore_patterns("*.so", "__pycache__")
    )
    module = into / "jacoflow" / "_jacoflow.abi3.so"
    subprocess.run(["strip", "-o", module, target / "ci" / "libjacoflow.so"], check=True)
    shutil.rmtree(target)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, cpu, module.stat().st_size / 1e6


def estimated(folder: Path) -> float:
    """Seconds of one estimate with the package in a folder."""
    run = subprocess.run(
        [sys.executable, "-c", ESTIMATE],
        env={**os.environ, "PYTHONPATH": str(folder)},
        cwd=folder,
        check=True,
        capture_output=True,
        text=True,
    )
    return float(run.stdout)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--variants", nargs="+", choices=VARIANTS, default=list(VARIANTS))
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=os.environ.get("CARGO_TARGET_DIR")) as scratch:
        folders = {name: Path(scratch) / name for name in options.variants}
        for folder in folders.values():
            folder.mkdir()
        costs = {name: compiled(name, folder) for name, folder in folders.items()}
        times = {name: float("inf") for name in folders}
        for _ in range(options.repeats):
            for name, folder in folders.items():
                times[name] = min(times[name], estimated(folder))
    first = times[options.variants[0]]
    print("| variant | s | CPU s | MB | time of an estimate |\n|---|---|---|---|---|")
    for name, (wall, cpu, size) in costs.items():
        print(f"| {name} | {wall:.0f} | {cpu:.0f} | {size:.1f} | {times[name] / first:.2f} |")


if __name__ == "__main__":
    main()
