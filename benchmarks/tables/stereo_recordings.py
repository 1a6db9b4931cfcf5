"""Recorded pairs of views with a known disparity: two stills of Middlebury, one pair of KITTI 2012."""

from __future__ import annotations

from pathlib import Path

from benchmarks import report
from benchmarks.rivals import stereo
from benchmarks.scenes.recordings import read_all
from benchmarks.scenes.stereo_pairs import READERS
from benchmarks.tables.stereo import judge

try:
    import cv2
except ImportError:
    cv2 = None


def rows(data: Path, rounds: int) -> list[dict[str, object]]:
    """One row for each recording and method: rows of these cameras are aligned, only edge pixels with a
    known truth count, best truth within 2 px."""
    if cv2 is None:
        return [{"recording": "skipped: OpenCV, which reads the pictures, is missing"}]
    chosen = [
        stereo.ours("classes, rows given", method="classes", align=True),
        stereo.ours("sgm, rows given", method="sgm", align=True),
        stereo.opencv("OpenCV SGBM", stereo.semi_global, False),
        stereo.opencv("OpenCV BM 15", stereo.block_matching, False),
    ]
    found, missing = read_all(READERS, data)
    table: list[dict[str, object]] = [{"recording": f"skipped {line}"} for line in missing]
    for name, pair in found:
        for _, row in judge([pair], chosen, rounds):
            # What has no known truth says nothing of occlusions.
            row.pop("occluded")
            table.append({"recording": name, **row})
    return table


TABLES = {
    "recordings": report.Table(
        "Disparity of edge pixels, recordings",
        lambda o: [] if o.data is None else rows(o.data, report.rounds(o)),
    )
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
