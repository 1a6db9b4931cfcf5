"""Dirichlet-process mixtures: exact case, oracle in NumPy, bars on random data, conventions, edge cases."""

import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import betaln, digamma, multigammaln
from scipy.stats import multivariate_normal
from sklearn.base import clone
from sklearn.metrics import adjusted_rand_score
from sklearn.utils.estimator_checks import check_estimator

from benchmarks.tables import dirichlet_mixture as bench
from jacoflow.mixture import DirichletProcessGaussianMixture


def case_d1():
    """Points (20, 2), weights (20,) and responsibilities (20, 3) without random numbers."""
    n, k = np.arange(20.0), np.arange(3)
    odd = n % 2
    x = np.c_[6 * odd - 3 + 0.5 * np.sin(3 * n), odd + 0.7 * np.cos(2 * n)]
    resp = 1 + (n[:, None] + 2 * k) % 3 + (k == 1) * odd[:, None]
    return x, 1 + 7 * n % 5, resp / resp.sum(1, keepdims=True)


def exact(rounds, **parameters):
    """Case D1 after so many rounds."""
    x, w, resp = case_d1()
    usual = {"covariance_prior": 1.0, "tol": None, "max_iter": rounds, "merge": False}
    return DirichletProcessGaussianMixture(3, **{**usual, **parameters}).fit(x, sample_weight=w, resp=resp)


def near(got, want):
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-9)


def test_case_d1():
    one, fifty = exact(1), exact(50)
    near(one.weights_, [0.3726190476, 0.3142857143, 0.3130952381])
    near(one.means_[0], [0.2076557433, 0.5493037246])
    near(one.covariances_[0], [[8.3046170468, 1.2590686523], [1.2590686523, 0.4135693004]])
    x, w, _ = case_d1()
    near(one.score_samples(x) @ w, -202.9683311734)
    near(one.lower_bound_, -252.4826636567)
    near(exact(5).lower_bound_, -251.1047977535)
    near(fifty.counts_, [30, 16.0576210948, 13.9423789052])
    near(fifty.lower_bound_, -110.8682226619)
    near(exact(50, weight_concentration=0.5).weights_, [0.5042016807, 0.2724305450, 0.2233677743])
    merged = exact(50, merge=True)
    near(merged.counts_, [30, 30, 0])
    near(merged.means_[1], [-3.3429326694, -0.0303595436])
    near(merged.lower_bound_, -100.9590598399)
    assert merged.n_active_ == 2


def m_step(x, w, resp, prior, alpha, floor, vb):
    """Log factors, means, covariances and score of sorted responsibilities, from the definitions."""
    kappa0, nu0, m0, psi0 = prior
    d = x.shape[1]
    counts = w @ resp
    order = np.argsort(-counts, kind="stable")
    counts, resp = counts[order], resp[:, order]
    behind = np.array([counts[k + 1 :].sum() for k in range(len(counts))])
    kappa, nu = kappa0 + counts, nu0 + counts
    means, psi = np.tile(m0, (len(counts), 1)), np.tile(psi0, (len(counts), 1, 1))
    for k in np.flatnonzero(counts > 0):
        mean = (w * resp[:, k]) @ x / counts[k]
        off = x - mean
        psi[k] += (w * resp[:, k] * off.T) @ off + kappa0 * counts[k] / kappa[k] * np.outer(mean - m0, mean - m0)
        means[k] = (kappa0 * m0 + counts[k] * mean) / kappa[k]
    if vb:
        both = digamma(1 + counts + alpha + behind)
        taken, rest = digamma(1 + counts) - both, digamma(alpha + behind) - both
        gammas = sum(digamma((nu + 1 - i) / 2) for i in range(1, d + 1))
        more, sigma = 0.5 * gammas + d / 2 * np.log(2 / nu) - d / (2 * kappa), psi / nu[:, None, None]
    else:
        beyond = np.maximum(behind + alpha - 1, 0)
        v = np.divide(counts, counts + beyond, out=np.zeros(len(counts)), where=counts > 0)
        v[-1] = 1
        with np.errstate(divide="ignore"):
            taken, rest = np.log(v), np.log(1 - v)
        more, sigma = 0.0, psi / (nu + d + 2)[:, None, None]
    return taken + np.r_[0, np.cumsum(rest[:-1])] + more, means, sigma + floor * np.eye(d), resp


def score(x, w, resp, prior, alpha):
    """F from its definition."""
    kappa0, nu0, m0, psi0 = prior
    d = x.shape[1]
    counts = w @ resp
    evidence = 0.0
    for k in np.flatnonzero(counts > 0):
        mean = (w * resp[:, k]) @ x / counts[k]
        psi = psi0 + (w * resp[:, k] * (x - mean).T) @ (x - mean) + kappa0 * counts[k] / (kappa0 + counts[k]) * np.outer(mean - m0, mean - m0)
        nu = nu0 + counts[k]
        evidence += -counts[k] * d / 2 * np.log(np.pi) + multigammaln(nu / 2, d) - multigammaln(nu0 / 2, d)
        evidence += nu0 / 2 * np.linalg.slogdet(psi0)[1] - nu / 2 * np.linalg.slogdet(psi)[1] + d / 2 * np.log(kappa0 / (kappa0 + counts[k]))
    counts = np.sort(counts)[::-1]
    behind = counts.sum() - np.cumsum(counts)
    sticks = (betaln(1 + counts, alpha + behind.clip(0)) - betaln(1, alpha))[:-1].sum()
    return evidence + sticks - (w[:, None] * np.where(resp > 0, resp * np.log(np.where(resp > 0, resp, 1)), 0)).sum()


@pytest.mark.parametrize("vb", [False, True])
@pytest.mark.parametrize("alpha", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("d", [1, 2, 3, 8])
def test_rounds_agree_with_their_definitions(d, alpha, vb):
    rng = np.random.default_rng(d)
    x, w = rng.normal(size=(60, d)) * rng.choice([1, 4], 60)[:, None], rng.uniform(0, 3, 60)
    resp = rng.dirichlet(np.ones(4), 60)
    ours = DirichletProcessGaussianMixture(
        4, alpha, inference="vb" if vb else "map", merge=False, covariance_prior=0.7, covariance_floor=0.01, mean_precision=0.3, degrees_of_freedom=d + 1.5, tol=None, max_iter=7
    ).fit(x, sample_weight=w, resp=resp)
    prior = 0.3, d + 1.5, np.average(x, axis=0, weights=w), 0.71 * np.eye(d)
    for _ in range(7):
        factors, means, covariances, resp = m_step(x, w, resp, prior, alpha, 0.01, vb)
        logs = np.stack([f + multivariate_normal(m, c).logpdf(x) for f, m, c in zip(factors, means, covariances, strict=True)], 1)
        resp = np.exp(logs - np.logaddexp.reduce(logs, axis=1, keepdims=True))
    np.testing.assert_allclose(ours.means_, means, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.covariances_, covariances, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ours.predict_proba(x), resp, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.score_samples(x), np.logaddexp.reduce(logs, axis=1), rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.lower_bound_, score(x, w, resp, prior, alpha), rtol=1e-11)


BARS = {"flow": (5, 0.98), "blobs": (5, 0.99), "one": (1, 1.0), "small": (2, 0.90)}
"""Median number of components and least mean adjusted Rand index over ten seeds."""


@pytest.mark.parametrize("data", BARS)
def test_merging_finds_the_clusters_of_random_data(data):
    number, least = BARS[data]
    counts, weights, rands = zip(*(bench.scores(data, "MAP-EM, merging", seed) for seed in range(10)), strict=True)
    assert abs(np.median(counts) - number) <= 1
    assert np.mean(rands) >= least
    true = np.mean([np.bincount(bench.DATA[data](np.random.default_rng(seed))[1]).max() for seed in range(10)])
    total = np.mean([len(bench.DATA[data](np.random.default_rng(seed))[1]) for seed in range(10)])
    assert np.mean(weights) == pytest.approx(true / total, abs=0.05)


def test_without_merging_a_gaussian_stays_divided():
    counts, weights, _ = zip(*(bench.scores("one", "MAP-EM", seed) for seed in range(5)), strict=True)
    assert min(counts) >= 10 and np.median(weights) < 0.5


def test_adjusted_rand_index_is_scikit_learns():
    rng = np.random.default_rng(0)
    for k in (1, 2, 5):
        first, second = rng.integers(0, k, 50), rng.integers(0, 3, 50)
        assert bench.adjusted_rand(first, second) == pytest.approx(adjusted_rand_score(first, second), abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.integers(0, 3)), min_size=1, max_size=25).filter(lambda rows: any(row[2] for row in rows)),
    st.integers(1, 6),
    st.sampled_from(["map", "vb"]),
    st.booleans(),
)
def test_weights_are_repetitions(rows, components, inference, merge):
    x, w = np.array([row[:2] for row in rows]), np.array([row[2] for row in rows])
    mixture = DirichletProcessGaussianMixture(components, inference=inference, merge=merge, random_state=0, covariance_prior=1.0, tol=None, max_iter=4)
    weighted = clone(mixture).fit(x, sample_weight=w)
    repeated = clone(mixture).fit(np.repeat(x, w, axis=0))
    np.testing.assert_allclose(weighted.lower_bound_, repeated.lower_bound_, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(weighted.weights_, repeated.weights_, rtol=0, atol=1e-9)


def test_several_starts_keep_the_best():
    x, _ = bench.flow(np.random.default_rng(3))
    once, eight = (DirichletProcessGaussianMixture(merge=False, n_init=n, random_state=0).fit(x).lower_bound_ for n in (1, 8))
    assert eight > once


@pytest.mark.parametrize("threads", [1, 2])
def test_deterministic_and_pickled(threads):
    x, _ = bench.blobs(np.random.default_rng(0))
    x = np.concatenate([x, x + 0.1, x - 0.1, x + 0.2])
    usual = DirichletProcessGaussianMixture(random_state=5).fit(x)
    ours = DirichletProcessGaussianMixture(random_state=5, threads=threads).fit(x)
    again = pickle.loads(pickle.dumps(ours))
    for name in ("weights_", "means_", "covariances_", "counts_", "lower_bound_"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(usual, name))
        np.testing.assert_array_equal(getattr(again, name), getattr(usual, name))
    np.testing.assert_array_equal(again.predict(x), usual.fit_predict(x))


def test_attributes_fit_together():
    x, labels = bench.small(np.random.default_rng(0))
    mixture = DirichletProcessGaussianMixture(random_state=0).fit(x, sample_weight=np.full(40, 2.0))
    assert mixture.counts_.sum() == pytest.approx(80) and (np.diff(mixture.counts_) <= 0).all()
    assert mixture.weights_.sum() == pytest.approx(1) and mixture.n_active_ == (mixture.counts_ > 0.4).sum()
    assert mixture.weights_.shape == (12,) and mixture.means_.shape == (12, 2) and mixture.covariances_.shape == (12, 2, 2)
    density = sum(w * multivariate_normal(m, c).pdf(x) for w, m, c in zip(mixture.weights_, mixture.means_, mixture.covariances_, strict=True))
    np.testing.assert_allclose(mixture.score_samples(x), np.log(density), rtol=1e-10)
    assert mixture.score(x) == pytest.approx(np.log(density).mean())
    assert adjusted_rand_score(labels, mixture.predict(x)) > 0.9


@pytest.mark.parametrize(
    "x",
    [np.zeros((1, 3)), np.full((50, 2), 4.0), np.arange(40.0).reshape(-1, 2), np.c_[np.arange(9.0), np.zeros(9)], [[0.0], [1e6], [-1e6], [1.0]]],
    ids=["one point", "all equal", "a line", "a plane", "far outliers"],
)
@pytest.mark.parametrize("weight", [1e-8, 1.0, 1e8])
@pytest.mark.parametrize("inference", ["map", "vb"])
def test_degenerate_points_are_legal(x, weight, inference):
    mixture = DirichletProcessGaussianMixture(12, inference=inference, random_state=0).fit(x, sample_weight=np.full(len(x), weight))
    for name in ("weights_", "means_", "covariances_", "lower_bound_"):
        assert np.isfinite(getattr(mixture, name)).all(), name
    np.testing.assert_allclose(mixture.predict_proba(x).sum(1), 1)
    assert (np.linalg.eigvalsh(mixture.covariances_) > 0).all()


def test_points_of_weight_zero_are_ignored():
    x, _ = bench.small(np.random.default_rng(0))
    far = np.r_[x, [[1e4, -1e4]]]
    usual = DirichletProcessGaussianMixture(random_state=0).fit(x)
    ours = DirichletProcessGaussianMixture(random_state=0).fit(far, sample_weight=np.r_[np.ones(40), 0.0])
    np.testing.assert_allclose(ours.means_, usual.means_, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n_components", 0), ("n_components", 10**9), ("weight_concentration", 0.0), ("mean_precision", -1.0), ("degrees_of_freedom", 1.0),
        ("covariance_prior", [[1.0, 2.0], [2.0, 1.0]]), ("covariance_prior", np.eye(3)), ("covariance_floor", -1.0), ("inference", "magic"),
        ("max_iter", 0), ("tol", -1.0), ("n_init", -2), ("threads", 0), ("random_state", -1),
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        DirichletProcessGaussianMixture(**{name: value}).fit(np.arange(20.0).reshape(-1, 2))


@pytest.mark.parametrize(("name", "value"), [("threads", 1.5), ("inference", None), ("tol", "a"), ("n_components", 2.0), ("merge", 1), ("covariance_floor", None)])
def test_parameters_of_another_kind_are_named(name, value):
    with pytest.raises(TypeError, match=name):
        DirichletProcessGaussianMixture(**{name: value}).fit(np.arange(20.0).reshape(-1, 2))


@pytest.mark.parametrize(
    ("weights", "x"),
    [([1.0, -1.0], None), ([0.0, 0.0], None), ([np.nan, 1.0], None), ([1.0], None), (np.ones((2, 1)), None), (None, [[np.nan, 0.0], [0, 0]]), (None, np.zeros((0, 2)))],
)
def test_points_and_weights_that_cannot_be_used_are_named(weights, x):
    with pytest.raises(ValueError, match="X" if weights is None else "sample_weight"):
        DirichletProcessGaussianMixture(2).fit(np.eye(2) if x is None else x, sample_weight=weights)


@pytest.mark.parametrize("resp", [np.full((2, 3), 1 / 3), np.full((2, 2), 0.4), [[2.0, -1.0], [0.5, 0.5]], np.full(2, 0.5)])
def test_responsibilities_that_cannot_be_used_are_named(resp):
    with pytest.raises(ValueError, match="resp"):
        DirichletProcessGaussianMixture(2).fit(np.eye(2), resp=resp)


@pytest.mark.parametrize("inference", ["map", "vb"])
def test_scikit_learns_conventions(inference):
    mixture = DirichletProcessGaussianMixture(3, inference=inference, random_state=1)
    assert clone(mixture).get_params() == mixture.get_params()
    assert repr(DirichletProcessGaussianMixture(3, random_state=1)) == "DirichletProcessGaussianMixture(n_components=3, random_state=1)"
    check_estimator(mixture, on_skip=None)


def test_works_without_scikit_learn():
    program = """if True:
        import sys
        sys.modules["sklearn"] = None
        import jacoflow
        mixture = jacoflow.mixture.DirichletProcessGaussianMixture(3, random_state=1)
        assert mixture.set_params(tol=None).get_params()["tol"] is None
        assert mixture.fit_predict([[0.0], [0.1], [9.0]]).shape == (3,)
    """
    subprocess.run([sys.executable, "-c", program], check=True)
