"""Where the examples' pictures go: out/ in the current folder, drawn with matplotlib where there is one."""

from collections.abc import Callable
from pathlib import Path
from typing import Any


def save(name: str, draw: Callable[[Any], None], size: tuple[float, float] = (11, 4.5)) -> None:
    """Writes out/<name>.png of the figure that `draw` fills; says so where matplotlib is missing."""
    try:
        import matplotlib
    except ImportError:
        print(f"(no picture: matplotlib is missing; pip install 'jacoflow[plot]' draws out/{name}.png)")
        return
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=size, layout="constrained")
    draw(figure)
    folder = Path("out")
    folder.mkdir(exist_ok=True)
    figure.savefig(folder / f"{name}.png", dpi=110)
    pyplot.close(figure)
    print(f"picture: {folder / name}.png")


def check(what: str, measured: float, truth: float, tolerance: float) -> None:
    """Ends the example with an error when a figure is further from its truth than it should be."""
    if not abs(measured - truth) <= tolerance:
        raise SystemExit(f"{what}: measured {measured:.4g}, truth {truth:.4g}, tolerated difference {tolerance:.2g}")
