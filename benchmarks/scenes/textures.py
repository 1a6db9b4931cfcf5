"""Backgrounds and figures of the tracking scenes, rendered by area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Array = NDArray[np.floating]
SIZE = 256
"""Width and height of the frames, px."""
SAMPLES = 8
"""Samples of a pixel along each axis."""


def background(kind: str, seed: int, size: int = SIZE) -> Array:
    """A still picture (size, size), grey levels 0 to 255, that continues itself across its edges.

    `smooth:s,m,d` is white noise smoothed by a Gaussian of s px, `fractal:b,m,d` white noise with its
    spectrum divided by the b-th power of the frequency; both have mean m and standard deviation d before they
    are clipped. `flat:m` is one grey level.
    """
    name, _, numbers = kind.partition(":")
    values = [float(number) for number in numbers.split(",")]
    if name == "flat":
        return np.full((size, size), values[0])
    amount, mean, deviation = values
    white = np.random.default_rng(seed).standard_normal((size, size))
    if name == "smooth":
        raw = ndimage.gaussian_filter(white, amount, mode="wrap")
    elif name == "fractal":
        raw = _divided_by_frequency(white, amount)
    else:
        raise ValueError(f"kind: smooth, fractal or flat expected, {name!r} given")
    return np.clip(mean + deviation * (raw - raw.mean()) / raw.std(), 0.0, 255.0)


def _divided_by_frequency(white: Array, power: float) -> Array:
    """White noise with its spectrum divided by |f|^power; its mean is left out."""
    along = np.fft.fftfreq(len(white))
    frequency = np.hypot(along[:, None], along)
    frequency[0, 0] = np.inf
    return np.fft.ifft2(np.fft.fft2(white) / frequency**power).real


def shifted(picture: Array, dx: float, dy: float) -> Array:
    """The picture moved by (dx, dy) px, x right, y down, what leaves on one side coming back on the other:
    exact for whole pixels, else by cubic splines."""
    if dx == round(dx) and dy == round(dy):
        return np.roll(picture, (round(dy), round(dx)), axis=(0, 1))
    return np.clip(ndimage.shift(picture, (dy, dx), order=3, mode="grid-wrap"), 0.0, 255.0)


def texture(side: int, mean: float, deviation: float, sigma: float, seed: int) -> Array:
    """Surface of a figure `side` px wide, grey levels, a picture with 4 px to spare on each side: noise
    smoothed by `sigma` px."""
    return background(f"smooth:{sigma},{mean},{deviation}", seed, side + 8)


@dataclass(frozen=True)
class Figure:
    """A figure in front of the background; the first axis of its arrays is time (T frames)."""

    centres: Array
    """(T, 2), x and y, px; pixel centres lie at integers."""
    sizes: Array
    """(T, 2), width and height before it is turned, px."""
    angles: Array
    """(T,), rad, from x towards y."""
    levels: Array
    """(T,), brightness, grey levels; with a surface: what its brightness is multiplied by."""
    shape: Literal["square", "disc"] = "square"
    """A rectangle or an ellipse that fills the size."""
    surface: Array | None = None
    """Its picture in its own coordinates, 1 px a sample; None: one level."""

    def boxes(self) -> Array:
        """(T, 4): x, y, width, height, px, with x = centre - width / 2; not enlarged by turning."""
        return np.concatenate([self.centres - self.sizes / 2, self.sizes], axis=1)

    def draw(self, picture: Array, t: int) -> None:
        """Lays the figure at frame `t` over the picture (H, W), in place."""
        patch = self._patch(picture.shape, t)
        if patch is None:
            return
        if self.surface is None:
            cover = self._cover(patch, t)
            light = self.levels[t] * cover
        else:
            inside, along, across = self._samples(patch, t)
            cover = _pixel_means(inside.astype(float))
            bright = np.zeros(inside.shape)
            bright[inside] = self._brightness(along[inside], across[inside])
            light = self.levels[t] * _pixel_means(bright)
        picture[patch] = picture[patch] * (1.0 - cover) + light

    def _cover(self, patch: tuple[slice, slice], t: int) -> Array:
        """Share of each pixel of the patch that it covers."""
        if self.shape != "square" or self.angles[t] != 0.0:
            return _pixel_means(self._samples(patch, t)[0].astype(float))
        # Upright: the share of the rows times the share of the columns.
        rows, columns = (
            (np.abs(_places(span) - centre) <= size / 2).reshape(-1, SAMPLES).mean(axis=1)
            for span, centre, size in zip(patch, self.centres[t][::-1], self.sizes[t][::-1], strict=True)
        )
        return rows[:, None] * columns

    def _patch(self, shape: tuple[int, ...], t: int) -> tuple[slice, slice] | None:
        """Rows and columns of the picture that it may touch."""
        c, s = abs(np.cos(self.angles[t])), abs(np.sin(self.angles[t]))
        width, height = self.sizes[t]
        reach = (s * width + c * height) / 2 + 1, (c * width + s * height) / 2 + 1
        middle = self.centres[t][::-1]
        ends = [
            (max(0, int(np.floor(m - r))), min(n, int(np.ceil(m + r)) + 1))
            for m, r, n in zip(middle, reach, shape, strict=True)
        ]
        return None if any(first >= last for first, last in ends) else (slice(*ends[0]), slice(*ends[1]))

    def _samples(self, patch: tuple[slice, slice], t: int) -> tuple[NDArray[np.bool_], Array, Array]:
        """Which samples of the patch lie on it, and where they lie along its width and height, px from its
        centre."""
        y, x = (_places(span) for span in patch)
        dx, dy = x - self.centres[t, 0], y[:, None] - self.centres[t, 1]
        c, s = np.cos(self.angles[t]), np.sin(self.angles[t])
        along, across = c * dx + s * dy, c * dy - s * dx
        half_width, half_height = self.sizes[t] / 2
        if self.shape == "disc":
            return (along / half_width) ** 2 + (across / half_height) ** 2 <= 1, along, across
        return (np.abs(along) <= half_width) & (np.abs(across) <= half_height), along, across

    def _brightness(self, along: Array, across: Array) -> Array:
        """The surface at points of its own, by linear interpolation."""
        assert self.surface is not None
        middle = (len(self.surface) - 1) / 2
        return ndimage.map_coordinates(
            self.surface, [across + middle, along + middle], order=1, mode="nearest"
        )


def _places(span: slice) -> Array:
    """Where the samples of some rows or columns lie, px."""
    return np.arange(SAMPLES * span.start, SAMPLES * span.stop) / SAMPLES + (1 / SAMPLES - 1) / 2


def _pixel_means(samples: Array) -> Array:
    """Means over the samples of each pixel."""
    rows, columns = (n // SAMPLES for n in samples.shape)
    return samples.reshape(rows, SAMPLES, columns, SAMPLES).mean(axis=(1, 3))
