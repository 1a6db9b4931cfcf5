"""Why a pixel has, or lacks, an estimate."""

from enum import IntEnum

__all__ = ["Status"]


class Status(IntEnum):
    """Status code of one estimate; `FlowField.status` is an array (..., H, W) of these. Codes carry no unit.

    BORDER, NON_FINITE, MASKED, UNOBSERVABLE and MISSING_FRAME come with NaN values.

    >>> Status(3).name
    'MASKED'
    """

    OK = 0
    """A full estimate."""
    BORDER = 1
    """The neighbourhood reaches over the edge of the frame."""
    NON_FINITE = 2
    """The neighbourhood holds a NaN or infinite sample."""
    MASKED = 3
    """The pixel, or one its neighbourhood needs, is masked out."""
    UNOBSERVABLE = 4
    """The equations do not determine every unknown."""
    MIN_NORM = 5
    """Unobservable, and the minimum-norm solution was requested: values are finite but not unique."""
    REPAIRED = 6
    """A filter lost its positive-definite covariance and was restarted here."""
    PREDICTED = 7
    """No estimate at this time: what the estimates before say, with a covariance that grows until the next
    one."""
    INCONSISTENT = 8
    """A full estimate that the frames contradict: along it brightness changes by far more than usual. What is
    seen is hidden in another frame (occlusion), has
    changed, or moves differently; the covariance does not know, and the pixel is not `valid`. Only
    "coarse_to_fine" reports it."""
    MISSING_FRAME = 9
    """The sequence has no frame before or after this one that the estimate needs."""
