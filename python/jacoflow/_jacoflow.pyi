"""The compiled part of jacoflow. Import `jacoflow` instead."""

import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar, Literal, Never, TypeAlias, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

from ._options import FilterProfile, FlowMethod, Fusion, Preprocess, SamplingGrid

__all__ = [
    "_run_command_line",
    "FormatError",
    "JacoflowError",
    "MissingDependencyError",
    "NotObservableError",
    "NumericalError",
    "FlowEstimator",
    "estimate",
    "flow",
    "_restore_estimator",
    "FlowField",
    "Measurement",
    "quantities",
    "_restore_field",
    "_restore_measurement",
    "_status_names",
    "ExtendedKalmanFilter",
    "GaussianFilter",
    "KalmanFilter",
    "MerweScaledSigmaPoints",
    "ParticleFilter",
    "UnscentedKalmanFilter",
    "resample",
    "_restore_extended",
    "_restore_kalman",
    "_restore_particle",
    "_restore_unscented",
    "FlowFilter",
    "_restore_filter",
    "corners",
    "point_flow",
    "luminance",
    "quantise",
    "smooth",
    "_FrameSource",
    "_kind_of",
    "_open_frames",
    "_read_pfm",
    "_read_flow",
    "_read_image",
    "_write_pfm",
    "_write_flow",
    "_write_frames",
    "_GaussMarkovFilter",
    "_GradientTracker",
    "_ParticleStep",
    "_ParticleTracker",
    "_StereoTracker",
    "_TrackGraph",
    "_classify",
    "_detect_moving_target",
    "_mixture_densities",
    "_mixture_dirichlet_densities",
    "_mixture_dirichlet_fit",
    "_mixture_fit",
    "_mixture_partial_fit",
    "_motion3d_bound",
    "_motion3d_contact_map",
    "_motion3d_essential",
    "_motion3d_estimate",
    "_motion3d_estimate_field",
    "_motion3d_field_points",
    "_motion3d_focus",
    "_motion3d_predict",
    "_motion3d_lateral",
    "_motion3d_lateral_bound",
    "_observability",
    "_restore_gradient_tracker",
    "_restore_particle_step",
    "_restore_particle_tracker",
    "_restore_stereo_tracker",
    "_write_particle_tracks",
    "_felzenszwalb",
    "_region_means",
    "_edge_disparity",
    "_check_camera",
    "_edge_pixels",
    "_estimate_row_offset",
    "_read_disparity",
    "_write_disparity",
    "Scene",
    "Sensor",
    "TargetScene",
    "_scene_carriers",
    "_scene_names",
    "_scene_parameters",
    "_target_scene_names",
    "__version__",
]

__version__: str

_Floats: TypeAlias = NDArray[np.floating[Any]]
_Path: TypeAlias = str | os.PathLike[str]
_Frame: TypeAlias = NDArray[Any]
_Frames: TypeAlias = NDArray[Any] | Iterable[NDArray[Any]]
_Rectangle: TypeAlias = Sequence[int] | NDArray[np.integer[Any]]
_Precision: TypeAlias = Literal["float32", "float64"]
_Simd: TypeAlias = Literal["scalar", "avx2", "avx512"]
_Progress: TypeAlias = bool | Callable[[int, int], object]
_Callback: TypeAlias = Callable[..., ArrayLike]
_Function: TypeAlias = Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike]
_Items: TypeAlias = Sequence[ArrayLike | None] | NDArray[Any]

class JacoflowError(Exception):
    """Base class of the errors that are jacoflow's own (bad arguments are ValueError or TypeError, files OSError)."""

class FormatError(JacoflowError):
    """A file's content is not what its format demands."""

class NotObservableError(JacoflowError):
    """The combination asked for cannot be determined from brightness, whatever the frames show."""

class NumericalError(JacoflowError):
    """A computation lost its numerical footing."""

class MissingDependencyError(JacoflowError):
    """A program or optional package that the request needs is not installed."""

@final
class FlowField:
    """Flow with its Jacobian, covariance and status: the result of every estimator.

    Arrays have the site axes (H, W), (N,) for points, with a leading T for a stack; `field[t]` is one field
    of a stack. Flow in px/frame, derivatives in 1/frame (or in units of `pixel_pitch`). NaN where `status`
    says why. Most arrays are read-only views that share memory.
    """
    @property
    def flow(self) -> _Floats:
        """Flow, array (..., H, W, 2): (u, v) along x (right) and y (down), in `unit("u")`: px/frame, lengths in
        `length_unit` with a pixel pitch, times in seconds with a frame period.

        NaN where `status` says why. A read-only view.
        """
    @property
    def jacobian(self) -> _Floats:
        """Jacobian of the flow, array (..., H, W, 2, 2) in 1/frame or 1/s: [[u_x, u_y], [v_x, v_y]].

        A read-only view; zeros where the model assumes no derivatives.
        """
    @property
    def u(self) -> _Floats:
        """Flow along x (right), array (..., H, W), in `unit("u")`, px/frame by default."""
    @property
    def v(self) -> _Floats:
        """Flow along y (down), array (..., H, W), in `unit("u")`, px/frame by default."""
    @property
    def u_x(self) -> _Floats:
        """du/dx, array (..., H, W), 1/frame or 1/s."""
    @property
    def v_x(self) -> _Floats:
        """dv/dx, array (..., H, W), 1/frame or 1/s."""
    @property
    def u_y(self) -> _Floats:
        """du/dy, array (..., H, W), 1/frame or 1/s."""
    @property
    def v_y(self) -> _Floats:
        """dv/dy, array (..., H, W), 1/frame or 1/s."""
    @property
    def covariance(self) -> _Floats | None:
        """Covariance of (u, v, u_x, v_x, u_y, v_y), array (..., H, W, 6, 6), in squares of their units; None
        if it was not requested.

        Rows and columns of parameters that the model lacks are zero. A new array at every access.
        """
    @property
    def status(self) -> NDArray[np.uint8]:
        """Status code of each site, uint8 array (..., H, W), see `Status`."""
    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where the estimate may be used, unique, complete and not contradicted, bool array (..., H, W)."""
    @property
    def residual(self) -> _Floats | None:
        """Root mean square residual of the equations, array (..., H, W), grey levels; None if the method has
        none."""
    @property
    def rank(self) -> NDArray[np.uint8] | None:
        """Rank of the equations, uint8 array (..., H, W); None if the method has none."""
    @property
    def condition(self) -> _Floats | None:
        """Condition number of the equations (largest over smallest singular value), array (..., H, W); None if
        the method has none.
        """
    @property
    def window(self) -> _Floats | None:
        """Standard deviation of the Gaussian window that the Jacobian rests on, mean of those weighed in at the
        pixel, array (..., H, W), px; None unless `method="coarse_to_fine"` with `diagnostics=True`.

        Windows are of fourth order: slopes have the noise of a plain least-squares fit in a window 0.66 times
        as wide, and bias of sixth order.
        """
    @property
    def divergence(self) -> NDArray[np.float64]:
        """Divergence L_xx + L_yy of the rate L of the step, float64 array (..., H, W), 1/frame, or 1/s with a
        frame period."""
    @property
    def curl(self) -> NDArray[np.float64]:
        """Curl L_yx - L_xy, float64 array (..., H, W), 1/frame, or 1/s with a frame period; positive turns
        clockwise on the screen."""
    @property
    def shear_magnitude(self) -> NDArray[np.float64]:
        """Shear sqrt((L_xx - L_yy)^2 + (L_xy + L_yx)^2), float64 array (..., H, W), 1/frame, or 1/s with a frame
        period."""
    @property
    def shear_axis(self) -> NDArray[np.float64]:
        """Direction of the greatest stretch, atan2(L_xy + L_yx, L_xx - L_yy) / 2, float64 array (..., H, W),
        rad in (-pi/2, pi/2], from x towards y."""
    @property
    def strain_xx(self) -> NDArray[np.float64]:
        """Stretch L_xx along x, float64 array (..., H, W), 1/frame, or 1/s with a frame period."""
    @property
    def strain_yy(self) -> NDArray[np.float64]:
        """Stretch L_yy along y, float64 array (..., H, W), 1/frame, or 1/s with a frame period."""
    @property
    def strain_xy(self) -> NDArray[np.float64]:
        """Shear strain (L_xy + L_yx) / 2, float64 array (..., H, W), 1/frame, or 1/s with a frame period."""
    @property
    def angular_velocity(self) -> NDArray[np.float64]:
        """Angular velocity (L_yx - L_xy) / 2, float64 array (..., H, W), rad/frame, or rad/s with a frame
        period."""
    @property
    def rpm(self) -> NDArray[np.float64]:
        """Angular velocity, float64 array (..., H, W), revolutions per minute; ValueError without fps or
        frame_period."""
    @property
    def rotation_centre(self) -> NDArray[np.float64]:
        """The point that does not move, p - M^-1 (u, v), float64 array (..., H, W, 2): (x, y) in px, or units of
        the pixel pitch.

        It need not be in the picture. NaN where there is none. `value` and `std` take its parts,
        rotation_centre_x and rotation_centre_y.
        """
    @property
    def centre_distance(self) -> NDArray[np.float64]:
        """Distance of the point that does not move, float64 array (..., H, W), px, or units of the pixel pitch."""
    @property
    def time_to_contact(self) -> NDArray[np.float64]:
        """Time from the field's frame to contact with a surface parallel to the image, float64 array (..., H,
        W), frames, or s with a frame period; negative while it recedes."""
    @property
    def speed(self) -> NDArray[np.float64]:
        """Speed sqrt(u^2 + v^2), float64 array (..., H, W), px/frame, or px/s with a frame period."""
    def value(self, /, name: str) -> NDArray[np.float64]:
        """The parameter or derived quantity `name`, float64 array (..., H, W), in the unit that `unit(name)`
        gives.

        Names are those of `parameters` and of `quantities()`. ValueError for another name, and for rpm
        without a frame period.
        """
    def std(self, /, name: str) -> NDArray[np.float64]:
        """Standard deviation of the parameter or derived quantity `name`, float64 array (..., H, W), in its
        unit: sqrt(g^T Cov g) with its gradient g.

        ValueError for another name and for a field without covariance.
        """
    def region_mean(
        self,
        /,
        name: str,
        region: ArrayLike | None = None,
        aggregate: Literal["inverse_variance", "median"] | None = None,
    ) -> tuple[float, float, int]:
        """Mean over a region: (value, standard deviation, number of sites) of the parameter or derived quantity
        `name`, in its unit.

        `region` None for every site, a rectangle (x, y, width, height), a disc (x, y, radius), a polygon of
        corners (N, 2), px, or a boolean mask (H, W); `aggregate` "inverse_variance" (default) weighs by the
        covariance, "median" does without. The mean motion stands at the centre of the sites (without slopes,
        that of an affine fit to the flow); derived quantities are its own: ratios, lengths and angles are
        formed after the mean is, and what noise adds to a length is taken off. The standard deviation allows
        for the correlation of neighbouring estimates, and for an error that they have in common: what they
        claim and do not scatter. A single field only; `measure` fits one motion instead, and takes stacks.
        ValueError for unknown names, regions that do not fit the frame, and for "inverse_variance" without
        covariance.
        """
    def measure(
        self, /, name: str, region: ArrayLike | None = None, *, at: ArrayLike | None = None
    ) -> Measurement:
        """The parameter or derived quantity `name` of the one affine motion that a region follows, as
        `Measurement`; for a stack at each time.

        `region` as in `region_mean`. The motion is that of more than half of the valid sites, and of more
        than those whose estimates the frames contradict, else the status is "no_dominant_motion" and the
        value NaN; with `at`, a pixel (x, y), that of the sites around it, however few they are. u and v are
        those at the region's centre, or at `at`. A site follows the motion where its flow differs by no more
        than its standard deviation and .1 px/frame explain at 99 %: motions that differ by less are not
        separated, and `std` grows with what they leave. ValueError for unknown names, a region without a site
        of the field, a pixel outside the frame, and for a field without covariance.

        >>> import jacoflow
        >>> scene = jacoflow.scenes.Scene("affine", width=96, height=64, u_x=0.01, v_y=0.01)
        >>> field = jacoflow.flow(*scene.frames(2))
        >>> found = field.measure("time_to_contact", region=(20, 16, 56, 32))
        >>> round(found.value), found.unit, found.status
        (100, 'frame', 'ok')
        """
    @overload
    def advect(self, /, points: ArrayLike, covariance: None = None) -> NDArray[np.float64]:
        """Carries points along by one frame, p + flow(p): float64 array (N, 2), px; for a stack through all its
        fields, (T + 1, N, 2), beginning with `points`. Fields at the end without a next frame are left out:
        those of T frames give where the points are at each of them, (T, N, 2).

        `points` (N, 2), columns x and y, px, are where they are at the (first) field's frame. Between sites
        the flow is bilinear in what the four sites about a point say of it by flow and Jacobian: affine
        motion is exact. NaN outside the sites, where one of them has no estimate, and from then on.

        With `covariance`, (N, 2, 2) or (2, 2) for all points, px^2, a pair: the points, and their covariance
        (N, 2, 2), for a stack (T + 1, N, 2, 2). It becomes (I + M) C (I + M)^T with the Jacobian M, plus the
        covariance of the flow there where the field has one: errors of the flow are taken as independent of
        the point's and from field to field, and as alike at neighbouring sites. Zeros begin with certain
        points.

        ValueError for a field of points, for other shapes, and for matrices that are no covariance.
        """
    @overload
    def advect(self, /, points: ArrayLike, covariance: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Carries points along by one frame, p + flow(p): float64 array (N, 2), px; for a stack through all its
        fields, (T + 1, N, 2), beginning with `points`. Fields at the end without a next frame are left out:
        those of T frames give where the points are at each of them, (T, N, 2).

        `points` (N, 2), columns x and y, px, are where they are at the (first) field's frame. Between sites
        the flow is bilinear in what the four sites about a point say of it by flow and Jacobian: affine
        motion is exact. NaN outside the sites, where one of them has no estimate, and from then on.

        With `covariance`, (N, 2, 2) or (2, 2) for all points, px^2, a pair: the points, and their covariance
        (N, 2, 2), for a stack (T + 1, N, 2, 2). It becomes (I + M) C (I + M)^T with the Jacobian M, plus the
        covariance of the flow there where the field has one: errors of the flow are taken as independent of
        the point's and from field to field, and as alike at neighbouring sites. Zeros begin with certain
        points.

        ValueError for a field of points, for other shapes, and for matrices that are no covariance.
        """
    def unit(self, /, name: str) -> str:
        """Unit of the parameter or derived quantity `name`: lengths in px or `length_unit`, times in frames, or
        in seconds with a frame period. ValueError for another name."""
    @property
    def points(self) -> NDArray[np.int64]:
        """Pixel (x, y) of each site, int64 array (H, W, 2), for a list of points (N, 2)."""
    @property
    def frame_index(self) -> int:
        """Index of the frame the estimate belongs to, counted from 0 (no unit); of the first one for a stack."""
    @property
    def frame_size(self) -> tuple[int, int]:
        """Size (width, height) of the frames, px."""
    @property
    def frame_period(self) -> float | None:
        """Seconds between frames, or None; of the first field of a stack."""
    @property
    def pixel_pitch(self) -> tuple[float, float]:
        """Physical size (dx, dy) of a pixel, 1 px or any length unit."""
    @property
    def length_unit(self) -> str:
        """Name of the unit of lengths, "px" unless there is a pixel pitch."""
    @property
    def interval(self) -> Literal["forward", "central", "instant"]:
        """What the flow at frame t is: "forward", the step to frame t + 1; "central", the mean of the steps
        before and after; "instant", the velocity at frame t (no unit)."""
    @property
    def correlation_length(self) -> float:
        """How far errors of neighbouring estimates go together, px: about exp(-d^2 / (4 l^2)) at distance d; 0
        where they are independent or it is not known. Of a stack that of the first field.
        """
    @property
    def model(self) -> str:
        """Name of the motion model (no unit)."""
    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the model's parameters; `unit(name)` gives their units."""
    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the site axes: (H, W), (N,) for points, with a leading T for a stack."""
    def save(self, /, path: _Path, *, options: str = "") -> None:
        """Writes the field; the extension of `path` chooses the format: .npz (everything, in its units), .flo,
        .png (KITTI) or .pfm (flow in px/frame only).

        A stack goes to a folder (`path` without extension) as flow_000001.npz, ... by frame index; files of
        these names after its first frame that it does not replace are removed, as they are of a longer run.
        `options` is free text kept in .npz. OSError when the file cannot be written, ValueError for another
        extension.
        """
    @staticmethod
    def from_arrays(
        flow: ArrayLike,
        covariance: ArrayLike | None = None,
        jacobian: ArrayLike | None = None,
        *,
        interval: Literal["forward", "central", "instant"] | None = None,
    ) -> FlowField:
        """The field of flow from elsewhere, px/frame: `std`, `advect`, `region_mean` and motion from flow then
        work on it: (u, v) of shape (H, W, 2), their Jacobian (H, W, 2, 2), [[u_x, u_y], [v_x, v_y]], and the
        covariance of (u, v), (H, W, 2, 2), or with a Jacobian of (u, v, u_x, v_x, u_y, v_y), (H, W, 6, 6).

        NaN, or masked, where the flow is unknown. Without a Jacobian derivatives read as zero, and
        quantities of them (`divergence`, ...) are refused. `interval` is the time over which the flow is
        taken: "forward" (default), from the field's frame to the next, "central", half the displacement from
        the frame before to the one after, or "instant", the velocity. ValueError for other shapes or names,
        and for covariances that are not symmetric, have a negative eigenvalue, or are unknown where the flow
        is known.
        """
    @staticmethod
    def load(path: _Path) -> FlowField:
        """Reads a field (H, W) from .npz, .flo, .png (KITTI) or .pfm, flow in px/frame. OSError, or FormatError
        for a damaged file.
        """
    def __len__(self, /) -> int: ...
    def __bool__(self, /) -> Literal[True]: ...
    def __getitem__(self, index: int | slice, /) -> FlowField: ...
    def __reduce__(self, /) -> tuple[Any, ...]: ...

@final
class Measurement:
    """A quantity of a region, in each field of a stack: numbers for a single field, arrays (T,) for a stack."""
    @property
    def quantity(self) -> str:
        """Name of the quantity (no unit)."""
    @property
    def unit(self) -> str:
        """Unit of `value` and `std`."""
    @property
    def value(self) -> Any:
        """The value, float or float64 array (T,), in `unit`; NaN unless the status is "ok"."""
    @property
    def std(self) -> Any:
        """Its standard deviation, float or float64 array (T,), in `unit`."""
    @property
    def share(self) -> Any:
        """Share of the region's valid sites that follow the motion, float or float64 array (T,), 0 to 1."""
    @property
    def valid_share(self) -> Any:
        """Share of the region's sites that are valid, float or float64 array (T,), 0 to 1."""
    @property
    def count(self) -> Any:
        """Sites that the motion was fitted to, int or int64 array (T,)."""
    @property
    def status(self) -> Any:
        """"ok", "no_dominant_motion" or "too_few_sites" (no unit), str or list (T,) of them."""
    @property
    def motion(self) -> NDArray[np.float64]:
        """The motion (u, v, u_x, v_x, u_y, v_y) at `centre`, float64 array (6,) or (T, 6), in the field's units."""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """Its covariance, float64 array (6, 6) or (T, 6, 6), in squares of the field's units."""
    @property
    def centre(self) -> NDArray[np.float64]:
        """Centre (x, y) of the region's sites, or the pixel `at`, float64 array (2,) or (T, 2), px."""
def estimate(
    frames: _Frames,
    *more: Never,
    ends: Literal["nan", "drop"] = "nan",
    pairs: bool = False,
    method: FlowMethod | None = None,
    initial: FlowField | ArrayLike | None = None,
    temporal: Fusion | None = None,
    covariance: bool | None = None,
    noise: float | None = None,
    diagnostics: bool = False,
    grid: SamplingGrid | None = None,
    mask: NDArray[np.bool_] | None = None,
    preprocess: Preprocess | None = None,
    fps: float | None = None,
    pixel_pitch: float | tuple[float, float] | None = None,
    length_unit: str | None = None,
    precision: _Precision | None = None,
    threads: int | None = None,
    simd: _Simd | None = None,
    progress: _Progress | None = None,
) -> FlowField:
    """Flow, its Jacobian and their covariance at every frame of a sequence.

    T frames give a FlowField of T fields, (T, H, W), in any container: field t belongs to frame
    t. Frames at the ends that lack a neighbour have NaN and the status MISSING_FRAME: with the
    default method, which gives the step to the next frame, the last; the first step is estimated
    from its two frames. Two frames are estimated as a pair (every method but "instantaneous").
    For one field from two or three frames see `flow`. Frames are uint8, uint16, float32 or float64 in
    any grey scale: the intensity gain does not change the flow. Other types are converted where that
    is exact: bool to uint8, int8, int16 and float16 to float32, wider integers up to 2^53 to float64.
    Pixels that a masked array hides are not used. float64 is computed in float64, everything else in
    float32. Inputs are never modified.

    Parameters
    ----------
    frames : array (T, H, W), list, tuple or iterator of arrays (H, W), or `jacoflow.io.frames(...)`
        Oldest first, one size, at least 3 x 3 px (`coarse_to_fine` finds nothing in frames less than
        5 px wide or high). `fps` and `pixel_pitch` are by default those of the file that
        `jacoflow.io.frames` reads, where it notes them; each field of a video is then by the time
        between its own frames.
    ends : "nan" (default) or "drop"
        "drop" leaves out the frames at the ends that lack a neighbour: two frames give one field,
        three or more (T - 2, H, W), or (T - 1, H, W) with the time scheme "pair".
    pairs : bool
        Frames of double-frame recordings, 0 and 1, 2 and 3, ...: T / 2 fields, none between pairs.
        Frames in two folders or stacks: `jacoflow.flow(a, b)` for each pair.
    method : "coarse_to_fine", "windowed", "instantaneous", "lucas_kanade", "horn_schunck", or options
        A name means the method with its defaults; `CoarseToFine` (default), `Windowed`,
        `Instantaneous`, `LucasKanade` and `HornSchunck` hold its options and say what it is for.
    initial : array (H, W, 2) of (u, v), px/frame, or `FlowField` of one frame
        Flow from elsewhere (a network, a PIV code, the frame before). "coarse_to_fine" starts from it
        where the frames agree better with it than with their own flow, and refines it. NaN: unknown.
        A stack starts every estimate from it.
    temporal : "none" (default), "recursive", or `Recursive`
        "recursive" fuses the estimates of all frames so far, for motion that is steady in the picture
        ("coarse_to_fine", "windowed", "instantaneous").
    covariance : bool
        Whether to compute the covariance of the parameters; default yes, where the method has one
        (not "horn_schunck").
    noise : float, grey levels
        Standard deviation of the pixel noise for the covariance; default from the frames.
    diagnostics : bool
        Whether to report residual, rank and condition number, and the windows that "coarse_to_fine"
        chose.
    grid : `SamplingGrid`
        Region and stride, or single points; default every pixel.
    mask : bool array (H, W)
        True where pixels may be used.
    preprocess : `Preprocess`
        Quantising, smoothing and conversion of colour, before anything else.
    fps : float, frames/s
        Times are then in seconds: flow in px/s, the Jacobian in 1/s.
    pixel_pitch : float or (dx, dy), in `length_unit`
        Size of a pixel; lengths are then in that unit.
    length_unit : str
        Its name, "mm" for example; default "length".
    precision : "float32" or "float64"
        Default: that of the frames.
    threads : int
        Default: environment variable JACOFLOW_THREADS, else every processor. Results do not depend on
        it.
    simd : "scalar", "avx2" or "avx512"
        Default: environment variable JACOFLOW_SIMD, else the best of the processor.
    progress : None, True or function (done, total)
        True draws a line on standard error; a function is called after each frame. Ctrl-C stops
        also amid a frame.

    Raises
    ------
    ValueError
        For fewer frames than the method needs, frames under 3 x 3 px or of different sizes, colour,
        and options out of range; each message names the argument.
    TypeError
        For another dtype.
    """

def flow(
    first: _Frame,
    second: _Frame,
    third: _Frame | None = None,
    *more: Never,
    method: FlowMethod | None = None,
    initial: FlowField | ArrayLike | None = None,
    temporal: Fusion | None = None,
    covariance: bool | None = None,
    noise: float | None = None,
    diagnostics: bool = False,
    grid: SamplingGrid | None = None,
    mask: NDArray[np.bool_] | None = None,
    preprocess: Preprocess | None = None,
    fps: float | None = None,
    pixel_pitch: float | tuple[float, float] | None = None,
    length_unit: str | None = None,
    precision: _Precision | None = None,
    threads: int | None = None,
    simd: _Simd | None = None,
) -> FlowField:
    """One field, flow with its Jacobian and covariance, from two or three frames.

    Two frames give the step from the first to the second, at the pixels of the first (every method
    but "instantaneous"). Three give that from the second to the third, at the pixels of the second;
    the first helps where motion is steady.

    Parameters
    ----------
    first, second, third : arrays (H, W)
        Frames, oldest first, as in `estimate`.

    The options, their units and the errors are those of `estimate`.

    >>> import jacoflow
    >>> a, b = jacoflow.scenes.Scene("affine", width=96, height=64).frames(2)
    >>> jacoflow.flow(a, b).shape
    (64, 96)
    """
@final
class FlowEstimator:
    """Flow from a stream: frames are pushed one by one, memory stays bounded.

    The options are those of `estimate`; see there for what they mean and their units. A field (H, W) comes as
    soon as three frames have (two with the time scheme "pair"). With temporal="recursive" each field is
    estimated from all frames so far. Pickles in mid-stream.
    """
    def __new__(
        cls,
        *,
        method: FlowMethod | None = None,
        initial: FlowField | ArrayLike | None = None,
        temporal: Fusion | None = None,
        covariance: bool | None = None,
        noise: float | None = None,
        diagnostics: bool = False,
        grid: SamplingGrid | None = None,
        mask: NDArray[np.bool_] | None = None,
        preprocess: Preprocess | None = None,
        fps: float | None = None,
        pixel_pitch: float | tuple[float, float] | None = None,
        length_unit: str | None = None,
        precision: _Precision | None = None,
        threads: int | None = None,
        simd: _Simd | None = None,
    ) -> FlowEstimator: ...
    def push(self, /, frame: _Frame, *, time: float | None = None) -> FlowField | None:
        """Takes the next frame (H, W), in any grey unit; returns a FlowField (px/frame) once enough frames have
        come, before that None.

        `time`, s, is when the frame was taken, for every frame or none: fields are then per second, each by
        the time between its own frames, and not `fps`. Where a frame is missing, "coarse_to_fine"
        estimates the step to the next one from two frames. A frame that raises an error (ValueError for
        another size or a time not after the last, TypeError for another dtype) is not kept. Ctrl-C stops the
        work and forgets every frame.
        """
    def reset(self, /) -> None:
        """Forgets every frame (H, W); the next one begins a new sequence, frame index 0."""
    @property
    def frames_needed(self) -> int:
        """Frames that must come before the first field (a count, no unit)."""
    @property
    def frames_pushed(self) -> int:
        """How many frames have been pushed since the start or the last reset (a count, no unit)."""
    @property
    def options(self) -> dict[str, Any]:
        """The options as a dictionary, in the units of `estimate`."""
    def __reduce__(self, /) -> tuple[Any, ...]: ...

@final
class FlowFilter:
    """Flow and Jacobian filtered in time: one small Kalman filter at each site, WO2010/098160 (44)-(55).

    Frames are pushed one by one; each gives a FlowField in px/frame and 1/frame. States are ordered q = (I,
    Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y) in 8-bit grey levels, px and frames. `profile` "patent"
    has the patent's constants, "measured" those for raw 8-bit frames (9 x 9 pixels); a `FilterProfile`
    replaces single ones. The noise adapts to frames that are not locally quadratic. The other options are
    those of `estimate`, but for the default of `precision`: float64 also where `R` is below 0.25, as in both
    profiles. Pickles in mid-stream.
    """
    def __new__(
        cls,
        *,
        profile: Literal["patent", "measured"] | FilterProfile | None = None,
        covariance: bool = True,
        grid: SamplingGrid | None = None,
        mask: NDArray[np.bool_] | None = None,
        preprocess: Preprocess | None = None,
        fps: float | None = None,
        pixel_pitch: float | tuple[float, float] | None = None,
        length_unit: str | None = None,
        precision: _Precision | None = None,
        threads: int | None = None,
        simd: _Simd | None = None,
    ) -> FlowFilter: ...
    def push(self, /, frame: _Frame) -> FlowField:
        """Takes in the next frame (H, W) and returns the FlowField after it, px/frame.

        Where a neighbourhood holds NaN or a masked pixel the filter only predicts, and the result is NaN with
        status NON_FINITE. Where the frame contradicts the prediction (black, flashed, dropped) the motion is
        that of the frames before, with status PREDICTED. ValueError for a frame of another size, TypeError
        for another dtype; the filter is then unchanged. Ctrl-C stops the work and forgets every frame.
        """
    def smooth(self, /, frames: _Frames) -> FlowField:
        """The fields of all `frames` (T, H, W), a stack of T, each from the frames before and after it.

        A two-filter smoother (Fraser and Potter, 1969): two filters with these options run through the
        frames, one of them backwards, and are joined at each frame. Less lag, and at most the variance of the
        filter. Where a frame is missing the motion is that of the frames around it, with status PREDICTED.
        The filter itself stays as it is. All frames and fields are held in memory. Ctrl-C stops it.
        ValueError for frames of different sizes, TypeError for different dtypes.
        """
    def reset(self, /) -> None:
        """Forgets every frame (H, W): the next one starts new filters."""
    @property
    def state(self) -> NDArray[np.float64] | None:
        """Means q of the filters, float64 array (H, W, 12) or (N, 12), in 8-bit grey levels, px and frames; NaN
        where there is no filter (border, mask).

        None before the first frame.
        """
    @property
    def state_covariance(self) -> NDArray[np.float64] | None:
        """Covariances of q, float64 array (H, W, 12, 12) or (N, 12, 12), units of `state` squared; NaN where
        there is no filter. None before the first frame. The fields' covariance adds the systematic error of
        neighbourhoods that no quadratic describes.
        """
    @property
    def frames_pushed(self) -> int:
        """How many frames have been taken in (a count, no unit)."""
    @property
    def repairs(self) -> int:
        """How often a site's covariance had lost its positive definiteness and was repaired (a count, no unit)."""
    @property
    def options(self) -> dict[str, Any]:
        """The options as a dictionary, in the units of the constructor."""
    def save(self, /, path: _Path) -> None:
        """Writes the states (one file, .npz) so that `load` goes on bit for bit, in the units of `state`.

        Pickling keeps the options too. ValueError before the first frame, OSError when the file cannot be
        written.
        """
    def load(self, /, path: _Path) -> None:
        """Takes up the states that `save` wrote, in the units of `state`; the options of this filter must be
        those of the saved one.

        FormatError for a damaged file, ValueError for a file of other options or another precision, OSError
        when it cannot be read.
        """
    def __reduce__(self, /) -> tuple[Any, ...]: ...

def quantities() -> dict[str, tuple[str, str]]:
    """Derived quantities with their units (per frame, with a frame period), as a dictionary."""

def smooth(
    frame: _Frame, blur_sigma: float, *, truncate: float | None = None, threads: int | None = None
) -> _Floats:
    """`frame` (H, W) smoothed by a Gaussian of standard deviation `blur_sigma` px, cut off at `truncate`
    standard deviations, reflecting borders.

    Returns a new array (H, W) in the same grey levels, float64 for float64, else float32. NaN (as masked
    pixels become) damages only the pixels whose kernel reaches it. ValueError for a negative or infinite
    `blur_sigma`.
    """

def quantise(frame: _Frame, step: float | None = None) -> _Floats:
    """`frame` (H, W) rounded down to multiples of `step` grey levels: floor(x / step) * step.

    Returns a new array (H, W), float64 for float64, else float32, NaN for masked pixels. ValueError unless
    `step` is positive.
    """

def luminance(frame: _Frame) -> NDArray[Any]:
    """Luma 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601) of a colour frame (H, W, 3 or 4) in the order red, green,
    blue; alpha is left out.

    Returns a new array (H, W) of the same dtype and grey levels; integers are rounded. A grey frame (H, W) is
    copied.
    """

def corners(
    frame: _Frame,
    *,
    max_count: int = 500,
    quality: float = 0.005,
    min_distance: float = 6.0,
    window: int = 3,
    existing: ArrayLike | None = None,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """Corners of `frame` (H, W): pixels whose surroundings change brightness along both axes (J. Shi, C. Tomasi,
    "Good features to track", 1994).

    The score is the smaller eigenvalue of the mean of (Ix^2, Ix Iy; Ix Iy, Iy^2) over `window` x `window` px
    (odd). A corner scores at least `quality` (0 to 1) times the best of the frame and no less than its 8
    neighbours. It is at least `min_distance` px away from every better corner and from every point of
    `existing` (N, 2). At most `max_count` corners, `existing` not counted.

    Returns positions (x, y) px, float64 (N, 2), best first. There are no corners where a window touches NaN
    or a masked pixel. ValueError for a number out of its range and for a colour frame.
    """

def point_flow(
    before: _Frame,
    after: _Frame,
    points: ArrayLike,
    *,
    guesses: ArrayLike | None = None,
    levels: int = 3,
    window: int = 19,
    max_steps: int = 30,
    min_step: float = 0.02,
    forward_backward: float | None = 0.7,
    min_eigenvalue: float | None = None,
    threads: int | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Flow at `points` (N, 2), positions (x, y) px, from frame `before` (H, W) to frame `after` (H, W), by
    gradient steps on a pyramid.

    B. Lucas, T. Kanade, 1981; J.-Y. Bouguet, "Pyramidal implementation of the Lucas Kanade feature tracker",
    2000. Minimises the squared differences in a window of `window` x `window` px (odd), on `levels` levels
    (1: full size alone). A level takes at most `max_steps` steps and ends with one shorter than `min_step`
    px. `guesses` (N, 2): expected flow, default zero.

    `ok` is False unless the flow back from the new position leads to within `forward_backward` px of the
    point (None: not tested). A point is lost (NaN) when it leaves the frame, when its window touches NaN or
    a masked pixel, or when the window has too little structure: smaller eigenvalue of its mean structure
    tensor below `min_eigenvalue`, (levels/px)^2. None: 0.1 where the first frame spans 255 levels, scaled by
    the square of its span.

    Returns flow (u, v) px/frame, float64 (N, 2); ok, bool (N,); error, the distance between forward and back,
    px, float64 (N,). ValueError for a number out of its range, for frames of different shape and for colour
    frames.
    """

@disjoint_base
class GaussianFilter:
    """Mean, covariance and noise of a batch of filters, as float64 arrays.

    Without `batch` arrays have no leading axis: x (n,), P (n, n), y (m,), S (m, m), K (n, m). With `batch=B`
    they are (B, n), (B, n, n) and so on; Q and R may be shared by the whole batch. Arrays may be replaced or
    changed in place; a number given for P, Q or R means that multiple of the identity. ValueError for an x
    that is not finite and for a P, Q or R that is not finite, symmetric and positive semi-definite, when it
    is set or, changed in place, at the next step. Units are the state's and the measurement's own.

    A state that cannot make a step is left as it was and marked in `failed`; an error is raised only when all
    are. For angles and other quantities that are no vectors, `residual_x`, `residual_z` and `state_add`
    replace differences and sums; None means those of vectors. Like all functions they are vectorised.
    """
    @property
    def x(self) -> NDArray[np.float64]:
        """Mean, array (n,) or (B, n), in the state's units."""
    @x.setter
    def x(self, value: ArrayLike, /) -> None: ...
    @property
    def P(self) -> NDArray[np.float64]:
        """Covariance, array (n, n) or (B, n, n), in the state's units squared."""
    @P.setter
    def P(self, value: ArrayLike, /) -> None: ...
    @property
    def Q(self) -> NDArray[np.float64]:
        """Process noise covariance, array (n, n) or (B, n, n), in the state's units squared per step."""
    @Q.setter
    def Q(self, value: ArrayLike, /) -> None: ...
    @property
    def R(self) -> NDArray[np.float64]:
        """Measurement noise covariance, array (m, m) or (B, m, m), in the measurement's units squared."""
    @R.setter
    def R(self, value: ArrayLike, /) -> None: ...
    @property
    def y(self) -> NDArray[np.float64]:
        """Residual of the last update, array (m,) or (B, m), in the measurement's units; zero where a component
        was missing, as in S and K."""
    @property
    def S(self) -> NDArray[np.float64]:
        """Covariance of the residual, array (m, m) or (B, m, m), in the measurement's units squared."""
    @property
    def K(self) -> NDArray[np.float64]:
        """Gain of the last update, array (n, m) or (B, n, m), state units per measurement unit."""
    @property
    def log_likelihood(self) -> NDArray[np.float64]:
        """Logarithm of the likelihood of the last measurement's components that were there, array () or (B,), no
        unit; zero without any."""
    @property
    def mahalanobis(self) -> NDArray[np.float64]:
        """Mahalanobis distance sqrt(y^T S^-1 y) of the last measurement, array () or (B,), in standard
        deviations; zero where it was missing."""
    @property
    def failed(self) -> NDArray[np.bool_]:
        """Whether a step could not be carried out for a state, since P was last assigned: bool array () or
        (B,), no unit. The state was left as it was before that step."""
    @property
    def repairs(self) -> int:
        """How often a covariance had lost its positive definiteness and was repaired (a count, no unit)."""
    @property
    def dim_x(self) -> int:
        """Dimensions n of the state (a count, no unit)."""
    @property
    def dim_z(self) -> int:
        """Dimensions m of the measurement (a count, no unit)."""
    @property
    def batch(self) -> int | None:
        """Number B of independent filters, or None where arrays have no leading axis (a count, no unit)."""
    @property
    def residual_x(self) -> _Function | None:
        """Difference `residual_x(a, b)` of states, arrays (..., n) of one shape -> (..., n), in the state's
        units; None: a - b."""
    @residual_x.setter
    def residual_x(self, value: _Function | None, /) -> None: ...
    @property
    def residual_z(self) -> _Function | None:
        """Difference `residual_z(a, b)` of measurements, arrays (..., m) of one shape -> (..., m), in the
        measurement's units; None: a - b."""
    @residual_z.setter
    def residual_z(self, value: _Function | None, /) -> None: ...
    @property
    def state_add(self) -> _Function | None:
        """Sum `state_add(x, dx)` of a state and a difference, arrays (n,) or (B, n) -> the same shape, in the
        state's units; None: x + dx."""
    @state_add.setter
    def state_add(self, value: _Function | None, /) -> None: ...

@final
class KalmanFilter(GaussianFilter):
    """Linear Kalman filter x' = F x + w, z = H x + v with w ~ N(0, Q), v ~ N(0, R).

    `dim_x` = n and `dim_z` = m dimensions; `batch` = B runs B independent filters, every array then having a
    leading axis (B, ...). Of the functions `residual_z` and `state_add` are used, `residual_x` by the
    smoother.
    """
    def __new__(
        cls,
        dim_x: int,
        dim_z: int,
        *,
        batch: int | None = None,
        residual_x: _Function | None = None,
        residual_z: _Function | None = None,
        state_add: _Function | None = None,
    ) -> KalmanFilter: ...
    @property
    def F(self) -> NDArray[np.float64]:
        """Transition matrix, array (n, n) or (B, n, n), in the state's units; identity at first."""
    @F.setter
    def F(self, value: ArrayLike, /) -> None: ...
    @property
    def H(self) -> NDArray[np.float64]:
        """Measurement matrix, array (m, n) or (B, m, n), measurement units per state unit; zero at first."""
    @H.setter
    def H(self, value: ArrayLike, /) -> None: ...
    def predict(self, /, *, F: ArrayLike | None = None, Q: ArrayLike | None = None) -> None:
        """x <- F x, P <- F P F^T + Q. `F` (n, n) or (B, n, n) and `Q` replace the attributes for this step."""
    def update(self, /, z: ArrayLike | None, R: ArrayLike | None = None, H: ArrayLike | None = None) -> None:
        """Takes in the measurement `z` (m,) or (B, m), in the measurement's units: the components that are
        neither NaN nor masked. None means that all are missing.

        `R` and `H` replace the attributes for this step. NumericalError when no state has a positive definite
        innovation covariance. Exceptions of the functions leave x and P as they were.
        """
    def batch_filter(
        self,
        /,
        zs: _Items,
        Fs: _Items | None = None,
        Qs: _Items | None = None,
        Hs: _Items | None = None,
        Rs: _Items | None = None,
        *,
        update_first: bool = False,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Filters the measurements `zs` of T times, each as `update` takes it, from the present state on.

        Returns means (T, n), covariances (T, n, n) after the updates and those after the predictions, in the
        state's units, with the batch's axis after T. `Fs`, `Qs`, `Hs`, `Rs`, sequences of T items, replace
        the attributes where an item is not None. With `update_first` each time is updated, then predicted.
        ValueError naming the sequence for a wrong number of items or shape.
        """
    def rts_smoother(
        self, /, Xs: ArrayLike, Ps: ArrayLike, Fs: _Items | None = None, Qs: _Items | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Smooths filtered means `Xs` (T, n) and covariances `Ps` (T, n, n) of T times, in the state's units,
        with the batch's axis after T (Rauch, Tung, Striebel 1965).

        Returns smoothed means (T, n), covariances, gains and predicted covariances (T, n, n). Gain and
        prediction k are of the step from time k to k + 1; `Fs` and `Qs`, sequences of T items as in
        `batch_filter`, are of the step to their time. NaN where a state cannot be smoothed.
        """
    def __reduce__(self, /) -> tuple[Any, ...]: ...

@final
class ExtendedKalmanFilter(GaussianFilter):
    """Extended Kalman filter x' = f(x) + w, z = h(x) + v, linearised at the mean.

    `dim_x` = n and `dim_z` = m dimensions; `batch` = B runs B independent filters, every array then having a
    leading axis (B, ...). Functions are vectorised over leading axes: `fx` and `Hx` map (..., n) to (..., n)
    and (..., m); `FJacobian` and `HJacobian` map the means (n,) or (B, n) to (n, n) or (B, n, n) and (m, n)
    or (B, m, n). Without a Jacobian central differences are taken. `residual_z` and `state_add` serve the
    update, `residual_x` and `residual_z` the central differences, `residual_x` the smoother.
    """
    def __new__(
        cls,
        dim_x: int,
        dim_z: int,
        *,
        batch: int | None = None,
        residual_x: _Function | None = None,
        residual_z: _Function | None = None,
        state_add: _Function | None = None,
    ) -> ExtendedKalmanFilter: ...
    def predict(self, /, fx: _Callback, FJacobian: _Callback | None = None) -> None:
        """x <- fx(x), P <- F P F^T + Q with F = `FJacobian(x)`, arrays (n,) and (n, n) or with a leading (B,
        ...), in the state's units.

        Exceptions of the functions leave x and P as they were.
        """
    def update(
        self, /, z: ArrayLike | None, HJacobian: _Callback | None, Hx: _Callback, R: ArrayLike | None = None
    ) -> None:
        """Takes in the measurement `z` (m,) or (B, m), in the measurement's units: the components that are
        neither NaN nor masked. None means that all are missing.

        `HJacobian` None takes central differences of `Hx`. `R` replaces the attribute for this step.
        Exceptions of the functions leave x and P as they were.
        """
    def batch_filter(
        self,
        /,
        zs: _Items,
        fx: _Callback,
        HJacobian: _Callback | None,
        Hx: _Callback,
        FJacobian: _Callback | None = None,
        *,
        Rs: _Items | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Filters the measurements `zs` of T times, each as `update` takes it, from the present state on;
        functions as in `predict` and `update`.

        Returns means (T, n) and covariances (T, n, n), in the state's units, with the batch's axis after T.
        `Rs`, a sequence of T items, replaces R where an item is not None.
        """
    def rts_smoother(
        self,
        /,
        Xs: ArrayLike,
        Ps: ArrayLike,
        fx: _Callback,
        FJacobian: _Callback | None = None,
        *,
        Qs: _Items | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Smooths filtered means `Xs` (T, n) and covariances `Ps` (T, n, n) of T times, in the state's units,
        with the batch's axis after T; functions as in `predict`.

        Returns smoothed means (T, n), covariances and gains (T, n, n); gain k is from time k + 1 to k.
        `Qs`, a sequence of T items, are of the step to their time. NaN where a state cannot be smoothed.
        """
    def __reduce__(self, /) -> tuple[Any, ...]: ...

@final
class MerweScaledSigmaPoints:
    """Scaled sigma points (van der Merwe 2004): 2 n + 1 points with mean and covariance of the state.

    `n` dimensions; spread `alpha` (no unit), `beta` 2 for Gaussians, `kappa` secondary spread. The squared
    spread of the points is alpha^2 (n + kappa).
    """
    def __new__(
        cls, n: int, alpha: float | None = None, beta: float | None = None, kappa: float | None = None
    ) -> MerweScaledSigmaPoints: ...
    @property
    def n(self) -> int:
        """Dimensions of the state (a count, no unit)."""
    @property
    def alpha(self) -> float:
        """Spread of the points (no unit)."""
    @property
    def beta(self) -> float:
        """Weight of prior knowledge in the centre's covariance weight (no unit)."""
    @property
    def kappa(self) -> float:
        """Secondary spread (no unit)."""
    @property
    def Wm(self) -> NDArray[np.float64]:
        """Weights of the mean, array (2 n + 1,), centre first (no unit)."""
    @property
    def Wc(self) -> NDArray[np.float64]:
        """Weights of the covariance, array (2 n + 1,), centre first (no unit)."""
    def num_sigmas(self, /) -> int:
        """Number of points, 2 n + 1 (a count, no unit)."""
    def sigma_points(self, /, x: ArrayLike, P: ArrayLike) -> NDArray[np.float64]:
        """The points, array (2 n + 1, n), of mean `x` (n,) and covariance `P` (n, n), in the state's units.

        NumericalError where `P` is not positive definite.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
    def __getnewargs__(self, /) -> tuple[int, float, float, float]: ...

_Particles: TypeAlias = Callable[[NDArray[np.float64]], ArrayLike]
_Resampling: TypeAlias = Literal["systematic", "stratified", "residual", "multinomial"]

@final
class ParticleFilter:
    """Particle filter: the posterior as N weighted samples, for any transition and any likelihood.

    `dim_x` = n components, `n_particles` = N; `batch` = B runs B independent filters, every array then having
    a leading axis (B, ...). A cycle is `predict`, `update`, `resample`. Weights are kept as logarithms.
    Random numbers are addressed by (`random_state`, id, step, particle, component): results do not depend on
    `threads`, and a filter of the batch is the same alone, given its number in `ids` (B,) (default 0 .. B -
    1). Particles are zero at first: use `sample_gaussian` or set `x`. Units are the state's own.
    Source: N. Gordon, D. Salmond, A. Smith, "Novel approach to nonlinear/non-Gaussian Bayesian state
    estimation", 1993.
    """
    def __new__(
        cls,
        dim_x: int,
        n_particles: int,
        *,
        batch: int | None = None,
        random_state: int | None = None,
        ids: Sequence[int] | None = None,
        threads: int | None = None,
    ) -> ParticleFilter: ...
    @property
    def x(self) -> NDArray[np.float64]:
        """Particles, array (N, n) or (B, N, n), in the state's units; may be replaced or changed in place."""
    @x.setter
    def x(self, value: ArrayLike, /) -> None: ...
    @property
    def log_weights(self) -> NDArray[np.float64]:
        """Logarithms of the normalised weights, read-only array (N,) or (B, N), no unit. Normalised when set;
        NaN counts as -inf.
        """
    @log_weights.setter
    def log_weights(self, value: ArrayLike, /) -> None: ...
    @property
    def weights(self) -> NDArray[np.float64]:
        """Weights, which sum to 1, array (N,) or (B, N), no unit."""
    @property
    def mean(self) -> NDArray[np.float64]:
        """Weighted mean, array (n,) or (B, n), in the state's units."""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """Weighted covariance sum w (x - mean)(x - mean)^T, array (n, n) or (B, n, n), in the state's units
        squared.
        """
    @property
    def P(self) -> NDArray[np.float64]:
        """filterpy's name of `covariance`, array (n, n) or (B, n, n), in the state's units squared."""
    @property
    def map(self) -> NDArray[np.float64]:
        """The particle with the largest weight, array (n,) or (B, n), in the state's units.

        Read it before `resample`: afterwards all weights are equal, and it is the first particle.
        """
    @property
    def effective_sample_size(self) -> NDArray[np.float64]:
        """Effective sample size 1 / sum w^2 (Kong, Liu and Wong 1994), array () or (B,), a number of particles
        from 1 to N, no unit.
        """
    @property
    def log_evidence(self) -> NDArray[np.float64]:
        """Logarithm of the last measurement's likelihood, log sum w_i L_i, array () or (B,), no unit; -inf if
        the update was refused.
        """
    @property
    def log_evidence_sum(self) -> NDArray[np.float64]:
        """Sum of `log_evidence` over the accepted updates, array () or (B,), no unit."""
    @property
    def degenerate(self) -> NDArray[np.int64]:
        """Number of updates refused because no particle had a likelihood above zero, array () or (B,) (a count,
        no unit).
        """
    @property
    def ids(self) -> NDArray[np.uint64]:
        """Numbers by which the random numbers of each filter are addressed, array () or (B,), no unit."""
    @property
    def step(self) -> int:
        """Number of predictions so far (a count, no unit)."""
    @property
    def dim_x(self) -> int:
        """Components n of the state (a count, no unit)."""
    @property
    def n_particles(self) -> int:
        """Number N of particles of each filter (a count, no unit)."""
    @property
    def batch(self) -> int | None:
        """Number B of independent filters, or None where arrays have no leading axis (a count, no unit)."""
    def quantile(self, /, q: ArrayLike) -> NDArray[np.float64]:
        """Marginal quantiles of every component at `q` in [0, 1]: array (n,) or (B, n), with the axis of `q`
        first if it is (k,), in the state's units.

        The smallest value at which the cumulative weight is at least q, numpy's method "inverted_cdf".
        """
    def sample_gaussian(self, /, mean: ArrayLike, covariance: ArrayLike) -> None:
        """Replaces the particles by samples of the Gaussian with `mean` (n,) or (B, n) and `covariance` (n, n)
        or (B, n, n), in the state's units, and makes the weights equal. A number for `covariance` means that
        multiple of the identity.
        """
    def predict(
        self, /, transition: _Particles | None = None, *, F: ArrayLike | None = None, Q: ArrayLike | None = None
    ) -> None:
        """Moves every particle: x <- transition(x) + w or, without `transition`, x <- F x + w, w ~ N(0, Q).

        `transition` maps all particles (N, n) or (B, N, n) to as many, in the state's units. `F` (default:
        identity) and `Q` are (n, n) or (B, n, n); a number means that multiple of the identity. Without `Q`
        no noise is added: the transition must be random itself, e.g. by `standard_normal()`. ValueError for
        results that are not finite. On exceptions the filter is as before.
        """
    def standard_normal(self, /) -> NDArray[np.float64]:
        """The standard normals of which the next prediction's noise is made, array (N, n) or (B, N, n), no unit."""
    def update(self, /, log_likelihood: _Particles | ArrayLike) -> None:
        """Multiplies the weights by the measurement's likelihood.

        `log_likelihood` maps all particles (N, n) or (B, N, n) to logarithms (N,) or (B, N), no unit, or is
        that array. NaN counts as -inf. A filter whose particles all have a likelihood of zero refuses the
        update: weights stay and `degenerate` counts it. ValueError for +inf. On exceptions the filter is as
        before.
        """
    def resample(
        self,
        /,
        scheme: _Resampling = "systematic",
        *,
        threshold: float | None = None,
        n_particles: int | None = None,
    ) -> NDArray[np.bool_]:
        """Copies particles in proportion to their weights, which are equal afterwards; returns whether, array ()
        or (B,) of bool, no unit.

        `scheme` is "systematic", "stratified", "residual" or "multinomial" (Douc, Cappe and Moulines 2005).
        With a `threshold` in [0, 1] only filters whose effective sample size is below `threshold` N are
        resampled. `n_particles` changes N, then in all filters.
        """
    def __reduce__(self, /) -> tuple[Any, ...]: ...

def resample(
    weights: ArrayLike,
    n: int | None = None,
    scheme: _Resampling = "systematic",
    *,
    uniforms: ArrayLike | None = None,
    random_state: int | None = None,
) -> NDArray[np.int64]:
    """Indices (n,) of particles selected in proportion to `weights` (N,), which are not negative and need not
    sum to 1, no unit.

    `n` defaults to N. `scheme` is "systematic", "stratified", "residual" or "multinomial". A position t in
    [0, 1] selects the first particle with a weight above zero whose cumulative weight is at least t times the
    sum: (i + u) / n for i = 0 .. n - 1 with one u (systematic) or one each (stratified). Residual takes
    floor(n w) copies of each first. `uniforms`, numbers in [0, 1], are used in their order; without them
    those of `random_state` are. ValueError for other weights, or too few uniforms.
    Source: R. Douc, O. Cappe, E. Moulines, "Comparison of resampling schemes for particle filtering", 2005.
    """

@final
class UnscentedKalmanFilter(GaussianFilter):
    """Unscented Kalman filter x' = f(x) + w, z = h(x) + v (Julier and Uhlmann 1997, van der Merwe 2004).

    `fx(points, dt)` and `hx(points)` are vectorised: they receive every sigma point in one array (2 n + 1,
    n), or (B, 2 n + 1, n) with `batch=B`, and return (..., n) and (..., m). `dt` is handed to `fx` as it is,
    in the unit that `fx` expects. `points` is a MerweScaledSigmaPoints. With `augmented=True` the noise is
    part of the sigma points, `fx(points, noise, dt)` with 4 n + 1 rows each. With `redraw=True` new points
    are drawn for the measurement; False measures the propagated ones, as filterpy 1 did, which leaves Q out
    of the innovation covariance.

    For angles: differences `residual_x(a, b)`, `residual_z(a, b)`, weighted means `x_mean(points, weights)`,
    `z_mean(points, weights)` and the sum `state_add(x, dx)`; see the attributes.
    """
    def __new__(
        cls,
        dim_x: int,
        dim_z: int,
        dt: float,
        hx: _Callback,
        fx: _Callback,
        points: MerweScaledSigmaPoints,
        *,
        x_mean: _Function | None = None,
        z_mean: _Function | None = None,
        residual_x: _Function | None = None,
        residual_z: _Function | None = None,
        state_add: _Function | None = None,
        batch: int | None = None,
        augmented: bool = False,
        redraw: bool = True,
    ) -> UnscentedKalmanFilter: ...
    @property
    def fx(self) -> _Callback:
        """Transition function (points, dt) -> points, on arrays (..., n) in the state's units."""
    @fx.setter
    def fx(self, value: _Callback, /) -> None: ...
    @property
    def hx(self) -> _Callback:
        """Measurement function points (..., n) -> (..., m), from state to measurement units."""
    @hx.setter
    def hx(self, value: _Callback, /) -> None: ...
    @property
    def points_fn(self) -> MerweScaledSigmaPoints:
        """The sigma points in use (constants have no unit)."""
    @property
    def dt(self) -> float:
        """Step handed to `fx`, in the unit that it expects."""
    @property
    def augmented(self) -> bool:
        """Whether the noise is part of the sigma points (no unit)."""
    @property
    def redraw(self) -> bool:
        """Whether new points are drawn for the measurement (no unit)."""
    @property
    def x_mean(self) -> _Function | None:
        """Weighted mean `x_mean(points, weights)` of states, arrays (2 n + 1, n) or (B, 2 n + 1, n) and (2 n
        + 1,) -> (n,) or (B, n), in the state's units; weights sum to 1 and may be negative. None: the
        arithmetic mean."""
    @x_mean.setter
    def x_mean(self, value: _Function | None, /) -> None: ...
    @property
    def z_mean(self) -> _Function | None:
        """As `x_mean`, of measurements: (..., 2 n + 1, m) -> (..., m), in the measurement's units."""
    @z_mean.setter
    def z_mean(self, value: _Function | None, /) -> None: ...
    def predict(self, /, dt: float | None = None, fx: _Callback | None = None, **fx_args: Any) -> None:
        """Propagates mean and covariance through `fx` by `dt` (default: that of the constructor, same unit);
        keywords are handed to `fx`.

        Exceptions of the functions leave x and P (n,), (n, n) as they were. NumericalError when every state
        outgrows the range of numbers.
        """
    def update(
        self, /, z: ArrayLike | None, R: ArrayLike | None = None, hx: _Callback | None = None, **hx_args: Any
    ) -> None:
        """Takes in the measurement `z` (m,) or (B, m), in the measurement's units: the components that are
        neither NaN nor masked. None means that all are missing.

        `R` and `hx` replace the attributes for this step, keywords are handed to `hx`. Exceptions of the
        functions leave x and P as they were.
        """
    def batch_filter(
        self, /, zs: _Items, Rs: _Items | None = None, dts: float | _Items | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Filters the measurements `zs` of T times, each as `update` takes it, from the present state on.

        Returns means (T, n) and covariances (T, n, n), in the state's units, with the batch's axis after T.
        `Rs`, a sequence of T items, replaces R where an item is not None; `dts`, a number or a sequence,
        is the step to each time.
        """
    def rts_smoother(
        self, /, Xs: ArrayLike, Ps: ArrayLike, Qs: _Items | None = None, dts: float | _Items | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Smooths filtered means `Xs` (T, n) and covariances `Ps` (T, n, n) of T times, in the state's units,
        with the batch's axis after T (Sarkka 2008).

        Returns smoothed means (T, n), covariances and gains (T, n, n); gain k is from time k + 1 to k.
        `Qs`, a sequence of T items, and `dts`, a number or a sequence, are of the step to their time, as
        in `batch_filter` (filterpy takes dts[k] for the step from k). NaN where a state cannot be
        smoothed.
        """
    def __reduce__(self, /) -> tuple[Any, ...]: ...

@final
class Scene:
    """A moving picture I(x, y, t) with exact flow and Jacobian at every point and time.

    `name` is one of `scenes.names()`; frames have `width` x `height` px, pixel (0, 0) lies at the scene point
    `origin` (x, y) px; `random_state` makes everything random; `carrier` (one of `scenes.carriers()`) is what
    the motion moves; `parameters` are those of `scenes.parameters(name)`, each in the unit given there. Time
    t is in frames, brightness in grey levels of an 8-bit scale.
    """
    def __new__(
        cls,
        name: str,
        *,
        width: int | None = None,
        height: int | None = None,
        origin: tuple[float, float] | None = None,
        random_state: int | None = None,
        carrier: str | None = None,
        **parameters: float,
    ) -> Scene: ...
    @property
    def name(self) -> str:
        """Name of the scene (no unit)."""
    @property
    def size(self) -> tuple[int, int]:
        """Size (width, height) of the frames, px."""
    @property
    def origin(self) -> tuple[float, float]:
        """Scene point (x, y) of pixel (0, 0), px."""
    def frame(self, /, t: float) -> NDArray[np.float64]:
        """The frame of time `t` (frames): float64 array (H, W), grey levels of an 8-bit scale, neither rounded
        nor clipped.

        ValueError for a time that is not finite, or beyond the paths that the scene follows: 1e5 steps, which
        are 25000 frames or fewer in the scenes whose paths are integrated.
        """
    def frames(self, /, count: int, start: float = 0.0) -> NDArray[np.float64]:
        """Frames of the times start, start + 1, ...: float64 array (count, H, W), grey levels of an 8-bit scale.
        ValueError for times that `frame` refuses.
        """
    def truth(self, /, t: float, *, between: tuple[float, float] | None = None) -> FlowField:
        """Exact flow and Jacobian of the frame of time `t` (frames), a FlowField (H, W) in px/frame and 1/frame.

        Without `between` the velocity at that time. With `between=(a, b)`, frames, the mean velocity between
        the times t + a and t + b of the matter that is at each pixel at time t, `(d(b) - d(a)) / (b - a)` for
        displacements d since t: what frames can show, where paths are curved. (0, 1) is the displacement to
        the next frame, (-1, 1) the mean of those since the last and to the next. Status MASKED and NaN where
        the scene has no single truth. ValueError for times that are not finite, equal times and those that
        `displacement` refuses.
        """
    def motion(self, /, x: float, y: float, t: float) -> NDArray[np.float64] | None:
        """Exact (u, v, u_x, v_x, u_y, v_y) at scene point (x, y) px and time t (frames), px/frame and 1/frame,
        array (6,); None without truth. ValueError for a number that is not finite.
        """
    def displacement(self, /, x: float, y: float, t: float, duration: float = 1.0) -> tuple[float, float] | None:
        """How far (x, y) px the matter at scene point (x, y) px and time t has gone `duration` frames later;
        None where the scene does not know.

        It differs from `duration` times the velocity wherever paths are curved. ValueError for a number that
        is not finite, and for a duration longer than the scene follows paths, as in `frame`.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
    def __getnewargs_ex__(self, /) -> tuple[tuple[str], dict[str, Any]]: ...

@final
class TargetScene:
    """A colour scene of people or cars that look alike, cross and hide each other before a moving camera, with
    exact boxes.

    `name` is one of `scenes.target_scenes()`. `random_state` chooses the recording: world, texture, gait,
    shake and noise. `scale` multiplies all lengths; at 1 a frame has 720 x 480 px. `noise` is the standard
    deviation of the white noise of each channel, grey levels. `frames` is their number, by default that of
    the scene; zoom and sizes reach their last value in the last frame. `colour_cast` r, 0 to 1, grows to the
    last frame: red is multiplied by 1 - r, blue by 1 + r / 2. ValueError for an unknown name or an unusable
    option.
    """
    def __new__(
        cls,
        name: str,
        *,
        random_state: int = 0,
        scale: float = 0.5,
        noise: float = 2.5,
        frames: int | None = None,
        colour_cast: float = 0.0,
    ) -> TargetScene: ...
    @property
    def name(self) -> str:
        """Name of the scene (no unit)."""
    @property
    def size(self) -> tuple[int, int]:
        """Size (width, height) of the frames, px."""
    @property
    def n_targets(self) -> int:
        """Number of targets K (no unit)."""
    @property
    def drawing_order(self) -> tuple[int, ...]:
        """Indices of the targets from the farthest to the nearest, which hides the others (no unit)."""
    def __len__(self, /) -> int:
        """Number of frames T (no unit)."""
    def frame(self, /, t: int, *, targets: Sequence[int] | None = None) -> NDArray[np.uint8]:
        """Frame `t`: uint8 array (H, W, 3), red, green and blue.

        With `targets`, indices, only those are drawn; world, post and noise are the same, so that the
        difference shows the pixels of the others.
        """
    def frames(self, /) -> NDArray[np.uint8]:
        """All frames: uint8 array (T, H, W, 3), red, green and blue."""
    def boxes(self, /) -> NDArray[np.float64]:
        """Exact boxes of all frames and targets: float64 array (T, K, 4), left, top, width, height in px,
        whether the target is seen or not.

        Pixel centres lie at integers; the centre is left + width / 2, top + height / 2. Arms, legs and a car
        on a slope reach a little over it.
        """
    def camera_motion(self, /) -> NDArray[np.float64]:
        """Motion of the still world from each frame to the next: float64 array (T - 1, 2, 3).

        What is at (x, y) px in frame t is at `motion[t] @ (x, y, 1)` px in frame t + 1.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
    def __getnewargs_ex__(self, /) -> tuple[tuple[str], dict[str, Any]]: ...

@final
class Sensor:
    """What a camera does to a frame: white noise, rounding, clipping.

    `noise` standard deviation in grey levels; `rounding` "none", "floor" (the patent's quantiser) or
    "nearest"; `saturate` clips to 0 ... 255; `random_state` of the noise. Without arguments it changes
    nothing.
    """
    def __new__(
        cls,
        *,
        noise: float | None = None,
        rounding: Literal["none", "floor", "nearest"] | None = None,
        saturate: bool | None = None,
        random_state: int | None = None,
    ) -> Sensor: ...
    def apply(self, /, frame: _Frame, index: int = 0) -> NDArray[np.float64]:
        """`frame` (H, W) as the camera delivers it, a new float64 array (H, W) in grey levels.

        The noise depends on the seed, `index` (which frame it is) and the pixel, on nothing else.
        """
    def apply_u8(self, /, frame: _Frame, index: int = 0) -> NDArray[np.uint8]:
        """As `apply`, as a uint8 array (H, W) of grey levels; fractions are cut off and values outside 0 ... 255
        clipped.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
    def __getnewargs_ex__(self, /) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class _FrameSource:
    """Frames (H, W), or (H, W, 3) with colour="rgb", one by one; what `jacoflow.io.FrameReader` wraps."""
    def __iter__(self, /) -> _FrameSource: ...
    def __next__(self, /) -> NDArray[Any]: ...
    def __length_hint__(self, /) -> int: ...
    @property
    def frame_rate(self) -> float | None:
        """Frames per second, where the source says so, else None."""
    @property
    def time(self) -> float | None:
        """Time of the frame read last, s, where the source says so, else None."""
    @property
    def pixel_pitch(self) -> tuple[float, float] | None:
        """Width and height of a pixel in `length_unit`, where the source says so, else None."""
    @property
    def length_unit(self) -> str | None:
        """Unit of `pixel_pitch` as the source spells it, else None."""

@final
class _GradientTracker:
    def __new__(
        cls,
        frame: NDArray[Any],
        bbox: list[float] | None,
        center: list[float] | None,
        model: str,
        camera: str,
    ) -> _GradientTracker: ...
    def update(self, frame: NDArray[Any]) -> dict[str, Any]:
        """The target in the next frame, as a dictionary."""
    def state(self) -> dict[str, Any]:
        """The target at the last frame, as a dictionary."""
    def __reduce__(self, /) -> tuple[Any, tuple[bytes, float]]: ...

@final
class _GaussMarkovFilter:
    def __new__(cls, position: Sequence[float], alpha: float, q: float, start: Sequence[float], measures: str) -> _GaussMarkovFilter: ...
    def predict(self) -> None:
        """To the next frame."""
    def update(self, position: tuple[list[float], list[float]] | None, velocity: tuple[list[float], list[float]] | None) -> float:
        """Takes a measurement: values and variances along x and y; returns its normalised innovation
        squared."""
    def state(self) -> NDArray[np.float64]:
        """Position, velocity and acceleration along x and along y, (2, 3), px and frames."""
    def save(self) -> dict[str, Any]:
        """Everything, as a dictionary for a pickle."""
    def restore(self, x: Sequence[Sequence[float]], p: Sequence[Sequence[Sequence[float]]]) -> None:
        """State and covariances (column by column) as they were saved."""
    def covariance(self) -> NDArray[np.float64]:
        """Their covariances along x and along y, (2, 3, 3)."""

@final
class _ParticleStep:
    def as_dict(self, /) -> dict[str, Any]:
        """Everything, by the names of `jacoflow.track.ParticleStep`."""
    def particles(self, /, id: int) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Particles (N, 6) and weights (N,) of a target; None where they were not kept."""
    def foreground(self, /) -> NDArray[np.float32]:
        """Foreground (H, W), 0 to 1."""
    def segments(self, /) -> NDArray[np.int32]:
        """Labels of the segments (H, W)."""
    def keeps_frame(self, /) -> bool:
        """Whether it keeps the frame."""
    def keeping(self, /, frame: bool, particles: bool) -> _ParticleStep:
        """The same without the frame, unless `frame`, and without the particles, unless `particles`."""
    def __reduce__(self, /) -> tuple[Any, tuple[bytes]]: ...

@final
class _ParticleTracker:
    def __new__(
        cls, frame: NDArray[Any], boxes: list[tuple[int, list[float]]], options: dict[str, Any]
    ) -> _ParticleTracker: ...
    def update(self, /, frame: NDArray[Any], camera: list[list[float]] | None) -> _ParticleStep:
        """The targets in the next frame; `camera`: the background's motion since the one before, where it is
        known.
        """
    def add(self, /, bounds: list[float], id: int | None) -> int:
        """Adds a target at the last frame; returns its number."""
    def remove(self, /, id: int) -> None:
        """Removes a target."""
    def step(self, /) -> _ParticleStep:
        """The targets at the last frame."""
    def __reduce__(self, /) -> tuple[Any, tuple[bytes, bool]]: ...

@final
class _StereoTracker:
    def __new__(cls, options: dict[str, Any]) -> _StereoTracker: ...
    def update(self, left: NDArray[Any], right: NDArray[Any], dt: float | None) -> dict[str, Any]:
        """The next step from both views, `dt` after the last one, as a dictionary."""
    def update_disparity(self, left: NDArray[Any], disparity: NDArray[Any], dt: float | None) -> dict[str, Any]:
        """The next step from the left view and its disparities, NaN where there is none, `dt` after the last
        one, as a dictionary."""
    def row_offset(self) -> float | None:
        """How many rows lower the right view shows a point, where that is known."""
    def graph(self) -> _TrackGraph:
        """Clusters of all steps so far and their arcs."""
    def tracks(self) -> dict[int, tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
        """Tracks by id: times (T,), positions (T, 3), velocities (T, 3) and when that was (T,)."""
    def __reduce__(self, /) -> tuple[Any, tuple[bytes, float | None]]: ...

@final
class _TrackGraph:
    @staticmethod
    def from_json(json: str) -> _TrackGraph:
        """From the text that `to_json` gives."""
    def to_json(self) -> str:
        """As JSON text."""
    def nodes(self) -> list[dict[str, Any]]:
        """Clusters as dictionaries, by time and index."""
    def arcs(self) -> list[tuple[int, int, int, float, float]]:
        """Arcs as (time, from, to, forward, backward)."""
    def follow(self, time: int, index: int, threshold: float, backward: bool) -> list[tuple[int, int]]:
        """Clusters (time, index) reached from one along arcs with at least this score."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]

def _detect_moving_target(
    first: NDArray[Any], second: NDArray[Any], center: list[float] | None
) -> tuple[list[float], list[float]] | None: ...
def _mixture_dirichlet_fit(
    points: NDArray[np.float64], weights: NDArray[np.float64] | None, parameters: dict[str, Any], responsibilities: NDArray[np.float64] | None
) -> dict[str, Any]:
    """Dirichlet-process mixture of points (N, D) with weights (N,), from responsibilities (N, K) or seeds, as
    a dictionary of its attributes."""
def _mixture_dirichlet_densities(
    points: NDArray[np.float64], components: dict[str, Any], threads: int | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Log densities (N,) of points (N, D) under a mixture that `_mixture_dirichlet_fit` returned, and
    responsibilities (N, K)."""
def _mixture_fit(
    points: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
    parameters: dict[str, Any],
    responsibilities: NDArray[np.float64] | None,
    start: dict[str, Any] | None,
) -> dict[str, Any]: ...
def _mixture_partial_fit(
    points: NDArray[np.float64], weights: NDArray[np.float64] | None, parameters: dict[str, Any], earlier: dict[str, Any] | None, forgetting: float
) -> dict[str, Any]: ...
def _mixture_densities(
    points: NDArray[np.float64], components: dict[str, Any], threads: int | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def _motion3d_bound(
    points: ArrayLike, inverse_depth: ArrayLike, translation: ArrayLike, rotation: ArrayLike, jacobian: bool, layout: dict[str, Any]
) -> dict[str, NDArray[np.float64]]: ...
def _motion3d_contact_map(
    field: FlowField, intrinsics: ArrayLike | None, known: dict[str, Any], placement: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
def _motion3d_essential(translation: ArrayLike, rotation: ArrayLike) -> NDArray[np.float64]: ...
def _motion3d_estimate(
    points: ArrayLike, flow: ArrayLike, jacobian: ArrayLike | None, layout: dict[str, Any], options: dict[str, Any]
) -> dict[str, Any]: ...
def _motion3d_estimate_field(
    field: FlowField, intrinsics: ArrayLike | None, layout: dict[str, Any], options: dict[str, Any]
) -> tuple[dict[str, Any], NDArray[np.float64]]: ...
def _motion3d_field_points(
    field: FlowField, spacing: float | None, max_points: int | None, region: Sequence[int] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], list[float]]: ...
def _motion3d_focus(
    translation: ArrayLike, tangent: ArrayLike, covariance: ArrayLike, intrinsics: ArrayLike | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None: ...
def _motion3d_predict(
    points: ArrayLike, inverse_depth: ArrayLike, translation: ArrayLike, rotation: ArrayLike, intrinsics: ArrayLike | None, projection: str, whole_frame: bool
) -> NDArray[np.float64]: ...
def _motion3d_lateral(flow: ArrayLike, noise_std: float | None, weights: str) -> dict[str, Any]: ...
def _motion3d_lateral_bound(inverse_depth: ArrayLike, noise_std: float) -> dict[str, float]: ...
def _classify(jet: Sequence[float], motion: Sequence[float]) -> tuple[int, int, int, float]: ...
def _observability(
    frames: _Frames,
    *,
    time_scheme: Literal["central", "backward"] | None = None,
    neighbourhood: tuple[int, int] | ArrayLike | None = None,
    neighbourhood_sigma: float | None = None,
    preprocess: Preprocess | None = None,
    threads: int | None = None,
) -> dict[str, NDArray[Any]]: ...
def _felzenszwalb(image: ArrayLike, scale: float, sigma: float, min_size: int, threads: int | None) -> NDArray[np.int32]: ...
def _region_means(labels: NDArray[np.int64], values: ArrayLike) -> NDArray[np.float64]: ...
def _edge_disparity(
    left: ArrayLike, right: ArrayLike, options: dict[str, Any]
) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32], NDArray[np.float32], tuple[float, bool]]: ...
def _check_camera(focal: float, baseline: float, d_infinity: float) -> None: ...
def _edge_pixels(
    view: ArrayLike, blur_sigma: float, threshold: float, threads: int | None
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]: ...
def _estimate_row_offset(left: ArrayLike, right: ArrayLike, options: dict[str, Any]) -> tuple[float, bool]: ...
def _kind_of(
    source: _Path,
    colour: str | None,
    grey: str | None,
    channel: int | None,
    z: int | str | None,
    start: int,
    stop: int | None,
    step: int,
) -> str | None: ...
def _open_frames(
    source: _Path,
    colour: str | None,
    grey: str | None,
    channel: int | None,
    z: int | str | None,
    start: int,
    stop: int | None,
    step: int,
) -> _FrameSource: ...
def _read_disparity(path: _Path) -> NDArray[np.float32]: ...
def _write_disparity(path: _Path, disparity: ArrayLike) -> int: ...
def _read_flow(path: _Path, format: Literal["flo", "kitti"]) -> NDArray[np.float32]: ...
def _read_image(
    path: _Path, colour: str | None, grey: str | None, channel: int | None, z: int | str | None
) -> NDArray[Any]: ...
def _read_pfm(path: _Path) -> NDArray[np.float32]: ...
def _write_flow(path: _Path, flow: ArrayLike, format: Literal["flo", "kitti"]) -> None: ...
def _write_frames(path: _Path, frames: Iterable[NDArray[Any]], frame_rate: float) -> int: ...
def _write_pfm(path: _Path, values: ArrayLike) -> None: ...
def _restore_estimator(options: dict[str, Any], memory: dict[str, Any]) -> FlowEstimator: ...
def _restore_extended(state: dict[str, Any]) -> ExtendedKalmanFilter: ...
def _restore_field(state: dict[str, Any]) -> FlowField: ...
def _restore_measurement(name: str, unit: str, is_stack: bool, rows: list[Any]) -> Measurement: ...
def _restore_filter(options: dict[str, Any], state: tuple[bytes, str] | None) -> FlowFilter: ...
def _restore_particle(state: dict[str, Any]) -> ParticleFilter: ...
def _restore_kalman(state: dict[str, Any]) -> KalmanFilter: ...
def _restore_unscented(state: dict[str, Any]) -> UnscentedKalmanFilter: ...
def _run_command_line(arguments: list[str]) -> int: ...
def _scene_carriers() -> dict[str, str]: ...
def _scene_names() -> dict[str, str]: ...
def _scene_parameters(name: str) -> dict[str, tuple[float | None, str]]: ...
def _target_scene_names() -> dict[str, str]: ...
def _restore_gradient_tracker(state: bytes, gain: float) -> _GradientTracker:
    """The inverse of `_GradientTracker.__reduce__`."""
def _restore_stereo_tracker(state: bytes, gain: float | None) -> _StereoTracker:
    """The inverse of `_StereoTracker.__reduce__`."""
def _restore_particle_step(state: bytes) -> _ParticleStep:
    """The inverse of `_ParticleStep.__reduce__`."""
def _restore_particle_tracker(state: bytes, takes_grey: bool) -> _ParticleTracker:
    """The inverse of `_ParticleTracker.__reduce__`."""
def _write_particle_tracks(path: str, format: str, steps: list[_ParticleStep]) -> None:
    """Writes steps to a file: "mot" or "csv"."""
def _status_names() -> list[str]: ...
