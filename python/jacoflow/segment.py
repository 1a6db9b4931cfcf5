"""Regions of similar colour: graph segmentation of an image, and means over the regions.

Source: P. F. Felzenszwalb and D. P. Huttenlocher, "Efficient graph-based image segmentation", International
Journal of Computer Vision 59(2), 2004.

>>> import numpy as np
>>> from jacoflow import segment
>>> image = np.zeros((40, 60), np.uint8)
>>> image[:, 30:] = 100
>>> labels = segment.felzenszwalb(image, scale=50, sigma=0)
>>> segment.region_means(labels, image).tolist()
[0.0, 100.0]
"""

from __future__ import annotations

import operator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._checks import check_memory
from ._jacoflow import _felzenszwalb, _region_means

__all__ = ["felzenszwalb", "region_means"]

MAX_PIXELS = 2**30
"""Maximum number of pixels of an image, px: any larger `min_size` means one region."""


def felzenszwalb(
    image: ArrayLike, scale: float = 1, sigma: float = 0.8, min_size: int = 20, *, threads: int | None = None
) -> NDArray[np.int32]:
    """Segments an image into regions of similar colour.

    Neighbouring pixels, diagonal ones included, are joined by edges whose weight `e` is the Euclidean
    distance of their colours. In order of weight, an edge merges its two regions if `e <= min(Int_1 + k /
    |C_1|, Int_2 + k / |C_2|)` (equations (4) and (5) of the paper), where `Int` is the heaviest edge merged
    so far and `|C|` the number of pixels. Then regions smaller than `min_size` are merged in the same order.
    Edges of equal weight are taken in the order right, lower, lower right, upper right neighbour, each row by
    row.

    Parameters
    ----------
    image : array (H, W) or (H, W, 3) of uint8, uint16, float32 or float64
        White is 255, 65535 or 1. Floats beyond 1 are taken as they are: the unit of `scale` does not change.
        float64 is computed in double precision, everything else in single precision. Pixels that are
        masked or not finite are left out of the smoothing; their edges merge nothing but regions smaller
        than `min_size`, after all other edges.
    scale : levels of 255, times px
        The paper's `k`: the larger, the larger the regions. At least 0. Same unit as in scikit-image's
        function of the same name.
    sigma : px
        Standard deviation of the Gaussian that smooths every channel beforehand (reflecting border, cut off
        at 4 sigma). 0: none.
    min_size : px
        Smallest region. Larger than the image: one region.
    threads : count, or None
        Threads; the result is bit-identical for any number. None: the environment variable JACOFLOW_THREADS,
        else every processor.

    Returns
    -------
    labels : array (H, W) of int32
        Region of every pixel, 0 to n - 1, numbered in the order of their first pixels, row by row.

    ValueError names an argument that is negative, not finite or empty (an image without a finite pixel too),
    or the shape; TypeError the type of the samples.
    """
    try:
        smallest = operator.index(min_size)
    except TypeError:
        raise TypeError(f"min_size: expected an integer, got {min_size!r}") from None
    return _felzenszwalb(image, scale, sigma, max(-MAX_PIXELS, min(smallest, MAX_PIXELS)), threads)


def region_means(labels: ArrayLike, values: ArrayLike) -> NDArray[np.float64]:
    """Mean of `values` over each region.

    Parameters
    ----------
    labels : array (H, W) of integers
        Region of every pixel, as `felzenszwalb` returns it: 0 to n - 1, n being one more than the largest.
    values : array (H, W) or (H, W, C) of real numbers or booleans
        In any unit. NaN, or what is masked, is left out of the mean, channel by channel.

    Returns
    -------
    means : array (n,) or (n, C) of float64
        In the unit of `values`; NaN for a region without a number, also for one that has no pixel.
        `means[labels]` is the map of the means.

    ValueError for shapes that do not fit or labels below 0 or above 2^27; TypeError unless the labels are
    integers; MemoryError for labels whose sums (16 bytes for each number from 0 to the largest, and channel)
    do not fit into memory.
    """
    regions = np.asarray(labels)
    if regions.dtype.kind not in "iu":
        raise TypeError(f"labels: expected integers, got {regions.dtype}")
    if regions.ndim != 2:
        raise ValueError(f"labels: expected shape (H, W), got {regions.shape}")
    check_memory("labels", 8 * regions.size)
    if regions.size and regions.dtype.kind == "u" and int(regions.max()) > np.iinfo(np.int64).max:
        raise ValueError(f"labels: expected 0 to {1 << 27}, got {regions.max()}")
    numbers = np.ma.filled(values.astype(np.float64), np.nan) if isinstance(values, np.ma.MaskedArray) else np.asarray(values)
    if numbers.dtype.kind == "b":
        numbers = numbers.view(np.uint8)
    return _region_means(np.ascontiguousarray(regions, np.int64), numbers)
