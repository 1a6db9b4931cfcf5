"""Where flow and Jacobian can be known at all: theorem 1 of WO2010/098160, pixel by pixel."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._brief import Brief
from ._checks import numbers
from ._jacoflow import _classify, _observability
from ._options import Preprocess

__all__ = ["Condition", "Observability", "ObservabilityMap", "classify", "observability"]


class Condition(IntEnum):
    """Which condition of theorem 1 holds (a code without unit).

    >>> Condition(3).name
    'BOTH'
    """

    NEITHER = 0
    """None: flow and Jacobian are not all determined."""
    REGULAR_HESSIAN = 1
    """(i): the Hessian of I is regular and there is motion that shows."""
    TURNING_GRADIENT = 2
    """(ii): the gradient and its time derivative are independent, even where the Hessian vanishes."""
    BOTH = 3
    """Both."""
    DEGENERATE = 4
    """Full rank although neither holds strictly: a Hessian of rank 1 helps the gradient."""


@dataclass(frozen=True)
class Observability:
    """What theorem 1 says of one jet: condition, ranks and condition number (no units)."""

    condition: Condition
    """The condition that holds."""
    rank_single: int
    """Rank of J(i), at most 5."""
    rank: int
    """Rank of [J(i); J(i')]: 6 where the affine model is observable."""
    condition_number: float
    """Condition number of the column-scaled equations."""


@dataclass(frozen=True, eq=False, repr=False)
class ObservabilityMap(Brief):
    """What theorem 1 says of every pixel: arrays (H, W) without units."""

    condition: NDArray[np.uint8]
    """Codes of `Condition`, array (H, W)."""
    rank_single: NDArray[np.uint8]
    """Rank of J(i), array (H, W), at most 5."""
    rank: NDArray[np.uint8]
    """Rank of [J(i); J(i')], array (H, W): 6 where the affine model is observable."""
    condition_number: NDArray[np.float64]
    """Condition number of the column-scaled equations, array (H, W)."""
    known: NDArray[np.bool_]
    """False at the border and where a sample is not finite, array (H, W)."""

    @property
    def observable(self) -> NDArray[np.bool_]:
        """Where all six unknowns are determined, bool array (H, W)."""
        observable: NDArray[np.bool_] = self.known & (self.rank == 6)
        return observable


def observability(
    frames: NDArray[Any] | Sequence[NDArray[Any]],
    *,
    time_scheme: Literal["central", "backward"] | None = None,
    neighbourhood: tuple[int, int] | ArrayLike | None = None,
    neighbourhood_sigma: float | None = None,
    preprocess: Preprocess | None = None,
    threads: int | None = None,
) -> ObservabilityMap:
    """Observability of the affine model at every pixel (H, W) of three frames, oldest first (no units).

    `neighbourhood` and `time_scheme` are those of `jacoflow.Instantaneous`. ValueError unless there are three
    frames of one size, at least 3 x 3.

    >>> import numpy as np
    >>> flat = np.zeros((3, 8, 8), np.uint8)
    >>> bool(observability(flat).observable.any())
    False
    """
    return ObservabilityMap(
        **_observability(
            frames,
            time_scheme=time_scheme,
            neighbourhood=neighbourhood,
            neighbourhood_sigma=neighbourhood_sigma,
            preprocess=preprocess,
            threads=threads,
        )
    )


def classify(jet: ArrayLike, motion: ArrayLike) -> Observability:
    """Theorem 1 for one jet (6,) = (I, Ix, Iy, Ixx, Ixy, Iyy), grey levels and px, moving by (6,) = (u, v,
    u_x, v_x, u_y, v_y), px/frame and 1/frame.

    >>> classify([128, 1, 2, 0.3, 0.1, 0.2], [1, 0, 0, 0, 0, 0]).rank
    6
    """
    condition, rank_single, rank, condition_number = _classify(
        numbers("jet", jet, "(I, Ix, Iy, Ixx, Ixy, Iyy)", (6,)).tolist(), numbers("motion", motion, "(u, v, u_x, v_x, u_y, v_y)", (6,)).tolist()
    )
    return Observability(Condition(condition), rank_single, rank, condition_number)
