"""Mixtures of Gaussians for points with weights: by variational Bayes, and Dirichlet-process mixtures.

scikit-learn's conventions, without needing scikit-learn: `fit`, `predict`, `sample_weight`, `random_state`,
fitted attributes with a trailing underscore. Arrays are (N, D) of real numbers in any unit; everything is
computed in double precision.

>>> import numpy as np
>>> from jacoflow.mixture import VariationalGaussianMixture
>>> rng = np.random.default_rng(0)
>>> x = np.concatenate([rng.normal(0, 1, (200, 2)), rng.normal(8, 1, (100, 2))])
>>> mixture = VariationalGaussianMixture(2, random_state=0).fit(x, sample_weight=np.full(300, 2.0))
>>> np.sort(mixture.weights_).round(2).tolist()
[0.33, 0.67]
"""

from __future__ import annotations

import numbers
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ._dirichlet_mixture import DirichletProcessGaussianMixture
from ._jacoflow import _mixture_densities, _mixture_fit, _mixture_partial_fit
from ._mixture_base import Array, PointMixture, _demand, _reals, _warn_of, _weights

__all__ = ["DirichletProcessGaussianMixture", "VariationalGaussianMixture"]


class VariationalGaussianMixture(PointMixture):
    """A mixture of Gaussians in D dimensions, fitted to weighted points by variational Bayes.

    Proportions have a Dirichlet prior, means and precisions Gauss-Wishart priors; components that the points
    do not need go back to the prior. Source: the stereo paper, equations (6) to (28); C. Bishop, "Pattern
    Recognition and Machine Learning" (2006), section 10.2. A weight is evidence and not a proportion: a
    weight of 3 is the point three times, and twice all weights is not the same fit. It is deterministic for a
    seed, for any number of threads and, from k-means++ seeds, the order of the points.

    Parameters
    ----------
    n_components : int
        K, the most components there may be, up to 65536 (no unit).
    weight_concentration_prior : float
        `alpha0` of the Dirichlet prior, from 1e-100 to 1e100, no unit.
    mean_precision_prior : float
        `beta0`, precision of the means over that of the points, from 1e-100 to 1e100, no unit.
    mean_prior : array (D,), units of X
        `m0`; default: the weighted mean.
    degrees_of_freedom_prior : float
        `nu0` of the Wishart prior, above D - 1; default D + 9.1.
    covariance_prior : array (D, D) or float, units of X squared
        `W0^-1`, or its diagonal; default: the weighted covariance.
    max_iter : int
        Most rounds, each an M step and an E step.
    tol : float or None
        Rounds end when the lower bound grows by less than this times the sum of the weights; None: exactly
        `max_iter` rounds.
    n_init : int
        Fits from different seeds, of which the one with the greatest lower bound is kept.
    init : "kmeans++" or "random"
        First responsibilities: clusters of weighted k-means, or random numbers. These are drawn row by row,
        so that another order of the points, or a point twice in place of one of twice the weight, is another
        start; from k-means++ it is the same one.
    prune_weight : float
        Components with less weight of points than this are left out by `fit` and by the first `partial_fit`;
        0: none.
    warm_start : bool
        Whether `fit` begins with the components of the last fit, however many were left of them, unless there
        are more than `n_components`.
    random_state : int, numpy.random.RandomState, numpy.random.Generator or None
        Seed; None: numpy's global one.
    threads : int or None
        Number of threads; default: the environment variable JACOFLOW_THREADS, or every processor.

    Attributes
    ----------
    weights_ : array (K,)
        Expected proportions, `alpha / sum(alpha)`.
    means_ : array (K, D), units of X
        `m_k`.
    covariances_, precisions_ : array (K, D, D)
        `W_k^-1 / nu_k` and its inverse.
    weight_concentration_, mean_precision_, degrees_of_freedom_ : array (K,)
        `alpha_k`, `beta_k`, `nu_k`.
    lower_bound_ : float, lower_bounds_ : array (n_iter_,)
        The lower bound of the evidence after the last and after each M step, natural logarithm.
    n_iter_ : int, converged_ : bool
        Rounds, and whether `tol` ended them.
    n_features_in_ : int
        D.
    mean_prior_, covariance_prior_, degrees_of_freedom_prior_
        The prior that was used: (D,), (D, D), float.

    Raises
    ------
    ValueError
        For parameters out of range, points that are not finite or beyond 1e140, weights that are negative,
        not finite, all zero or so large that sums of squares overflow; each message names the argument. A
        spread below about 1e-152 counts as none.
    """

    _NUMBERS = ("weight_concentration_prior", "mean_precision_prior", "prune_weight")
    _OPTIONAL_NUMBERS = ("degrees_of_freedom_prior", "tol")
    _WORDS = {"init": '"kmeans++" or "random"'}
    _compiled_densities = staticmethod(_mixture_densities)

    weights_: Array
    means_: Array
    covariances_: Array
    precisions_: Array
    weight_concentration_: Array
    mean_precision_: Array
    degrees_of_freedom_: Array
    lower_bounds_: Array
    lower_bound_: float
    n_iter_: int
    converged_: bool
    n_features_in_: int
    mean_prior_: Array
    covariance_prior_: Array
    degrees_of_freedom_prior_: float

    def __init__(
        self,
        n_components: int = 12,
        *,
        weight_concentration_prior: float = 0.1,
        mean_precision_prior: float = 1e-3,
        mean_prior: ArrayLike | None = None,
        degrees_of_freedom_prior: float | None = None,
        covariance_prior: ArrayLike | None = None,
        max_iter: int = 100,
        tol: float | None = 1e-4,
        n_init: int = 1,
        init: str = "kmeans++",
        prune_weight: float = 0.0,
        warm_start: bool = False,
        random_state: Any = None,
        threads: int | None = None,
    ) -> None:
        self.n_components = n_components
        self.weight_concentration_prior = weight_concentration_prior
        self.mean_precision_prior = mean_precision_prior
        self.mean_prior = mean_prior
        self.degrees_of_freedom_prior = degrees_of_freedom_prior
        self.covariance_prior = covariance_prior
        self.max_iter = max_iter
        self.tol = tol
        self.n_init = n_init
        self.init = init
        self.prune_weight = prune_weight
        self.warm_start = warm_start
        self.random_state = random_state
        self.threads = threads

    def fit(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None, resp: ArrayLike | None = None) -> Self:
        """Fits the mixture to points.

        Parameters
        ----------
        X : array (N, D)
            Points.
        y : ignored
            Only there for pipelines, as scikit-learn's conventions want it before the weights: `fit(X, w)`
            does not weight. A UserWarning says so where a `y` of fractions, none negative, looks like weights
            and there is no `sample_weight` (no unit).
        sample_weight : array (N,)
            Evidence of each point, not negative; default 1.
        resp : array (N, n_components)
            First responsibilities, rows that sum to 1, in place of `init`.
        """
        _warn_of(y, sample_weight)
        points, weights = self._points(X, fitting=True), _weights(sample_weight)
        start = self._state if self.warm_start and self._continues(points) else None
        self._take(_mixture_fit(points, weights, self._parameters(), None if resp is None else _reals("resp", resp), start))
        return self

    def partial_fit(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None, forgetting: float = 1.0) -> Self:
        """Adds a batch of points to the mixture; the first batch is a fit.

        Responsibilities of earlier points stay as they were; of them only weights, means and scatters of the
        components are kept, times `forgetting`. Rounds maximise the lower bound of earlier and new points
        together. The prior is that of the first batch, and so is the number of components.

        Parameters
        ----------
        X : array (N, D)
            Points of the batch.
        y : ignored
            As of `fit` (no unit).
        sample_weight : array (N,)
            Evidence of each point, not negative; default 1.
        forgetting : float in (0, 1], no unit
            What earlier points weigh after this batch over what they weighed before.
        """
        _warn_of(y, sample_weight)
        first = not hasattr(self, "_state")
        points, weights = self._points(X, fitting=first), _weights(sample_weight)
        _demand("forgetting", forgetting, numbers.Real, "a number")
        if not first and self.n_components != self._state["n_components"]:
            raise ValueError(f"n_components: expected {self._state['n_components']} as for the earlier points, got {self.n_components}")
        self._take(_mixture_partial_fit(points, weights, self._parameters(), None if first else self._state, float(forgetting)))
        return self

    def score_samples(self, X: ArrayLike) -> Array:
        """How well points (N, D) are explained, (N,): `ln sum_k rho_nk` of equation (14), natural logarithm,
        as scikit-learn returns it.

        Expected logarithms make it less than the log of a density, by the more the fewer points the
        components have.
        """
        return self._densities(X)[0]

    def _continues(self, points: Array) -> bool:
        """Whether a fit may begin with the components of the last one."""
        return hasattr(self, "_state") and self.n_features_in_ == points.shape[1] and len(self.weights_) <= self.n_components

    def _take(self, state: dict[str, Any]) -> None:
        """The attributes that a fit leaves."""
        self._state = {**state, "n_components": self.n_components}
        alpha, nu = state["weight_concentration"], state["degrees_of_freedom"]
        self.weight_concentration_, self.degrees_of_freedom_ = alpha, nu
        self.mean_precision_, self.means_ = state["mean_precision"], state["means"]
        self.weights_ = alpha / alpha.sum()
        self.covariances_ = state["scale_inverses"] / nu[:, None, None]
        self.precisions_ = state["precisions"]
        self.lower_bounds_, self.lower_bound_ = state["lower_bounds"], float(state["lower_bounds"][-1])
        self.n_iter_, self.converged_ = len(self.lower_bounds_), state["converged"]
        self.n_features_in_ = self.means_.shape[1]
        self.mean_prior_, self.covariance_prior_ = state["prior_mean"], state["prior_scale_inverse"]
        self.degrees_of_freedom_prior_ = state["prior_degrees_of_freedom"]
