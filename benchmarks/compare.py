"""Speed and accuracy beside the usual tools, both sides in one process; writes a dated table.

    python -m benchmarks.compare [--quick] [--only SECTION ...] [--data FOLDER] [--out FOLDER] [--simd avx2]

Needs jacoflow and, for the other side, `pip install "jacoflow[bench]"`; rows whose rival is missing say so. Times are CPU time of the busiest thread, best
of several rounds taken in turns. `--data` (or the environment variable JACOFLOW_DATA) is a folder of recordings with known truth; without it their tables
are left out. `--only flow memory filter accuracy controlled coverage tracking mixture stereo stereo_tracking particle_tracking motion3d` chooses among the sections; its table is then printed and not kept,
unless `--out` names a folder: the newest table there is written anew with those sections, and the others as they were. A section tells its machine where that is another than the head's.
"""

from __future__ import annotations

import argparse
import datetime
import os
from pathlib import Path

from benchmarks.report import Record, Rows, describe_machine, newest

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


def run(name: str, quick: bool, data: Path | None) -> dict[str, Rows]:
    """The tables of one section, by title."""
    rounds = 3 if quick else 10
    if name == "flow":
        from benchmarks.tables import flow as flow_speed

        sizes = flow_speed.SIZES[:1] if quick else flow_speed.SIZES
        return {f"Flow per second, {width} x {height}": flow_speed.speed(rounds, width, height) for width, height in sizes}
    if name == "memory":
        from benchmarks.tables import memory

        width, height = (640, 480) if quick else (1920, 1080)
        title = f"Peak of resident memory, planes of one 4-byte number per pixel, {width} x {height}"
        return {title: list(memory.rows(width, height))}
    if name == "filter":
        from benchmarks.tables import filter as filter_speed

        return {
            "Flow filter, microseconds per pixel and frame, 640 x 480": filter_speed.speed(max(2, rounds // 2)),
            "Flow filter, agreement with the reference": filter_speed.agreement(60 if quick else 400),
        }
    if name == "controlled":
        from benchmarks.tables import controlled

        return {"Accuracy on scenes with exact truth": controlled.default_table(quick)}
    if name == "coverage":
        from benchmarks.tables import coverage

        return coverage.sections(quick, data)
    if name == "tracking":
        from benchmarks.tables import tracking

        return tracking.sections(quick, data)
    if name == "mixture":
        from benchmarks.tables import dirichlet_mixture, mixture

        return {
            "Weighted mixtures, a round": mixture.table(rounds),
            "Dirichlet-process mixtures: components (range), largest weight, adjusted Rand index": dirichlet_mixture.outcomes(3 if quick else 10),
            "Dirichlet-process mixtures: milliseconds of a fit on one thread (scikit-learn's time over it)": dirichlet_mixture.times(rounds),
        }
    if name == "stereo":
        from benchmarks.tables import stereo

        return stereo.sections(quick, data)
    if name == "stereo_tracking":
        from benchmarks.tables import stereo_tracking

        return stereo_tracking.sections(quick)
    if name == "particle_tracking":
        from benchmarks.tables import particle_tracking

        return particle_tracking.sections(data, recordings=(10,), runs=1) if quick else particle_tracking.sections(data)
    if name == "motion3d":
        from benchmarks.tables import motion3d

        return motion3d.sections(factor=0.1 if quick else 1.0, data=data, rounds=rounds)
    if data is None:
        return {}
    from benchmarks.tables import recordings as accuracy

    return {"Accuracy on recordings": accuracy.table(data), "Strain from image correlation": accuracy.strain(data)}


if __name__ == "__main__":
    main()
