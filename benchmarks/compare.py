"""Speed and accuracy beside the usual tools, both sides in one process; writes a dated file.

    python -m benchmarks.compare [--quick] [--only SECTION ...] [--data FOLDER] [--out FOLDER] [--simd avx2]

Needs jacoflow and, for the other side, `pip install "jacoflow[bench]"`; rows whose rival is missing say so.
`--data` (or JACOFLOW_DATA) is a folder of recordings with known truth; without it their tables are left out.
All sections together make a new dated file in `benchmarks/results`. With `--only` the tables are printed;
`--out FOLDER` writes them into the newest file there, beside the tables that it has.
"""

from __future__ import annotations

import importlib
import os
from pathlib import Path

from benchmarks import report

SECTIONS: dict[str, tuple[str, ...]] = {
    "flow": ("flow",),
    "disturbed": ("disturbed",),
    "limits": ("limits",),
    "memory": ("memory",),
    "filter": ("filter", "flow_filter"),
    "controlled": ("controlled",),
    "defaults": ("defaults",),
    "coverage": ("coverage",),
    "recordings": ("recordings",),
    "tracking": ("tracking_parts", "tracking", "tracking_ours", "tracking_recordings"),
    "mixture": ("mixture", "dirichlet_mixture"),
    "stereo": ("stereo", "stereo_prior", "stereo_recordings"),
    "segmentation": ("segmentation",),
    "stereo_tracking": ("stereo_tracking", "stereo_tracking_chance", "stereo_tracking_recordings"),
    "particle_tracking": ("particle_filter", "particle_tracking"),
    "motion3d": tuple(
        f"motion3d_{part}"
        for part in (
            "fixed",
            "published",
            "six",
            "claims",
            "honesty",
            "coverage",
            "layouts",
            "fields",
            "speed",
            "plain",
            "recordings",
            "drive",
            "car",
        )
    ),
}
"""Section -> modules of `benchmarks.tables`, whose `TABLES` it has."""


def main() -> None:
    """Prints the tables; writes them when they are all or a folder was named."""
    arguments = {"--simd": {"default": "avx2", "help": "instruction set of our side: scalar, avx2 or avx512"}}
    options = report.parser(__doc__, SECTIONS, arguments).parse_args()
    # Read once, when the compiled part is first used.
    os.environ["JACOFLOW_SIMD"] = options.simd
    data = None if options.data is None else Path(options.data)
    found: dict[str, report.Rows] = {}
    for section in options.only:
        for name in SECTIONS[section]:
            found |= tables_of(name, options.quick, data)
    is_whole = set(options.only) == set(SECTIONS)
    if is_whole or options.out is not None:
        report.keep(found, options.out or report.RESULTS, options.simd, alone=is_whole)


def tables_of(name: str, quick: bool, data: Path | None) -> dict[str, report.Rows]:
    """Prints the tables of a module and returns them by title."""
    module = importlib.import_module(f"benchmarks.tables.{name}")
    options = report.default_options(quick, data, getattr(module, "ARGUMENTS", {}))
    found = {}
    for table in module.TABLES.values():
        if rows := table.rows(options):
            found[table.title] = rows
            print(f"## {table.title}\n\n" + "\n".join(report.table_lines(rows)) + "\n", flush=True)
    return found


if __name__ == "__main__":
    main()
