"""Groups of options for `estimate`, `FlowEstimator` and `FlowFilter`.

Objects without checks: the function that takes them checks them and names the option in its message.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "CoarseToFine",
    "FilterProfile",
    "HornSchunck",
    "Instantaneous",
    "LucasKanade",
    "Preprocess",
    "Recursive",
    "SamplingGrid",
    "Windowed",
]


@dataclass(frozen=True, kw_only=True)
class CoarseToFine:
    """Transported equations with a pyramid, warping and robust coupling of neighbours.

    For motions of many pixels, edges and untextured areas. The error bars are calibrated on synthetic scenes
    and too small on many real recordings. The string "coarse_to_fine" means the defaults.
    """

    method: ClassVar[str] = "coarse_to_fine"
    preset: Literal["fast", "balanced", "accurate"] | None = None
    """Cost against error; default "balanced". "fast" finds the motion at half the resolution and loses detail
    of a few px; "accurate" iterates more."""
    levels: int | None = None
    """Pyramid levels; default as many as the frame allows."""
    time_scheme: Literal["forward", "central", "pair"] | None = None
    """How time derivatives are taken. "forward" (default): motion from the middle frame of three to the next
    one; the frame before it helps where the motion is steady. "central": mean of the steps before and after,
    the velocity at the middle frame. "pair": motion from the first of two frames to the second, the default
    where there are only two."""


@dataclass(frozen=True, kw_only=True)
class Windowed:
    """Least squares of the transported equations in one Gaussian window.

    For texture that moves by a pixel or two. The string "windowed" means the defaults.
    """

    method: ClassVar[str] = "windowed"
    window_sigma: float | None = None
    """Standard deviation of the window, px; default 4."""
    rows: Literal["brightness", "gradient", "jet", "all"] | None = None
    """Equations summed at each pixel: 1, 3, 6 or 12; default "all", for pairs "gradient"."""
    neighbourhood: tuple[int, int] | ArrayLike | None = None
    """Pixels that the local quadratic is fitted to: (columns, rows), or offsets (x, y), array (N, 2), px;
    default 3 x 3."""
    neighbourhood_sigma: float | None = None
    """Standard deviation of their Gaussian weights, px; default equal weights."""
    rank_deficient: Literal["nan", "min_norm"] | None = None
    """Result where the equations do not determine every unknown; default "nan"."""
    time_scheme: Literal["central", "backward", "pair"] | None = None
    """Time derivatives at the middle frame of three (default), at the newest of three, or of two frames."""


@dataclass(frozen=True, kw_only=True)
class Instantaneous:
    """Flow and Jacobian of each pixel by itself, WO2010/098160 (34).

    For locally quadratic, nearly noise-free images. The string "instantaneous" means the defaults.
    """

    method: ClassVar[str] = "instantaneous"
    model: Literal["affine", "translational", "accelerating"] | None = None
    """Motion model; default "affine"."""
    neighbourhood: tuple[int, int] | ArrayLike | None = None
    """As in `Windowed`."""
    neighbourhood_sigma: float | None = None
    """As in `Windowed`, px."""
    rank_deficient: Literal["nan", "min_norm"] | None = None
    """As in `Windowed`."""
    time_scheme: Literal["central", "backward"] | None = None
    """Time derivatives at the middle frame of three (default) or at the newest."""


@dataclass(frozen=True, kw_only=True)
class LucasKanade:
    """Baseline: flow constant in a window. The string "lucas_kanade" means the defaults."""

    method: ClassVar[str] = "lucas_kanade"
    window_sigma: float | None = None
    """Standard deviation of the window, px; default 4."""
    time_scheme: Literal["central", "pair"] | None = None
    """Differences of three frames (default) or of two."""


@dataclass(frozen=True, kw_only=True)
class HornSchunck:
    """Baseline: globally smooth flow, without covariance. The string "horn_schunck" means the defaults."""

    method: ClassVar[str] = "horn_schunck"
    smoothness: float | None = None
    """Weight of smoothness, in units of the frame's root mean square gradient; default 1."""
    iterations: int | None = None
    """Maximum number of iterations."""
    time_scheme: Literal["central", "pair"] | None = None
    """Differences of three frames (default) or of two."""


@dataclass(frozen=True, kw_only=True)
class Recursive:
    """Fusion of the estimates of all frames so far, for motion that is steady in the picture.

    An information filter on m = (u, v, u_x, v_x, u_y, v_y) at each pixel: P_k^-1 = f P_{k-1}^-1 + C_k^-1, x_k
    = x_{k-1} + P_k C_k^-1 (m_k - x_{k-1}), with the estimate m_k of each time, its covariance C_k and f =
    `forgetting`. It starts with the first estimate. Noise falls with the number of frames, systematic error
    does not; the covariance holds both. Where the motion changes, a pixel restarts (normalised innovation
    squared above 27.86) or shortens its memory. Times without an estimate get the prediction and status
    PREDICTED. Needs the covariance.
    """

    forgetting: float | None = None
    """Factor f, above 0 and at most 1 (no unit): the memory is 1 / (1 - f) frames; default 0.95."""


@dataclass(frozen=True, kw_only=True)
class SamplingGrid:
    """Where to estimate: at the pixels of a grid, or at single points. Nothing else is computed."""

    region: Sequence[int] | NDArray[np.integer[Any]] | None = None
    """Rectangle (x, y, width, height), px; default the frame."""
    stride: int | None = None
    """Distance between columns and between rows, px; default 1."""
    points: ArrayLike | None = None
    """Pixels (x, y), int array (N, 2), px, in place of a grid; arrays of the result are (..., N)."""


@dataclass(frozen=True, kw_only=True)
class Preprocess:
    """What is done to each frame first."""

    quantise: float | None = None
    """Rounds samples down to multiples of this, grey levels, before smoothing; default none."""
    smooth: float | None = None
    """Standard deviation of a Gaussian, px, 0 for none; default 1.5 for "windowed", none for all others."""
    colour: Literal["error", "luminance"] | None = None
    """What to do with colour frames (H, W, 3 or 4); default "error"."""


@dataclass(frozen=True)
class FilterProfile:
    """Constants of a `FlowFilter`: a set of them by name, with single ones replaced.

    States are q = (I, Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y) in 8-bit grey levels, px and frames.

    `form` "fast" (13 sigma points) has the numbers of "non_augmented" (25) with `square_root="motion_first"`,
    not those of its default "brightness_first", which is filterpy's order. With the profile "measured" they
    follow the patent's ramp equally well (rms error of u within 0.3 %); with "patent" use "augmented" or
    "non_augmented": the rms error of u is 0.063 px/frame there and 0.30 px/frame with "fast".
    """

    name: Literal["patent", "measured"] = "patent"
    """"patent": constants of WO2010/098160; "measured": those for raw 8-bit frames (9 x 9 pixels)."""
    form: Literal["augmented", "non_augmented", "fast", "extended"] | None = None
    """Form of the prediction."""
    transition: Literal["rk4", "exact"] | None = None
    """State transition."""
    square_root: Literal["brightness_first", "motion_first"] | None = None
    """Order of the square root that spreads the sigma points."""
    neighbourhood: tuple[int, int] | ArrayLike | None = None
    """Pixels of one measurement, as in `Windowed`."""
    neighbourhood_sigma: float | None = None
    """As in `Windowed`, px."""
    Q: ArrayLike | None = None
    """Process noise: variances per frame, shape (12,)."""
    R: float | None = None
    """Measurement noise: variance of one pixel, 8-bit grey levels squared."""
    adaptive: bool | None = None
    """Take the noise from the residual of each fit where it exceeds that of `R`, and start the brightness
    anew where a frame contradicts the prediction; default True. False: the patent's filter for all frames."""
    x0: ArrayLike | None = None
    """Mean before the first frame, shape (12,)."""
    P0: ArrayLike | None = None
    """Variances before the first frame, shape (12,)."""
    alpha: float | None = None
    """Spread of the sigma points (no unit)."""
    beta: float | None = None
    """Weight of the central covariance (no unit)."""
    kappa: float | None = None
    """Second scale of the sigma points (no unit)."""
    full_scale: float | None = None
    """Sample value of 255 grey levels; default 255, for uint16 frames 65535."""


FlowMethod = (
    Literal["coarse_to_fine", "windowed", "instantaneous", "lucas_kanade", "horn_schunck"]
    | CoarseToFine
    | Windowed
    | Instantaneous
    | LucasKanade
    | HornSchunck
)
"""A method by name, with its defaults, or with options."""

Fusion = Literal["none", "recursive"] | Recursive
"""Fusion over time."""

