"""What the comparisons measure with: masks, errors and the noise bound (no rival is needed here)."""


import importlib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks import compare, readme, report
from benchmarks import settings as contestants
from benchmarks.ablation import __main__ as ablation
from benchmarks.scores import flow as scoring
from benchmarks.scores import noise_bound
from benchmarks.tables import controlled
from jacoflow import Windowed, scenes


def test_the_jacobian_counts_away_from_edges_and_unknown_truth():
    truth = np.zeros((60, 70, 2))
    truth[30, 20] = np.nan
    truth[:, 50:, 0] = 5.0
    where = scoring.usable(truth)
    assert not where[:12].any() and not where[:, :12].any() and not where[-12:].any() and not where[:, -12:].any()
    # The differences of the four neighbours are unknown too, hence 4 px around a cross.
    assert not where[26:35, 15:26].any() and not where[25:36, 16:25].any()
    assert where[25, 15] and where[24, 20] and where[30, 14] and where[36, 20]
    assert not where[12:48, 49:51].any() and where[14, 48] and where[14, 51]


def test_errors_count_what_is_known():
    truth = np.zeros((30, 40, 2))
    truth[0, 0] = np.nan
    flow = np.broadcast_to([3.0, 4.0], truth.shape).copy()
    flow[:15] = np.nan
    error, share = scoring.end_point_error(flow, truth)
    assert error == pytest.approx(5.0) and share == pytest.approx(600 / 1199)
    assert scoring.jacobian_error(np.full((30, 40, 2, 2), 0.1), np.zeros((30, 40, 2, 2)), scoring.inside((30, 40), 5)) == pytest.approx(0.1)
    mask = np.zeros((9, 9), bool)
    mask[4, 0] = True
    assert_array_equal(np.argwhere(scoring.widened(mask, 1)), [[3, 0], [3, 1], [4, 0], [4, 1], [5, 0], [5, 1]])


def test_the_noise_bound_is_the_spread_of_least_squares():
    """The window's equations written out and solved for many draws of the noise."""
    rng = np.random.default_rng(3)
    gradient = rng.normal(size=(41, 41, 2)) * 8
    window, noise, middle = 2.5, 2.0, 20
    offsets = np.arange(-10, 11)
    dx, dy = np.meshgrid(offsets, offsets)
    weights = np.exp(-0.5 * (dx**2 + dy**2) / window**2).ravel()
    g_x, g_y = np.moveaxis(gradient[middle - 10 : middle + 11, middle - 10 : middle + 11].reshape(-1, 2), -1, 0)
    rows = np.stack([g_x, g_y, g_x * dx.ravel(), g_y * dx.ravel(), g_x * dy.ravel(), g_y * dy.ravel()], axis=-1)
    draws = rng.normal(size=(441, 20000)) * np.sqrt(2 * (noise**2 + 1 / 12))
    solved = np.linalg.solve(rows.T @ (weights[:, None] * rows), rows.T @ (weights[:, None] * draws))
    bound = noise_bound.covariance(gradient, window, noise)[middle, middle]
    assert_allclose(np.diagonal(bound), solved.var(axis=1), rtol=0.06)
    triple = noise_bound.covariance(gradient, window, noise, frames=3)[middle, middle]
    assert_allclose(triple, bound / 4)
    where = np.zeros((41, 41), bool)
    where[middle, middle] = True
    assert noise_bound.jacobian_bound(gradient, window, noise, where) == pytest.approx(np.sqrt(np.diagonal(bound)[2:].mean()))


def test_windows_of_fourth_order_are_as_noisy_as_narrower_plain_ones():
    """White noise through both, on the sites of a grid."""
    from scipy.ndimage import gaussian_filter

    white, sigma = np.random.default_rng(1).standard_normal((600, 600)), 6.0
    fourth = sum(term * gaussian_filter(white, np.sqrt(n) * sigma, mode="wrap") for n, term in enumerate(noise_bound.TERMS, 1))
    flow, slope = (gaussian_filter(white, sigma * noise_bound.plain_window(slopes), mode="wrap") for slopes in (False, True))
    assert flow.std() == pytest.approx(fourth.std(), rel=0.05)
    assert np.gradient(slope, axis=0).std() == pytest.approx(np.gradient(fourth, axis=0).std(), rel=0.05)


def test_the_bound_of_varying_windows_is_that_of_each():
    rng = np.random.default_rng(2)
    gradient = rng.normal(size=(50, 50, 2)) * 6
    where = np.zeros((50, 50), bool)
    where[25, 20:30] = True
    windows = np.broadcast_to(np.linspace(2.0, 6.0, 50), (50, 50))
    each = [noise_bound.jacobian_bound(gradient, float(windows[25, x]), 1.0, np.arange(2500).reshape(50, 50) == 25 * 50 + x) for x in range(20, 30)]
    assert noise_bound.jacobian_bound(gradient, windows, 1.0, where) == pytest.approx(np.sqrt(np.mean(np.square(each))), rel=0.02)


def test_controlled_scenes_have_the_speed_asked_for_and_exact_truth():
    case = controlled.Case(64.0, 3.0, 0.0, seed=2)
    assert np.linalg.norm(case.scene().truth(0.0).flow, axis=-1).max() == pytest.approx(3.0)

    def knows(frames):
        return answer

    pairs = ((2, False, 0.0, 0.0, (0, 1)), (2, False, 0.5, 0.5, (-0.5, 0.5)))
    triples = ((3, False, 0.0, 0.0, (-1, 1)), (3, True, 0.0, 0.0, (0, 1)))
    for frames, forward, moment, t, between in (*pairs, *triples):
        # A truth takes more than a second: the contestant's own, if it is of the right time, is remembered.
        answer = controlled.truth(case.wavelength, case.speed, case.seed, t, between)
        contestant = controlled.Contestant("exact", knows, frames=frames, moment=moment, forward=forward)
        assert contestant.errors(case) == (0.0, 1.0, 0.0)
    halfway = case.scene().truth(0.5, between=(-0.5, 0.5))
    assert_array_equal(halfway.flow, controlled.truth(case.wavelength, case.speed, case.seed, 0.5, (-0.5, 0.5))[0])
    assert len(controlled.cases()) == 16


def test_the_gradient_of_a_controlled_scene_is_its_textures():
    case = controlled.Case(256.0, 1.0, 0.0)
    exact = controlled.gradient(case.wavelength, case.speed, case.seed, 0.0)
    along_y, along_x = np.gradient(case.scene().frame(0.0))
    inner = scoring.inside(along_x.shape, 2)
    # Central differences over 2 px fall short of the slope of a texture smoothed by 2 px by about a tenth.
    for axis, difference in ((0, along_x), (1, along_y)):
        fit = (exact[..., axis] * difference)[inner].sum() / (exact[..., axis] ** 2)[inner].sum()
        assert 0.8 < fit < 1.0


def test_settings_are_called_with_their_options():
    setting = contestants.Setting("windowed", {"method": Windowed(window_sigma=3.0)}, frames=2, window=3.0)
    frames = list(scenes.Scene("affine", width=48, height=40).frames(2))
    flow, jacobian = setting.estimate(frames)
    assert flow.shape == (40, 48, 2) and jacobian.shape == (40, 48, 2, 2)
    contestant = controlled.Contestant.of(setting)
    assert (contestant.times(), contestant.moment, contestant.windows(frames)) == ((0.0, 1.0), 0.5, 3.0)


def test_a_kept_table_takes_new_sections_and_keeps_the_others(tmp_path):
    one, other = {"processor": "A", "numpy": "2"}, {"processor": "B", "numpy": "2"}
    assert report.newest(tmp_path) is None
    report.Record("2020-01-01", one, {"flow": [{"ms": 1.0}], "tracks": [{"ms": 2.0}], "motion": [{"ms": 3.0}]}).write(tmp_path)
    before = report.newest(tmp_path)
    assert before is not None
    updated = before.updated(report.Record("2020-01-02", other, {"tracks": [{"ms": 4.0}], "bars": [{"ms": 5.0}]}))
    updated.write(tmp_path)
    kept = report.newest(tmp_path)
    assert kept == updated and kept.date == "2020-01-02" and kept.machine == one
    assert list(kept.sections) == ["flow", "tracks", "bars", "motion"]
    assert kept.sections["flow"] == [{"ms": 1.0}] and kept.sections["tracks"] == [{"ms": 4.0}]
    assert kept.elsewhere == {"tracks": other, "bars": other}
    assert kept.markdown().count("Measured on another machine: processor B.") == 2
    again = kept.updated(report.Record("2020-01-03", one, {"bars": [{"ms": 6.0}]}))
    assert again.elsewhere == {"tracks": other}
    assert not list(tmp_path.glob(".*"))


def test_every_table_has_a_title_of_its_own_and_readme_needs_no_other():
    modules = [name for names in compare.SECTIONS.values() for name in names]
    tables = [importlib.import_module(f"benchmarks.tables.{name}").TABLES for name in modules]
    titles = [table.title for each in tables for table in each.values()]
    assert len(set(titles)) == len(titles)
    assert {title for _, needed in readme.TABLES.values() for title in needed} <= set(titles)


def test_the_comparison_has_every_table():
    modules = {path.stem for path in (Path(compare.__file__).parent / "tables").glob("*.py")} - {"__init__"}
    assert modules == {name for names in compare.SECTIONS.values() for name in names}


def test_a_mean_has_the_standard_error_of_its_finite_values():
    mean, error = report.mean_and_error([1.0, 3.0, float("nan"), 5.0])
    assert mean == pytest.approx(3.0) and error == pytest.approx(2.0 / np.sqrt(3))
    assert np.isnan(report.mean_and_error([])[0]) and np.isnan(report.mean_and_error([1.0])[1])


def test_a_heuristic_pays_if_a_row_is_worse_without_it_by_more_than_two_standard_errors():
    base = {"error": [1.0, 2.0, 3.0], "found": [0.9, 0.8, 0.7], "ms": [5.0, 6.0, 7.0]}

    def judged(**changed):
        return ablation.verdict(ablation.comparison(base, {**base, **changed}, ("found",)))

    assert judged() == "no effect, results are the same"
    assert judged(error=[1.5, 2.6, 3.4]) == "pays: error"
    assert judged(error=[1.5, 1.6, 3.1]) == "no effect"
    # A time says nothing of a rule, however clear.
    assert judged(ms=[15.0, 16.0, 17.0]) == "no effect, results are the same"
    assert judged(error=[0.5, 1.4, 2.6]) == "harms: error"
    # Fewer targets found are worse, even beside a smaller error.
    assert judged(found=[0.7, 0.61, 0.5], error=[0.5, 1.4, 2.6]) == "pays: found"
    assert ablation.is_chosen("edges.contrast", ["edges"]) and not ablation.is_chosen("edges.contrast", ["stereo"])
