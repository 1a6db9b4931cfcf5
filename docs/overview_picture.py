"""Draw the README's picture, docs/images/overview.png, from an embedded scene.

Usage: python docs/overview_picture.py (needs jacoflow[plot])
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

import jacoflow  # noqa: E402
from jacoflow import plot  # noqa: E402

TARGET = Path(__file__).resolve().parent / "images" / "overview.png"


def main() -> None:
    scene = jacoflow.scenes.Scene("vortex", width=200, height=150, core=30, circulation=200)
    frames = scene.frames(3)
    field = jacoflow.flow(*frames)
    figure, axes = pyplot.subplots(1, 4, figsize=(14, 3.1), layout="constrained")
    plot.quiver(field, frame=frames[1], axes=axes[0])
    plot.flow_colour(field, axes=axes[1], max_speed=0.8)
    # One scale for both, so that the pictures can be compared.
    plot.divergence(field, axes=axes[2], limit=0.07)
    plot.curl(field, axes=axes[3], limit=0.07)
    for axis in axes:
        axis.set_xticks([])
        axis.set_yticks([])
    TARGET.parent.mkdir(exist_ok=True)
    figure.savefig(TARGET, dpi=100)
    print(TARGET.name)


if __name__ == "__main__":
    main()
