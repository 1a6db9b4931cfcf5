"""Weighted variational mixtures: agreement with scikit-learn on repeated points, conventions, edge cases."""

import pickle
import subprocess
import sys
import warnings

import numpy as np
import pytest
from scipy.special import gammaln
from scipy.stats import multivariate_t
from sklearn.base import clone
from sklearn.mixture import BayesianGaussianMixture
from sklearn.utils.estimator_checks import check_estimator

from jacoflow.mixture import VariationalGaussianMixture


def clusters(count, dimensions, seed=0, apart=6.0):
    """Points (N, D) about four centres `apart`, whole weights (N,), responsibilities (N, 6)."""
    rng = np.random.default_rng(seed)
    centres, labels = rng.normal(0, apart, (4, dimensions)), rng.integers(4, size=count)
    x = centres[labels] + rng.normal(0, 1, (count, dimensions))
    # From wholly random responsibilities rounding decides between optima.
    return x, rng.integers(0, 5, count), 0.5 * np.eye(6)[labels] + 0.5 * rng.dirichlet(np.ones(6), count)


def full_bound(reference, d, total):
    """scikit-learn's lower bound with the constants that it drops."""
    alpha0, nu0, k = reference.weight_concentration_prior_, reference.degrees_of_freedom_prior_, reference.n_components
    halves = gammaln((nu0 + 1 - np.arange(1, d + 1)) / 2).sum()
    wishart = 0.5 * nu0 * np.linalg.slogdet(reference.covariance_prior_)[1] - 0.5 * nu0 * d * np.log(2) - halves
    constants = gammaln(k * alpha0) - k * gammaln(alpha0) + k * wishart + k * d / 2 * np.log(reference.mean_precision_prior_)
    return reference.lower_bound_ + constants - d * total / 2 * np.log(2 * np.pi)


class FromResponsibilities(BayesianGaussianMixture):
    """scikit-learn's mixture, begun with given responsibilities."""

    def _initialize_parameters(self, X, random_state, xp=None):
        self._initialize(X, self.resp)


@pytest.mark.parametrize("d", [2, 3, 5])
@pytest.mark.parametrize("rounds", [2, 10, 100])
def test_agrees_with_scikit_learn_on_repeated_points(d, rounds):
    x, f, resp = clusters(900, d)
    repeated = np.repeat(x, f, axis=0)
    mean = np.average(x, axis=0, weights=f)
    reference = FromResponsibilities(
        n_components=6, weight_concentration_prior_type="dirichlet_distribution", weight_concentration_prior=0.1, mean_precision_prior=1e-3, mean_prior=mean,
        degrees_of_freedom_prior=d + 9.1, covariance_prior=0.1 * np.eye(d), reg_covar=0, max_iter=rounds - 1, tol=0,
    )  # fmt: skip
    reference.resp = np.repeat(resp, f, axis=0)
    with pytest.warns(Warning):
        reference.fit(repeated)
    ours = VariationalGaussianMixture(6, covariance_prior=0.1, tol=None, max_iter=rounds).fit(x, sample_weight=f, resp=resp)
    assert ours.n_iter_ == rounds
    # On its way a fit of three dimensions doubles rounding each round for a while; what is 0 or nearly so is
    # compared with the size of the others.
    midway = (d, rounds) == (3, 10)
    relative, shares = (1e-11, 1e-11) if midway else (6e-13, 2e-12)
    for name in ("weight_concentration_", "mean_precision_", "degrees_of_freedom_", "weights_", "covariances_"):
        theirs = getattr(reference, name)
        np.testing.assert_allclose(getattr(ours, name), theirs, rtol=relative, atol=6e-13 * theirs.max(), err_msg=name)
    np.testing.assert_allclose(ours.means_, reference.means_, rtol=0, atol=1e-11)
    np.testing.assert_allclose(ours.predict_proba(x), reference.predict_proba(x), rtol=0, atol=shares)
    np.testing.assert_allclose(ours.score_samples(x), reference.score_samples(x), rtol=2e-12)
    np.testing.assert_allclose(ours.lower_bound_, full_bound(reference, d, f.sum()), rtol=4e-15)


@pytest.mark.parametrize("d", [1, 2, 7, 12])
def test_weights_are_repetitions_and_seeds_do_not_know_the_order(d):
    x, f, _ = clusters(400, d)
    order = np.random.default_rng(1).permutation(f.sum())
    ours = VariationalGaussianMixture(5, random_state=3).fit(x, sample_weight=f)
    repeated = VariationalGaussianMixture(5, random_state=3).fit(np.repeat(x, f, axis=0)[order])
    np.testing.assert_allclose(repeated.means_, ours.means_, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(repeated.lower_bound_, ours.lower_bound_, rtol=1e-11)


@pytest.mark.parametrize("d", [1, 2, 3, 7])
def test_one_component_has_the_exact_posterior_and_evidence(d):
    """Of one Gaussian with a conjugate prior all is known: the evidence is the product of what is predicted
    of each point from those before it, which are Student's t."""
    rng = np.random.default_rng(d)
    x = rng.normal(size=(30, d)) @ rng.normal(size=(d, d)) + 3
    beta, nu, mean, scatter = 0.5, d + 2.0, np.full(d, 0.2), 0.7 * np.eye(d)
    prior = {"mean_prior": mean, "mean_precision_prior": beta, "degrees_of_freedom_prior": nu, "covariance_prior": scatter}
    mixture = VariationalGaussianMixture(1, **prior, tol=None, max_iter=2).fit(x)
    evidence = 0.0
    for point in x:
        evidence += multivariate_t.logpdf(point, mean, scatter * (beta + 1) / (beta * (nu - d + 1)), df=nu - d + 1)
        off = point - mean
        scatter = scatter + beta / (beta + 1) * np.outer(off, off)
        mean, beta, nu = mean + off / (beta + 1), beta + 1, nu + 1
    np.testing.assert_allclose(mixture.lower_bound_, evidence, rtol=1e-12)
    np.testing.assert_allclose(mixture.means_[0], mean, rtol=1e-12)
    np.testing.assert_allclose(mixture.covariances_[0], scatter / nu, rtol=1e-11)


def test_bound_rises_and_ends_by_tolerance():
    x, f, _ = clusters(2000, 3)
    mixture = VariationalGaussianMixture(8, random_state=0, tol=1e-4).fit(x, sample_weight=f)
    steps = np.diff(mixture.lower_bounds_)
    assert mixture.converged_ and mixture.n_iter_ == len(steps) + 1
    assert (steps > -1e-9 * abs(mixture.lower_bound_)).all()
    assert steps[-1] < 1e-4 * f.sum() <= steps[:-1].min()
    assert not VariationalGaussianMixture(8, random_state=0, tol=None, max_iter=5).fit(x).converged_


def test_several_starts_keep_the_best():
    x, f, _ = clusters(500, 2, seed=4)
    once = [VariationalGaussianMixture(4, random_state=0, n_init=n, init="random").fit(x, sample_weight=f).lower_bound_ for n in (1, 8)]
    assert once[1] >= once[0]


@pytest.mark.parametrize("threads", [1, 2])
def test_deterministic_and_pickled(threads):
    x, f, _ = clusters(5000, 3)
    usual = VariationalGaussianMixture(6, random_state=5).fit(x, sample_weight=f)
    ours = VariationalGaussianMixture(6, random_state=5, threads=threads).fit(x, sample_weight=f)
    again = pickle.loads(pickle.dumps(ours))
    for name in ("means_", "covariances_", "lower_bounds_"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(usual, name))
        np.testing.assert_array_equal(getattr(again, name), getattr(usual, name))
    np.testing.assert_array_equal(again.predict(x), usual.fit_predict(x, sample_weight=f))


def test_warm_start_goes_on():
    x, _, _ = clusters(800, 2)
    all_at_once = VariationalGaussianMixture(4, random_state=0, tol=None, max_iter=30).fit(x)
    steps = VariationalGaussianMixture(4, random_state=0, tol=None, max_iter=15, warm_start=True)
    steps.fit(x).fit(x)
    np.testing.assert_allclose(steps.means_, all_at_once.means_, rtol=1e-9)


def test_batches_and_a_single_fit():
    x, f, _ = clusters(3000, 3, apart=20.0)
    parameters = {"mean_prior": np.average(x, axis=0, weights=f), "covariance_prior": 0.1, "random_state": 0, "tol": 1e-8, "max_iter": 300}
    whole = VariationalGaussianMixture(4, **parameters).fit(x, sample_weight=f)
    first = VariationalGaussianMixture(4, **parameters).partial_fit(x, sample_weight=f)
    np.testing.assert_array_equal(first.means_, whole.means_)
    batches = VariationalGaussianMixture(4, **parameters)
    for batch in range(10):
        batches.partial_fit(x[batch::10], sample_weight=f[batch::10])
    order, other = (np.argsort(mixture.means_[:, 0]) for mixture in (whole, batches))
    np.testing.assert_allclose(batches.weight_concentration_[other], whole.weight_concentration_[order], rtol=1e-3)
    np.testing.assert_allclose(batches.means_[other], whole.means_[order], rtol=1e-3, atol=1e-3)
    with pytest.raises(ValueError, match="forgetting"):
        batches.partial_fit(x, forgetting=0.0)
    with pytest.raises(ValueError, match="expecting 3 features"):
        batches.partial_fit(x[:, :2])


@pytest.mark.parametrize("forgetting", [1.0, 0.6, 0.1])
@pytest.mark.parametrize("components", [1, 3])
def test_forgetting_is_a_fit_with_weights_by_age(components, forgetting):
    """Where responsibilities are beyond doubt, batches leave what one fit does whose weights are `forgetting`
    to the power of their age."""
    rng = np.random.default_rng(0)
    centres = np.array([[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [0.0, 80.0, 30.0]])[:components]
    batches = [centres[rng.integers(components, size=200)] + rng.normal(size=(200, 3)) for _ in range(6)]
    weights = [rng.uniform(0.2, 3, 200) for _ in batches]
    parameters = {"mean_prior": [20.0, 20.0, 10.0], "covariance_prior": 0.5, "random_state": 0, "tol": None, "max_iter": 60}
    online = VariationalGaussianMixture(components, **parameters)
    for x, w in zip(batches, weights, strict=True):
        online.partial_fit(x, sample_weight=w, forgetting=forgetting)
    aged = np.concatenate([w * forgetting ** (5 - age) for age, w in enumerate(weights)])
    whole = VariationalGaussianMixture(components, **parameters).fit(np.concatenate(batches), sample_weight=aged)
    first, second = (np.argsort(mixture.means_ @ [1, 2, 3]) for mixture in (online, whole))
    for name in ("weight_concentration_", "mean_precision_", "degrees_of_freedom_", "covariances_"):
        np.testing.assert_allclose(getattr(online, name)[first], getattr(whole, name)[second], rtol=1e-11, atol=1e-13, err_msg=name)
    np.testing.assert_allclose(online.means_[first], whole.means_[second], rtol=0, atol=1e-11)
    np.testing.assert_allclose(online.lower_bound_, whole.lower_bound_, rtol=1e-13)


def test_forgetting_follows_what_moves():
    rng = np.random.default_rng(0)
    mixture = VariationalGaussianMixture(2, random_state=0)
    for step in range(30):
        mixture.partial_fit(rng.normal([[0.3 * step], [20.0]], 0.1, (2, 200)).reshape(-1, 1), forgetting=0.3)
    assert abs(mixture.means_.min() - (8.7 - 0.3 * 0.3 / 0.7)) < 0.02
    assert mixture.weight_concentration_.sum() == pytest.approx(400 / 0.7 + 0.2, rel=1e-6)


def test_pruned_components_are_gone():
    x, _, _ = clusters(500, 2)
    mixture = VariationalGaussianMixture(20, covariance_prior=0.1, prune_weight=5, random_state=0).fit(x)
    assert 4 <= len(mixture.weights_) < 20 and mixture.predict_proba(x).shape == (500, len(mixture.weights_))


@pytest.mark.parametrize(
    "x",
    [np.zeros((1, 3)), np.full((50, 2), 4.0), np.arange(40.0).reshape(-1, 2), np.c_[np.arange(9.0), np.zeros(9)], [[0.0], [1e6], [-1e6], [1.0]]],
    ids=["one point", "all equal", "a line", "a plane", "far outliers"],
)
@pytest.mark.parametrize("weight", [1e-8, 1.0, 1e8])
def test_degenerate_points_stay_finite(x, weight):
    mixture = VariationalGaussianMixture(12, random_state=0).fit(x, sample_weight=np.full(len(x), weight))
    for name in ("weights_", "means_", "covariances_", "precisions_", "lower_bounds_"):
        assert np.isfinite(getattr(mixture, name)).all(), name
    np.testing.assert_allclose(mixture.predict_proba(x).sum(1), 1)
    assert (np.linalg.eigvalsh(mixture.covariances_) > 0).all()


@pytest.mark.parametrize("d", [2, 3, 10])
@pytest.mark.parametrize("prior", [1e-3, 1e-12])
def test_what_rounding_makes_singular_is_fitted_all_the_same(d, prior):
    line = 1e6 * np.random.default_rng(0).normal(size=(100, 1)).repeat(d, axis=1)
    mixture = VariationalGaussianMixture(3, random_state=0, covariance_prior=prior).fit(line)
    precisions = mixture.precisions_
    assert np.isfinite(precisions).all()
    np.testing.assert_array_equal(precisions, precisions.transpose(0, 2, 1))
    assert (np.einsum("kii->ki", precisions) > 0).all()
    np.testing.assert_allclose(mixture.predict_proba(line).sum(1), 1)


@pytest.mark.parametrize("d", [1, 3, 7, 10])
@pytest.mark.parametrize("unit", [1e-150, 1e-20, 1e20, 1e130])
def test_the_unit_of_the_points_makes_no_difference(d, unit):
    x, f, _ = clusters(200, d)
    usual, other = (VariationalGaussianMixture(4, random_state=0).fit(points, sample_weight=f) for points in (x, unit * x))
    np.testing.assert_allclose(other.means_ / unit, usual.means_, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(other.predict(unit * x), usual.predict(x))


@pytest.mark.parametrize("unit", [1e-300, 1e-160, 1e-155])
def test_a_spread_whose_square_is_no_number_is_none(unit):
    x, _, _ = clusters(100, 2)
    mixture = VariationalGaussianMixture(3, random_state=0).fit(unit * x)
    for name in ("weights_", "means_", "covariances_", "precisions_", "lower_bounds_"):
        assert np.isfinite(getattr(mixture, name)).all(), name
    np.testing.assert_allclose(mixture.predict_proba(unit * x).sum(1), 1)


@pytest.mark.parametrize(("unit", "weight"), [(1.0, 1e306), (1e100, 1e200), (1e100, 1e300)])
def test_weights_whose_sums_overflow_are_named(unit, weight):
    x, _, _ = clusters(50, 2)
    with pytest.raises(ValueError, match="sample_weight: "):
        VariationalGaussianMixture(2, random_state=0).fit(unit * x, sample_weight=np.full(50, weight))


def test_a_point_without_weight_is_predicted_and_not_fitted():
    x, f, _ = clusters(300, 2)
    weights = f.astype(float)
    weights[0] = 0
    far = x.copy()
    far[0] = 1e3
    ours, without = (VariationalGaussianMixture(4, random_state=0).fit(points, sample_weight=weights) for points in (far, x))
    np.testing.assert_allclose(ours.means_, without.means_, rtol=1e-9)
    assert ours.predict(far).shape == (300,)


def test_twice_the_weights_is_another_fit():
    x, _, _ = clusters(60, 2)
    once, twice = (VariationalGaussianMixture(3, random_state=0, covariance_prior=1.0).fit(x, sample_weight=np.full(60, w)) for w in (1, 2))
    assert twice.weight_concentration_.sum() == pytest.approx(2 * 60 + 0.3)
    assert not np.allclose(once.covariances_, twice.covariances_, rtol=1e-3)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n_components", 0), ("n_components", 10**9), ("n_components", 2**63), ("mean_prior", [1e300, 0.0]), ("threads", -1), ("weight_concentration_prior", 0.0), ("mean_precision_prior", -1.0), ("mean_prior", [0.0]), ("degrees_of_freedom_prior", 1.0),
        ("covariance_prior", [[1.0, 2.0], [2.0, 1.0]]), ("covariance_prior", [[1.0, 0.5], [0.0, 1.0]]), ("covariance_prior", np.eye(3)), ("covariance_prior", -1.0),
        ("max_iter", 0), ("tol", -1.0), ("n_init", -2), ("init", "magic"), ("prune_weight", np.nan), ("threads", 0), ("random_state", -1),
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        VariationalGaussianMixture(**{"n_components": 2, name: value}).fit(np.arange(20.0).reshape(-1, 2))


@pytest.mark.parametrize(
    ("weights", "x"),
    [([1.0, -1.0], None), ([0.0, 0.0], None), ([np.nan, 1.0], None), ([1.0], None), (np.ones((2, 1)), None), (None, [[np.inf, 0.0], [0, 0]]), (None, np.zeros((0, 2)))],
)
def test_points_and_weights_that_cannot_be_used_are_named(weights, x):
    with pytest.raises(ValueError, match="X" if weights is None else "sample_weight"):
        VariationalGaussianMixture(2).fit(np.eye(2) if x is None else x, sample_weight=weights)


@pytest.mark.parametrize("resp", [np.full((2, 3), 1 / 3), np.full((2, 2), 0.4), [[2.0, -1.0], [0.5, 0.5]], np.full(2, 0.5)])
def test_responsibilities_that_cannot_be_used_are_named(resp):
    with pytest.raises(ValueError, match="resp"):
        VariationalGaussianMixture(2).fit(np.eye(2), resp=resp)


@pytest.mark.parametrize(("name", "value"), [("threads", 1.5), ("init", None), ("tol", "a"), ("n_components", 2.0)])
def test_parameters_of_another_kind_are_named(name, value):
    with pytest.raises(TypeError, match=name):
        VariationalGaussianMixture(**{"n_components": 2, name: value}).fit(np.arange(20.0).reshape(-1, 2))


def test_arrays_that_are_no_plain_numbers_are_refused():
    x, _, _ = clusters(50, 2)
    for wrong in (np.ma.masked_array(x, mask=x > 0), x.astype("datetime64[s]")):
        with pytest.raises(TypeError, match="X: "):
            VariationalGaussianMixture(2).fit(wrong)
    with pytest.raises(TypeError, match="sample_weight: "):
        VariationalGaussianMixture(2).fit(x, sample_weight=np.ma.masked_array(np.ones(50)))


def test_batches_keep_their_number_of_components():
    x, _, _ = clusters(200, 2)
    mixture = VariationalGaussianMixture(6, random_state=0, prune_weight=5).partial_fit(x)
    mixture.partial_fit(x)
    with pytest.raises(ValueError, match="n_components"):
        mixture.set_params(n_components=3).partial_fit(x)
    with pytest.raises(TypeError, match="forgetting"):
        mixture.set_params(n_components=6).partial_fit(x, forgetting="a")


@pytest.mark.parametrize("weights", [np.full(50, -1.0), np.zeros(50), np.ones(49), np.full(50, np.nan)])
def test_scores_check_their_weights(weights):
    x, _, _ = clusters(50, 2)
    with pytest.raises(ValueError, match="sample_weight"):
        VariationalGaussianMixture(2, random_state=0).fit(x).score(x, sample_weight=weights)


def test_refusals_say_what_is_wrong():
    x = np.random.default_rng(0).normal(size=(50, 2))
    mixture = VariationalGaussianMixture(2, random_state=0).fit(x)
    for weights, named in [(np.zeros(50), "all zero"), (np.ones(49), "shape \\(49,\\)"), (np.full(50, -1.0), "-1"), (np.full(50, np.nan), "nan")]:
        with pytest.raises(ValueError, match=f"^sample_weight: .*got {named}"):
            mixture.score(x, sample_weight=weights)
    with pytest.raises(ValueError, match="^X: .*one length"):
        mixture.fit([[1.0, 2.0], [3.0]])
    for name in ("mean_precision_prior", "weight_concentration_prior"):
        with pytest.raises(ValueError, match=f"^{name}: .*1e-100"):
            VariationalGaussianMixture(2, **{name: 5e-324}).fit(x)
        assert np.isfinite(VariationalGaussianMixture(2, random_state=0, **{name: 1e-100}).fit(x).lower_bound_)


def test_scikit_learns_conventions():
    mixture = VariationalGaussianMixture(3, tol=1e-3, random_state=1)
    assert clone(mixture).get_params() == mixture.get_params()
    assert repr(mixture) == "VariationalGaussianMixture(n_components=3, random_state=1, tol=0.001)"
    check_estimator(mixture, on_skip=None)


def test_weights_in_the_place_of_y_are_not_dropped_in_silence():
    x, f, _ = clusters(100, 2)
    mixture = VariationalGaussianMixture(2, random_state=0)
    for given in (mixture.fit, mixture.partial_fit, mixture.fit_predict, mixture.score):
        with pytest.warns(UserWarning, match="sample_weight="):
            given(x, f / 3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mixture.fit(x, None, f).score(x, np.arange(100) / 3, f)
        # Labels, as pipelines give them, and what cannot be weights.
        for labels in (np.arange(100) % 3, [f"kind {i % 3}" for i in range(100)], np.linspace(-1, 1, 100)):
            mixture.fit(x, labels).score(x, labels)


def test_the_default_prior_does_not_jump_with_the_weights():
    x, _, _ = clusters(60, 2)
    of = [np.diag(VariationalGaussianMixture(2, random_state=0).fit(x, sample_weight=np.full(60, total / 60)).covariance_prior_) for total in (0.5, 2 - 1e-9, 2, 2 + 1e-9)]
    np.testing.assert_allclose(of[1], of[2], rtol=1e-7)
    np.testing.assert_allclose(of[3], of[2], rtol=1e-7)
    np.testing.assert_allclose(of[0], of[2], rtol=1e-12)
    np.testing.assert_allclose(np.diag(VariationalGaussianMixture(2, random_state=0).fit(x).covariance_prior_), np.var(x, axis=0, ddof=1), rtol=1e-12)


def test_works_without_scikit_learn():
    program = """if True:
        import sys
        sys.modules["sklearn"] = None
        import jacoflow
        mixture = jacoflow.mixture.VariationalGaussianMixture(3, random_state=1)
        assert repr(mixture) == "VariationalGaussianMixture(n_components=3, random_state=1)", repr(mixture)
        assert mixture.set_params(tol=None).get_params()["tol"] is None
        for wrong in (lambda: mixture.set_params(magic=1), lambda: mixture.predict([[0.0]])):
            try:
                wrong()
            except (ValueError, AttributeError) as error:
                assert "magic" in str(error) or "not fitted" in str(error), error
            else:
                raise AssertionError
        assert mixture.fit_predict([[0.0], [0.1], [9.0]]).shape == (3,)
    """
    subprocess.run([sys.executable, "-c", program], check=True)
