"""Which rows and how much smoothing the windowed estimator should have by default: error and coverage on
scenes with exact truth.

    python -m benchmarks.tables.defaults

Each line: root mean square error of the flow (px/frame) and of the four derivatives (1/frame), and the share
of components whose error is below two of their standard deviations (.954 for normal errors that are fully
described). Frames have 8 bits; a margin of 20 px is left out.
"""

import itertools
from typing import Any

import numpy as np

import jacoflow
from benchmarks import report
from jacoflow import scenes

Row = dict[str, object]
MARGIN = 20
NOISES = (1.0, 4.0)
"""Grey levels."""
SCENES = [
    ("affine", "noise"),
    ("affine", "speckle"),
    ("affine", "particles"),
    ("vortex", "noise"),
    ("vortex", "speckle"),
    ("vortex", "particles"),
    ("shear", "noise"),
    ("turbulence", "noise"),
    ("disc", None),
    ("plane", None),
]


def measure(
    name: str, carrier: str | None, noise: float, options: dict[str, Any]
) -> tuple[float, float, float, float]:
    """Errors of flow and Jacobian, and coverage of both, in the middle of three frames."""
    scene = scenes.Scene(name, width=128, height=112, random_state=5, carrier=carrier)
    camera = scenes.Sensor(noise=noise, rounding="nearest", saturate=True, random_state=1)
    frames = [camera.apply_u8(scene.frame(t), index) for index, t in enumerate((-1.0, 0.0, 1.0))]
    method = jacoflow.Windowed(rows=options["rows"])
    field = jacoflow.flow(*frames, method=method, preprocess=jacoflow.Preprocess(smooth=options["smooth"]))
    truth = scene.truth(0.0)
    inner = np.zeros(field.shape, bool)
    inner[MARGIN:-MARGIN, MARGIN:-MARGIN] = True
    known = inner & field.valid & truth.valid
    names = field.parameters
    errors = np.stack([field.value(name)[known] - truth.value(name)[known] for name in names], -1)
    deviations = np.stack([field.std(name)[known] for name in names], -1)
    held = np.abs(errors) < 2 * deviations
    flow, jacobian = errors[:, :2], errors[:, 2:]
    return (
        float(np.sqrt((flow**2).sum(1).mean())),
        float(np.sqrt((jacobian**2).mean())),
        float(held[:, :2].mean()),
        float(held[:, 2:].mean()),
    )


def choices() -> list[dict[str, Any]]:
    """Options that are compared."""
    return [
        dict(rows=rows, smooth=smooth)
        for rows, smooth in itertools.product(("brightness", "gradient", "all"), (0.0, 1.0, 1.5, 2.0))
    ]


def table() -> list[Row]:
    """One row for each scene, noise and choice."""
    rows: list[Row] = []
    for (name, carrier), noise, options in itertools.product(SCENES, NOISES, choices()):
        flow, jacobian, held, held_jacobian = measure(name, carrier, noise, options)
        row: Row = {"scene": name, "carrier": carrier or "-", "noise": noise, **options}
        row |= {"flow rms": flow, "Jacobian rms": jacobian}
        rows.append(row | {"flow within 2 sd": held, "Jacobian within 2 sd": held_jacobian})
    return rows


def summary() -> list[Row]:
    """Error relative to the best choice of each scene, geometric mean over the scenes."""
    totals = np.zeros((len(choices()), 2))
    for (name, carrier), noise in itertools.product(SCENES, NOISES):
        errors = np.array([measure(name, carrier, noise, options)[:2] for options in choices()])
        totals += np.log(errors / errors.min(0))
    means = np.exp(totals / (len(SCENES) * len(NOISES))).tolist()
    return [{**options, "flow": f, "Jacobian": j} for options, (f, j) in zip(choices(), means, strict=True)]


TABLES = {
    "scenes": report.Table("Windowed estimator, choice of rows and smoothing", lambda _: table()),
    "summary": report.Table(
        "Windowed estimator, errors relative to the best choice of each scene", lambda _: summary()
    ),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
