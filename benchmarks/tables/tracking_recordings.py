"""Trackers on recorded sequences with boxes of their targets, beside OpenCV's."""

from __future__ import annotations

from pathlib import Path

from benchmarks import report
from benchmarks.rivals.trackers import ARGUMENTS, Tracker, chosen
from benchmarks.scenes import tracking_recordings
from benchmarks.scores.tracking import scores

Row = dict[str, object]


def recordings(data: Path, trackers: list[Tracker]) -> list[Row]:
    """Mean overlap, share of frames found and median error of the centre on recorded sequences."""
    if tracking_recordings.cv2 is None:
        return [{"recording": "skipped: OpenCV, which reads the pictures, is missing"}]
    rows: list[Row] = []
    for each in tracking_recordings.read_all(data):
        if isinstance(each, str):
            rows.append({"recording": f"skipped {each}"})
            continue
        for tracker in trackers:
            figures = scores(tracker.run(each.frames, each.start_box), each.truth)
            kept = ("mean_overlap", "success", "centre_error", "milliseconds")
            rows.append(
                {
                    "recording": each.name,
                    "frames": len(each.frames),
                    "tracker": tracker.name,
                    **{name: figures[name] for name in kept},
                }
            )
    return rows


TABLES = {
    "recordings": report.Table(
        "Tracking, recordings", lambda o: [] if o.data is None else recordings(o.data, chosen(o))
    )
}

if __name__ == "__main__":
    report.main(__doc__, TABLES, ARGUMENTS)
