"""What settings of the profile `ci` cost and buy: CPU time of compiling the library and the binding, size and
speed of the extension module.

    python -m benchmarks.build [--variants ci "1 unit" ...] [--repeats 9]

Crates that the library depends on are compiled once and left out of the cost, in a folder that is deleted at
the end. Settings apply to the library alone, without kernels for AVX-512. Columns: CPU seconds of the
compiler on library and binding, of all its threads; size of the module, stripped as in the wheel, MB; CPU
time of one flow estimate on one thread over that of the first variant. The estimates of the variants take
turns, and the least time of each counts. Where two hardware threads share a core, CPU times nearly double
while the other one works: run it on a quiet machine. Needs cargo, `strip` and numpy.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VARIANTS: dict[str, list[str]] = {
    "ci": [],
    "AVX-512": [],
    "1 unit": ["package.jacoflow.codegen-units=1"],
    "16 units": ["package.jacoflow.codegen-units=16"],
    "opt-level 2": ["package.jacoflow.opt-level=2"],
    "opt-level 1": ["package.jacoflow.opt-level=1"],
    "checked": ["package.jacoflow.overflow-checks=true", "package.jacoflow.debug-assertions=true"],
    "line tables": ["package.jacoflow.debug='line-tables-only'"],
    "lto thin": ["lto='thin'"],
    "lto thin, 1 unit": ["lto='thin'", "package.jacoflow.codegen-units=1"],
}
"""What is changed in `[profile.ci]`; "AVX-512" has its kernels too, which the check leaves out."""
ESTIMATE = """
import time, jacoflow
frames = jacoflow.scenes.Scene("vortex", width=320, height=240, random_state=1).frames(3)
jacoflow.flow(*frames, threads=1)
start = time.process_time()
jacoflow.flow(*frames, threads=1)
print(time.process_time() - start)
"""
MEASURED = "BENCHMARK_BUILD_SECONDS"
"""Environment variable with the file into which the wrapped compiler writes its CPU seconds."""


def used() -> float:
    """CPU seconds of the children of this process."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def compiled(name: str, scratch: Path) -> tuple[float, float]:
    """CPU seconds of the compiler on library and binding, and MB; leaves the package in a folder of that
    name."""
    target, into, seconds = scratch / "target", scratch / name, scratch / "seconds"
    features = "--features=avx512" if name == "AVX-512" else "--no-default-features"
    settings = [part for setting in VARIANTS[name] for part in ("--config", f"profile.ci.{setting}")]
    wrapper = scratch / "wrapper"
    wrapper.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{Path(__file__).resolve()}" --compiler "$@"\n')
    wrapper.chmod(0o755)
    seconds.unlink(missing_ok=True)
    command = ["cargo", "build", "-q", "--profile", "ci", "-p", "jacoflow-python", features]
    subprocess.run(
        [*command, *settings],
        cwd=ROOT,
        env={
            **os.environ,
            "CARGO_TARGET_DIR": str(target),
            "PYO3_BUILD_EXTENSION_MODULE": "1",
            "PYO3_PYTHON": sys.executable,
            "RUSTC_WORKSPACE_WRAPPER": str(wrapper),
            MEASURED: str(seconds),
        },
        check=True,
    )
    shutil.copytree(
        ROOT / "python" / "jacoflow", into / "jacoflow", ignore=shutil.ignore_patterns("*.so", "__pycache__")
    )
    module = into / "jacoflow" / "_jacoflow.abi3.so"
    subprocess.run(["strip", "-o", module, target / "ci" / "lib_jacoflow.so"], check=True)
    return sum(float(line) for line in seconds.read_text().split()), module.stat().st_size / 1e6


def estimated(folder: Path) -> float:
    """CPU seconds of one estimate with the package in a folder."""
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
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=os.environ.get("CARGO_TARGET_DIR")) as scratch:
        costs = {}
        for name in options.variants:
            costs[name] = compiled(name, Path(scratch))
            print(f"{name}: {costs[name][0]:.0f} CPU s", file=sys.stderr)
        times = dict.fromkeys(options.variants, float("inf"))
        for _ in range(options.repeats):
            for name in options.variants:
                times[name] = min(times[name], estimated(Path(scratch) / name))
    first = times[options.variants[0]]
    print("| variant | CPU s | MB | time of an estimate |\n|---|---|---|---|")
    for name, (cpu, size) in costs.items():
        print(f"| {name} | {cpu:.0f} | {size:.1f} | {times[name] / first:.2f} |")


def compile_and_measure(command: list[str]) -> int:
    """Runs the compiler in cargo's place and notes its CPU seconds."""
    # Open files hold the tokens by which cargo limits threads.
    returned = subprocess.run(command, check=False, close_fds=False).returncode
    with Path(os.environ[MEASURED]).open("a") as file:
        file.write(f"{used():.2f}\n")
    return returned


if __name__ == "__main__":
    if sys.argv[1:2] == ["--compiler"]:
        sys.exit(compile_and_measure(sys.argv[2:]))
    main()
