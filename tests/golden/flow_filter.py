"""Writes flow_filter.json: the reference experiment run by filterpy (benchmarks/rivals/flow_filter.py), means
at some frames.

    python tests/golden/flow_filter.py
"""

import sys
from pathlib import Path

import numpy as np

here = Path(__file__).parent
sys.path.insert(0, str(here.parent.parent))
from benchmarks.rivals.flow_filter import Settings, ramp_measurements, run  # noqa: E402
from record import write  # noqa: E402

FRAMES = [0, 1, 2, 3, 5, 10, 20, 50, 100, 200, 300, 399]


def main() -> None:
    """Runs both forms over 400 frames."""
    measurements = ramp_measurements(400)
    record = {"frames": FRAMES, "measurements": {str(t): measurements[t].tolist() for t in (0, 1, 399)}}
    for name in ("augmented", "non_augmented"):
        means, covariances = run(measurements, Settings.patent(), augmented=name == "augmented")
        record[name] = {
            "means": means[FRAMES].tolist(),
            "variances": np.diagonal(covariances[FRAMES], axis1=1, axis2=2).tolist(),
        }
    write(here / "flow_filter.json", record)


if __name__ == "__main__":
    main()
