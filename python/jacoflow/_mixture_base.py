"""What the mixtures of `jacoflow.mixture` share: scikit-learn's conventions, without needing scikit-learn."""

from __future__ import annotations

import inspect
import numbers
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._checks import switch

Array = NDArray[np.float64]


class _Parameters:
    """What scikit-learn's `BaseEstimator` does for parameters, where that is not installed."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters by name, as they were given (their units); `deep` makes no difference."""
        return {name: getattr(self, name) for name in _names(type(self))}

    def set_params(self, **parameters: Any) -> Self:
        """Sets parameters by name (in their units); ValueError for a name that there is none of."""
        for name, value in parameters.items():
            if name not in _names(type(self)):
                raise ValueError(f"Invalid parameter {name!r} for estimator {self}. Valid parameters are: {_names(type(self))!r}.")
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        defaults = {name: parameter.default for name, parameter in inspect.signature(type(self)).parameters.items()}
        changed = [f"{name}={value!r}" for name, value in self.get_params().items() if repr(value) != repr(defaults[name])]
        return f"{type(self).__name__}({', '.join(changed)})"


if TYPE_CHECKING:
    _Base = _Parameters
else:
    try:
        from sklearn.base import BaseEstimator as _Base
    except ImportError:
        _Base = _Parameters


class PointMixture(_Base):
    """A mixture of Gaussians for weighted points: prediction, scores and checks of points. Subclasses fit,
    and keep what they fitted in `_state`."""

    _NUMBERS: ClassVar[tuple[str, ...]] = ()
    """Parameters that are numbers, in their units."""
    _OPTIONAL_NUMBERS: ClassVar[tuple[str, ...]] = ()
    """Parameters that are numbers or None, in their units."""
    _WORDS: ClassVar[dict[str, str]] = {}
    """Parameters that are words, and which (no unit)."""
    _SWITCHES: ClassVar[tuple[str, ...]] = ()
    """Parameters that are True or False (no unit)."""
    _compiled_densities: ClassVar[Callable[..., tuple[Array, Array]]]

    means_: Array
    n_features_in_: int
    threads: int | None
    random_state: Any
    _state: dict[str, Any]

    def fit(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None, resp: ArrayLike | None = None) -> Self:
        """Fits the mixture to points (N, D) with weights (N,), from responsibilities (N, K) if given."""
        raise NotImplementedError

    def _log_densities(self, points: Array) -> tuple[Array, Array]:
        return type(self)._compiled_densities(points, self._state, self.threads)

    def _parameters(self) -> dict[str, Any]:
        """Checked parameters, in their units, for the compiled module."""
        parameters = self.get_params()
        for name in ("n_components", "max_iter", "n_init"):
            _demand(name, parameters[name], numbers.Integral, "an integer")
        for name in self._NUMBERS:
            _demand(name, parameters[name], numbers.Real, "a number")
        for name in self._OPTIONAL_NUMBERS:
            if parameters[name] is not None:
                _demand(name, parameters[name], numbers.Real, "a number or None")
        if self.threads is not None:
            _demand("threads", self.threads, numbers.Integral, "an integer or None")
            if not 1 <= self.threads < 2**31:
                raise ValueError(f"threads: expected an integer from 1 to 2^31 - 1, got {self.threads}")
        for name, words in self._WORDS.items():
            _demand(name, parameters[name], str, words)
        for name in self._SWITCHES:
            parameters[name] = switch(name, parameters[name])
        return {**parameters, "random_state": _seed(self.random_state)}

    def fit_predict(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> NDArray[np.int64]:
        """Fits the mixture to points (N, D) and returns the component of each, (N,); `y` as of `fit`."""
        _warn_of(y, sample_weight)
        return self.fit(X, sample_weight=sample_weight).predict(X)

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """The component that each point (N, D) belongs to, (N,): the one with the greatest responsibility."""
        labels: NDArray[np.int64] = np.argmax(self.predict_proba(X), axis=1)
        return labels

    def predict_proba(self, X: ArrayLike) -> Array:
        """Responsibilities (N, K) of the components for points (N, D), equation (13); rows sum to 1."""
        return self._densities(X)[1]

    def score_samples(self, X: ArrayLike) -> Array:
        """Log density (N,) of the mixture at points (N, D), natural logarithm."""
        return self._densities(X)[0]

    def score(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> float:
        """Mean of `score_samples` over points (N, D) with weights (N,)."""
        _warn_of(y, sample_weight)
        scores, weights = self.score_samples(X), _weights(sample_weight)
        if weights is not None:
            _check_weights(weights, len(scores))
        return float(np.average(scores, weights=weights))

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "_state")

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()  # type: ignore[misc]
        tags.estimator_type = "density_estimator"
        return tags

    def _densities(self, X: ArrayLike) -> tuple[Array, Array]:
        if not hasattr(self, "_state"):
            raise _not_fitted(type(self).__name__)
        return self._log_densities(self._points(X, fitting=False))

    def _points(self, X: ArrayLike, *, fitting: bool) -> Array:
        """Points as the compiled module takes them; of the dimension that was fitted unless they are to be
        `fitting`."""
        self._remember_names(X, fitting)
        points = _reals("X", X)
        if points.ndim != 2:
            raise ValueError(f"X: expected 2D array (N, D), got {points.ndim}D array instead. Reshape your data either using X.reshape(-1, 1) or X.reshape(1, -1).")
        if points.shape[0] == 0:
            raise ValueError(f"X: found array with 0 sample(s) (shape={points.shape}) while a minimum of 1 is required.")
        if points.shape[1] == 0:
            raise ValueError(f"X: found array with 0 feature(s) (shape={points.shape}) while a minimum of 1 is required.")
        if not np.isfinite(points).all():
            raise ValueError(f"X: expected finite numbers, got {'NaN' if np.isnan(points).any() else 'infinity'}.")
        if not fitting and points.shape[1] != self.n_features_in_:
            raise ValueError(f"X has {points.shape[1]} features, but {type(self).__name__} is expecting {self.n_features_in_} features as input")
        return points

    def _remember_names(self, X: ArrayLike, fitting: bool) -> None:
        """Names of the columns of a data frame, `feature_names_in_` (D,), which later ones must have as well:
        scikit-learn's own rules, where that is installed."""
        if _Base is not _Parameters:
            from sklearn.utils import validation  # type: ignore[import-untyped, unused-ignore]

            validation._check_feature_names(self, X, reset=fitting)


def _names(kind: type) -> list[str]:
    """Names of the parameters."""
    return sorted(inspect.signature(kind).parameters)


def _warn_of(y: object, sample_weight: ArrayLike | None) -> None:
    """Says that `y` is not looked at, where it may have been meant for weights: of fractions, which no labels
    are, none of them negative. Labels pass in silence, as pipelines hand them to everybody."""
    if y is None or sample_weight is not None:
        return
    given = np.asarray(y)
    if given.ndim == 1 and given.dtype.kind == "f" and np.isfinite(given).all() and (given >= 0).all() and (given != np.rint(given)).any():
        warnings.warn("y is ignored, and there are no weights: give weights as sample_weight=...", UserWarning, stacklevel=3)


def _reals(name: str, values: ArrayLike) -> Array:
    """An array of doubles; TypeError or ValueError naming the argument for what is none."""
    if hasattr(values, "toarray") and not isinstance(values, np.ndarray):
        raise TypeError(f"{name}: sparse data was passed, but dense data is required. Use '.toarray()' to convert to a dense numpy array.")
    if isinstance(values, np.ma.MaskedArray):
        raise TypeError(f"{name}: expected a plain array, got a masked one; leave masked points out, or give them no weight")
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name}: expected numbers, rows of one length: {error}") from error
    if array.dtype.kind in "mM":
        raise TypeError(f"{name}: expected real numbers, got {array.dtype}")
    if array.dtype.kind == "c":
        raise ValueError(f"{name}: Complex data not supported, got {array.dtype}.")
    try:
        return np.ascontiguousarray(array, dtype=np.float64)
    except OverflowError as error:
        raise ValueError(f"{name}: expected numbers of double precision, got {error}") from error
    except (TypeError, ValueError) as error:
        raise type(error)(f"{name}: expected real numbers, got {array.dtype}: {error}") from error


def _weights(sample_weight: ArrayLike | None) -> Array | None:
    return None if sample_weight is None else _reals("sample_weight", sample_weight)


def _check_weights(weights: Array, count: int) -> None:
    """ValueError naming what is wrong with the weights of so many points."""
    expected = f"sample_weight: expected {count} finite weights that are not negative nor all zero, got"
    if weights.shape != (count,):
        raise ValueError(f"{expected} shape {weights.shape}")
    if not np.isfinite(weights).all() or (weights < 0).any():
        raise ValueError(f"{expected} {weights[~(np.isfinite(weights) & (weights >= 0))][0]}")
    if not weights.any():
        raise ValueError(f"{expected} all zero")


def _demand(name: str, value: object, kind: type, words: str) -> None:
    if not isinstance(value, kind) or isinstance(value, bool):
        raise TypeError(f"{name}: expected {words}, got {value!r}")


def _seed(random_state: Any) -> int:
    """A seed of 32 bits out of what scikit-learn's users give."""
    if random_state is None:
        return int(np.random.randint(2**31))
    if isinstance(random_state, np.random.RandomState):
        return int(random_state.randint(2**31))
    if isinstance(random_state, np.random.Generator):
        return int(random_state.integers(2**31))
    _demand("random_state", random_state, numbers.Integral, "an integer, a numpy generator or None")
    if not 0 <= random_state < 2**64:
        raise ValueError(f"random_state: expected an integer from 0 to 2^64 - 1, got {random_state}")
    return int(random_state)


def _not_fitted(name: str) -> Exception:
    """scikit-learn's error where that is installed, else one that is caught the same ways."""
    message = f"This {name} instance is not fitted yet. Call 'fit' with appropriate arguments before using this estimator."
    try:
        from sklearn.exceptions import NotFittedError  # type: ignore[import-untyped, unused-ignore]
    except ImportError:
        return AttributeError(message)
    error: Exception = NotFittedError(message)
    return error
