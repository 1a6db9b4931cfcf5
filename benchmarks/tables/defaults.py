"""Which rows and how much smoothing the windowed estimator should have by default: error and coverage on scenes with exact truth.

Usage: python -m benchmarks.tables.defaults [--noise 1 4]

Each line: root mean square error of the flow (px/frame) and of the four derivatives (1/frame), and the share of components whose error is below two of their
standard deviations (.954 for normal errors that are fully described). Frames have 8 bits; a margin of 20 px is left out.
"""

import argparse
import itertools

import numpy as np

import jacoflow
from jacoflow import scenes

MARGIN = 20
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


def measure(name: str, carrier: str | None, noise: float, options: dict) -> tuple[float, float, float, float]:
    """Errors of flow and Jacobian, and coverage of both, in the middle of three frames."""
    scene = scenes.Scene(name, width=128, height=112, random_state=5, carrier=carrier)
    camera = scenes.Sensor(noise=noise, rounding="nearest", saturate=True, random_state=1)
    frames = [camera.apply_u8(scene.frame(t), index) for index, t in enumerate((-1.0, 0.0, 1.0))]
    field, truth = jacoflow.estimate(frames, **options), scene.truth(0.0)
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--noise", type=float, nargs="+", default=[1.0, 4.0], help="grey levels")
    noises = parser.parse_args().noise
    choices = [
        dict(rows=rows, smooth=smooth)
        for rows, smooth in itertools.product(("brightness", "gradient", "all"), (0.0, 1.0, 1.5, 2.0))
    ]
    totals = np.zeros((len(choices), 2))
    print("| scene | carrier | noise | rows | smooth, px | flow rms | Jacobian rms | within 2 sd: flow | Jacobian |")
    print("|---|---|---|---|---|---|---|---|---|")
    for (name, carrier), noise in itertools.product(SCENES, noises):
        results = [measure(name, carrier, noise, options) for options in choices]
        for options, (flow, jacobian, held, held_jacobian) in zip(choices, results, strict=True):
            print(
                f"| {name} | {carrier or '-'} | {noise:g} | {options['rows']} | {options['smooth']:g} "
                f"| {flow:.4f} | {jacobian:.4f} | {held:.2f} | {held_jacobian:.2f} |",
                flush=True,
            )
        errors = np.array(results)[:, :2]
        totals += np.log(errors / errors.min(0))
    print("\nError relative to the best choice of each scene, geometric mean over the scenes:\n")
    print("| rows | smooth, px | flow | Jacobian |\n|---|---|---|---|")
    for options, (flow, jacobian) in zip(choices, np.exp(totals / (len(SCENES) * len(noises))), strict=True):
        print(f"| {options['rows']} | {options['smooth']:g} | {flow:.2f} | {jacobian:.2f} |")


if __name__ == "__main__":
    main()
