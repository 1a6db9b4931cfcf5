"""Dirichlet-process mixtures of Gaussians for points with weights."""

from __future__ import annotations

from typing import Any, Self

from numpy.typing import ArrayLike

from ._jacoflow import _mixture_dirichlet_densities, _mixture_dirichlet_fit
from ._mixture_base import Array, PointMixture, _reals, _warn_of, _weights

__all__ = ["DirichletProcessGaussianMixture"]


class DirichletProcessGaussianMixture(PointMixture):
    """A Dirichlet-process mixture of Gaussians in D dimensions, fitted to weighted points; the number of
    components is found.

    `v_k ~ Beta(1, alpha)`, `pi_k = v_k prod_(j<k) (1 - v_j)`, `(mu_k, Sigma_k) ~ NIW(m0, kappa0, nu0, Psi0)`
    with `m0` the weighted mean and `Psi0 = S0 + floor I`, truncated at K components (T. Ferguson, "A Bayesian
    analysis of some nonparametric problems", 1973; J. Sethuraman, "A constructive definition of Dirichlet
    priors", 1994). A weight is a number of observations: a weight of 3 is the point three times. Starts are
    weighted k-means++ seeds on standardised axes. The result is the same for any number of threads and,
    except for rounding, any order of the points. Equations: `docs/dirichlet_mixture.md`.

    Parameters
    ----------
    n_components : int
        K, largest number of components, up to 4096 (no unit).
    weight_concentration : float
        `alpha` of the Dirichlet process, from 1e-100 to 1e100, no unit.
    inference : "map" or "vb"
        Expectation-maximization to the mode of the posterior, or variational Bayes.
    merge : bool
        Whether pairs of components are pooled while that raises F. Without it "map" does not empty
        components: a large Gaussian stays divided among several.
    mean_precision : float
        `kappa0`, the number of points that the prior of a mean is worth, from 1e-100 to 1e100, no unit.
    degrees_of_freedom : float
        `nu0` of the inverse Wishart prior, above D - 1; default D + 2.
    covariance_prior : array (D, D) or float, units of X squared
        `S0`, or its diagonal; default: the weighted covariance over `K^(2/D)`.
    covariance_floor : float, units of X squared
        Variance added to the diagonals of `S0` and of every covariance.
    n_init : int
        Number of starts, of which the one with the largest F is kept.
    max_iter : int
        Largest number of rounds from a start, and after each pooled pair.
    tol : float or None
        Rounds end when the mean log-likelihood of the points changes by less; None: exactly `max_iter`
        rounds.
    random_state : int, numpy.random.RandomState, numpy.random.Generator or None
        Seed; None: numpy's global one.
    threads : int or None
        Number of threads; default: the environment variable JACOFLOW_THREADS, or every processor.

    Attributes
    ----------
    weights_ : array (K,)
        Proportions `pi_k`, which sum to 1; of "vb" their expectations.
    means_ : array (K, D), units of X
        `mu_k`.
    covariances_ : array (K, D, D), units of X squared
        `Sigma_k`.
    counts_ : array (K,)
        `N_k`, weight of the points of each component, decreasing.
    lower_bound_ : float
        F, the log evidence of the points divided among the components as found, natural logarithm.
    n_active_ : int
        Number of components with more than 0.5 % of the weight of all points.
    n_iter_ : int, converged_ : bool
        Number of rounds that led to the result, and whether `tol` ended the last ones.
    n_features_in_ : int
        D.

    Raises
    ------
    ValueError
        For parameters out of range, points that are not finite or beyond 1e140, weights that are negative,
        not finite, all zero or so large that sums of squares overflow; each message names the argument.

    Examples
    --------
    >>> import numpy as np
    >>> from jacoflow.mixture import DirichletProcessGaussianMixture
    >>> rng = np.random.default_rng(0)
    >>> x = np.concatenate([rng.normal(0, 1, (200, 2)), rng.normal(8, 1, (100, 2))])
    >>> mixture = DirichletProcessGaussianMixture(random_state=0).fit(x)
    >>> mixture.n_active_, mixture.weights_[:2].round(2).tolist()
    (2, [0.67, 0.33])
    """

    _NUMBERS = ("weight_concentration", "mean_precision", "covariance_floor")
    _OPTIONAL_NUMBERS = ("degrees_of_freedom", "tol")
    _WORDS = {"inference": '"map" or "vb"'}
    _SWITCHES = ("merge",)
    _compiled_densities = staticmethod(_mixture_dirichlet_densities)

    weights_: Array
    means_: Array
    covariances_: Array
    counts_: Array
    lower_bound_: float
    n_active_: int
    n_iter_: int
    converged_: bool
    n_features_in_: int

    def __init__(
        self,
        n_components: int = 12,
        weight_concentration: float = 1.0,
        *,
        inference: str = "map",
        merge: bool = True,
        mean_precision: float = 0.01,
        degrees_of_freedom: float | None = None,
        covariance_prior: ArrayLike | None = None,
        covariance_floor: float = 1e-6,
        n_init: int = 1,
        max_iter: int = 100,
        tol: float | None = 1e-4,
        random_state: Any = None,
        threads: int | None = None,
    ) -> None:
        self.n_components = n_components
        self.weight_concentration = weight_concentration
        self.inference = inference
        self.merge = merge
        self.mean_precision = mean_precision
        self.degrees_of_freedom = degrees_of_freedom
        self.covariance_prior = covariance_prior
        self.covariance_floor = covariance_floor
        self.n_init = n_init
        self.max_iter = max_iter
        self.tol = tol
        self.random_state = random_state
        self.threads = threads

    def fit(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None, resp: ArrayLike | None = None) -> Self:
        """Fits the mixture to points.

        Parameters
        ----------
        X : array (N, D)
            Points.
        y : ignored
            Only there for pipelines, as scikit-learn's conventions want it before the weights (no unit).
        sample_weight : array (N,)
            Number of observations that each point stands for, not negative; default 1. Points of weight 0 are
            ignored.
        resp : array (N, n_components)
            First responsibilities, rows that sum to 1, in place of k-means++ seeds; `n_init` is not used
            then.
        """
        _warn_of(y, sample_weight)
        points, weights = self._points(X, fitting=True), _weights(sample_weight)
        first = None if resp is None else _reals("resp", resp)
        state = _mixture_dirichlet_fit(points, weights, self._parameters(), first)
        self._state = state
        self.weights_, self.means_, self.covariances_ = state["weights"], state["means"], state["covariances"]
        self.counts_, self.lower_bound_ = state["counts"], state["lower_bound"]
        self.n_active_, self.n_iter_, self.converged_ = state["n_active"], state["n_iter"], state["converged"]
        self.n_features_in_ = self.means_.shape[1]
        return self

    def score_samples(self, X: ArrayLike) -> Array:
        """Log density (N,) of the mixture at points (N, D), natural logarithm; of "vb" the sum of the
        expected densities' logarithms, which is less."""
        return super().score_samples(X)
