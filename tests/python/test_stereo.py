"""Disparity of edge pixels: arguments, edge cases and the figures of its specification."""

import pickle
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from benchmarks.scenes import stereo as stereo_scenes
from benchmarks.scores import stereo as stereo_scores
from jacoflow import stereo
from jacoflow.track import StereoTracker

METHODS = ("classes", "sgm")
RANGE = (-20, 12)


@cache
def small():
    """Some steps of the small scene."""
    return stereo_scenes.small().sequence(range(5))[::2]


def disparity(left, right, **options):
    return stereo.edge_disparity(left, right, **{"disparity_range": RANGE, "row_range": (-2, 2), **options})


def same(a, b):
    assert_array_equal(a.disparity, b.disparity)
    for name in ("rows", "cols", "values", "score", "row_offset"):
        assert_array_equal(getattr(a, name), getattr(b, name))


ASKED = {
    ("small", "classes", 0.3): (0.969, 0.089, 0.025, 0.050),
    ("small", "classes", 0.6): (0.879, 0.069, 0.007, 0.019),
    ("small", "sgm", None): (0.951, 0.083, 0.003, 0.015),
    ("crossing", "classes", 0.3): (0.958, 0.150, 0.035, 0.055),
    ("crossing", "classes", 0.6): (0.861, 0.122, 0.011, 0.017),
    ("crossing", "sgm", None): (0.940, 0.097, 0.003, 0.014),
    ("curved", "classes", 0.3): (0.965, 0.225, 0.031, 0.034),
    ("curved", "classes", 0.6): (0.889, 0.206, 0.013, 0.012),
    ("curved", "sgm", None): (0.956, 0.098, 0.002, 0.012),
    ("cart", "classes", 0.3): (0.970, 0.099, 0.033, 0.049),
    ("cart", "classes", 0.6): (0.897, 0.075, 0.015, 0.024),
    ("cart", "sgm", None): (0.957, 0.087, 0.004, 0.018),
}
"""By scene, method and least support: density, mean error (px), outliers and false points in occlusions."""


@cache
def some_steps(name):
    """Some steps of a scene."""
    return small() if name == "small" else stereo_scenes.SCENES[name]().sequence((5, 15) if name == "crossing" else (3, 9))


@pytest.mark.parametrize(("scene", "method", "support"), ASKED)
def test_the_specifications_figures(scene, method, support):
    counts = []
    least, most = stereo_scenes.SCENES[scene]().disparity_range
    options = {} if support is None else {"min_support": support}
    for step in some_steps(scene):
        edges = np.zeros(step.left.shape, bool)
        edges[stereo.edge_pixels(step.left)] = True
        found = stereo.edge_disparity(step.left, step.right, disparity_range=(least, most), method=method, **options)
        counts.append(stereo_scores.count(found.disparity, edges, step.disparity, step.visible))
    reached = stereo_scores.figures(counts)
    density, mean, outliers, occluded = ASKED[scene, method, support]
    assert reached["density"] >= density - 0.02
    assert reached["outliers"] <= 1.3 * outliers
    assert reached["MAE"] <= 1.3 * mean
    assert reached["occluded"] <= 1.3 * occluded


@pytest.mark.parametrize("method", METHODS)
def test_lists_and_image_say_the_same(method):
    step = small()[0]
    found = disparity(step.left, step.right, method=method)
    assert found.disparity.shape == step.left.shape and found.disparity.dtype == np.float32
    rows, cols = np.nonzero(np.isfinite(found.disparity))
    assert_array_equal(rows, found.rows)
    assert_array_equal(cols, found.cols)
    assert_array_equal(found.disparity[rows, cols], found.values)
    assert len(found.score) == len(rows) > 5000 and found.score.min() > 0 and found.score.max() <= 1
    least, greatest = found.values.min(), found.values.max()
    # Lucas-Kanade may leave the range by a pixel, and the fit by half of one.
    assert least >= RANGE[0] - 1.5 and greatest <= RANGE[1] + 1.5
    if method == "classes":
        assert_array_equal(found.values, np.rint(found.values))
    edge_rows, edge_cols = stereo.edge_pixels(step.left)
    edges = set(zip(edge_rows.tolist(), edge_cols.tolist(), strict=True))
    assert edges.issuperset(zip(rows.tolist(), cols.tolist(), strict=True))


@pytest.mark.parametrize("method", METHODS)
def test_the_number_of_threads_changes_nothing(method):
    step = small()[1]
    one = disparity(step.left, step.right, method=method, threads=1)
    for threads in (2, 3):
        same(one, disparity(step.left, step.right, method=method, threads=threads))


@pytest.mark.parametrize("method", METHODS)
def test_every_sample_type_means_the_same(method):
    step = small()[0]
    plain = disparity(step.left, step.right, method=method)
    for convert in (
        lambda view: view.astype(np.uint16) * 257,
        lambda view: view.astype(np.float32),
        lambda view: view.astype(np.float64),
        lambda view: np.repeat(view[..., None], 3, axis=2),
        lambda view: np.asfortranarray(view),
        lambda view: np.repeat(view, 2, axis=1)[:, ::2],
    ):
        left, right = convert(step.left), convert(step.right)
        kept = left.copy()
        left.flags.writeable = right.flags.writeable = False
        got = disparity(left, right, method=method)
        assert_array_equal(left, kept)
        both = np.isfinite(plain.disparity) & np.isfinite(got.disparity)
        assert both.sum() >= 0.999 * len(plain.rows) and len(got.rows) <= 1.001 * len(plain.rows)
        assert np.mean(np.abs(got.disparity - plain.disparity)[both] < 1e-3) > 0.999


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("swapped", [False, True])
def test_bytes_beside_shares_of_white_are_matched(method, swapped):
    step = small()[0]
    plain = disparity(step.left, step.right, method=method)
    views = (step.left / 255, step.right) if swapped else (step.left, (step.right / 255).astype(np.float32))
    got = disparity(*views, method=method)
    both = np.isfinite(plain.disparity) & np.isfinite(got.disparity)
    assert both.sum() >= 0.99 * len(plain.rows)
    assert np.mean(np.abs(got.disparity - plain.disparity)[both] < 1e-2) > 0.99


@pytest.mark.parametrize("method", METHODS)
def test_bad_samples_damage_their_neighbourhood_and_no_more(method):
    step = small()[0]
    whole = disparity(step.left, step.right, method=method, row_offset=1.0)
    left = step.left.astype(np.float32)
    left[100:103, 150] = np.nan
    left[60, 200] = np.inf
    got = disparity(left, step.right, method=method, row_offset=1.0)
    for y, x in ((100, 150), (102, 150), (60, 200)):
        assert np.isnan(got.disparity[y - 8 : y + 9, x - 8 : x + 9]).all()
    assert np.isfinite(got.values).all() and np.isfinite(got.score).all()
    near = np.zeros(left.shape, bool)
    for y, x in ((101, 150), (60, 200)):
        near[max(y - 45, 0) : y + 46, max(x - 45, 0) : x + 46] = True
    far = ~near
    assert np.mean((got.disparity == whole.disparity)[far] | np.isnan(got.disparity + whole.disparity)[far]) > 0.999
    everywhere = np.full_like(left, np.nan)
    assert len(disparity(everywhere, step.right, method=method).rows) == 0
    assert len(disparity(step.left, everywhere, method=method).rows) == 0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("size", [(17, 17), (17, 400), (400, 17), (64, 48)])
def test_uniform_views_are_empty_and_small_ones_work(method, size):
    grey = np.full(size, 90, np.uint8)
    found = disparity(grey, grey, method=method)
    assert found.disparity.shape == size and np.isnan(found.disparity).all()
    assert len(found.rows) == len(found.cols) == len(found.values) == len(found.score) == 0
    assert found.row_offset == 0.0
    assert stereo.estimate_row_offset(grey, grey) == 0.0
    cells = np.random.default_rng(1).integers(0, 255, size, dtype=np.uint8)
    assert np.isfinite(disparity(cells, cells, method=method).values).all()


@pytest.mark.parametrize(
    ("left", "right"),
    [((40, 50), (40, 51)), ((16, 50), (16, 50)), ((50, 16), (50, 16)), ((0, 0), (0, 0))],
)
def test_views_that_do_not_fit_are_reported_with_both_shapes(left, right):
    with pytest.raises(ValueError, match="right: ") as refused:
        stereo.edge_disparity(np.zeros(left, np.uint8), np.zeros(right, np.uint8))
    assert str(left) in str(refused.value) and str(right) in str(refused.value)
    with pytest.raises(ValueError, match="right: "):
        stereo.estimate_row_offset(np.zeros(left, np.uint8), np.zeros(right, np.uint8))


def test_arrays_that_are_no_views_are_refused():
    good = np.zeros((40, 40), np.uint8)
    for bad in (np.zeros(40, np.uint8), np.zeros((2, 40, 40, 3), np.uint8), np.zeros((40, 40, 2), np.uint8)):
        for name, views in (("left", (bad, good)), ("right", (good, bad))):
            for asked in (stereo.edge_disparity, stereo.estimate_row_offset, StereoTracker().update):
                with pytest.raises(ValueError, match=f"^{name}: ") as refused:
                    asked(*views)
                assert all(str(view.shape) in str(refused.value) for view in views)
    for bad in (np.zeros((40, 40), np.longdouble), np.zeros((40, 40), complex)):
        with pytest.raises(TypeError, match="left: "):
            stereo.edge_disparity(bad, good)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("disparity_range", (3, 2)),
        ("disparity_range", (-4000, 4000)),
        ("row_range", (1, 0)),
        ("row_offset", float("nan")),
        ("method", "magic"),
        ("prior", np.zeros((3, 3), np.float32)),
        ("blur_sigma", 0.0),
        ("threshold", -1.0),
        ("classes", 1),
        ("window", 16),
        ("window", 33),
        ("min_support", 1.5),
        ("threads", 0),
        ("threads", -1),
        ("disparity_range", (1, 2, 3)),
        ("disparity_range", (0, 2**40)),
        ("row_range", (-(2**70), 0)),
        ("prior_radius", 2**32),
        ("classes", 2**70),
        ("method", None),
    ],
)
def test_bad_options_are_named(name, value):
    view = np.zeros((40, 40), np.uint8)
    with pytest.raises(ValueError, match=f"^{name}: expected .*, got"):
        stereo.edge_disparity(view, view, **{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [("disparity_range", (0.5, 3)), ("disparity_range", None), ("row_range", "ab"), ("blur_sigma", "wide"), ("row_offset", "high"), ("window", None), ("classes", 1.5), ("threads", 1.5), ("subpixel", "yes"), ("left_right_check", None)],
)  # fmt: skip
def test_options_of_another_kind_are_named(name, value):
    view = np.zeros((40, 40), np.uint8)
    with pytest.raises(TypeError, match=f"^{name}: expected .*, got"):
        stereo.edge_disparity(view, view, **{name: value})


@pytest.mark.parametrize(("name", "value", "kind"), [("blur_sigma", "wide", TypeError), ("threads", -1, ValueError), ("threads", 1.5, TypeError), ("threshold", 0, ValueError)])
def test_bad_options_of_edges_are_named(name, value, kind):
    with pytest.raises(kind, match=f"^{name}: expected .*, got"):
        stereo.edge_pixels(np.zeros((40, 40), np.uint8), **{name: value})


def test_ranges_are_any_two_integers():
    view = np.zeros((40, 40), np.uint8)
    for span in ([-8, 8], np.array([-8, 8]), (np.int64(-8), 8)):
        assert stereo.edge_disparity(view, view, disparity_range=span, row_range=[-1, 1]).values.shape == (0,)


def test_the_row_offset_is_found_to_a_twentieth_of_a_row():
    from scipy.ndimage import shift

    for step in small():
        assert stereo.estimate_row_offset(step.left, step.right, disparity_range=RANGE) == pytest.approx(1.0, abs=0.05)
    step = small()[0]
    moved = np.rint(np.clip(shift(step.right.astype(float), (0.4, 0), order=3, mode="nearest"), 0, 255)).astype(np.uint8)
    assert stereo.estimate_row_offset(step.left, moved, disparity_range=RANGE) == pytest.approx(1.4, abs=0.05)
    found = disparity(step.left, step.right, method="classes")
    assert found.row_offset == 1.0
    told = disparity(step.left, step.right, method="sgm", row_offset=1.0)
    assert told.row_offset == 1.0


def test_fractions_of_a_pixel_are_measured():
    """Both views out of one fine texture, a fraction of a pixel apart, with another gain and bias."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(4)
    fine = gaussian_filter(rng.uniform(0, 255, (14, 30)).repeat(80, 0).repeat(80, 1), 8.0)
    for tenths in (0, 3, 5, 8):
        left, right = fine[::10, 40:2040:10], 0.9 * fine[::10, 20 + tenths : 2020 + tenths : 10] + 12
        found = stereo.edge_disparity(left, right, disparity_range=(-8, 8), row_offset=0.0)
        truth = -2.0 + tenths / 10
        coarse = stereo.edge_disparity(left, right, disparity_range=(-8, 8), row_offset=0.0, subpixel=False)
        assert len(found.values) > 500
        assert abs(np.median(found.values) - truth) < 0.03
        assert np.median(np.abs(found.values - truth)) <= np.median(np.abs(coarse.values - truth)) + 0.01


@pytest.mark.parametrize("left_right_check", [True, False])
def test_whole_disparities_are_whole(left_right_check):
    step = small()[0]
    found = disparity(step.left, step.right, row_offset=1.0, subpixel=False, left_right_check=left_right_check)
    assert len(found.values) > 4000 and (found.values % 1 == 0).all()
    fitted = disparity(step.left, step.right, row_offset=1.0, left_right_check=left_right_check)
    assert (fitted.values % 1 != 0).mean() > 0.9


@pytest.mark.parametrize("method", METHODS)
def test_a_prior_narrows_the_search(method):
    step = small()[0]
    right_one = disparity(step.left, step.right, method=method, row_offset=1.0, prior=step.disparity)
    assert np.abs(right_one.values - step.disparity[right_one.rows, right_one.cols]).max() <= 3.0 + 1.5
    free = disparity(step.left, step.right, method=method, row_offset=1.0)
    nothing = disparity(step.left, step.right, method=method, row_offset=1.0, prior=np.full(step.left.shape, np.nan, np.float32))
    same(free, nothing)
    wrong = disparity(step.left, step.right, method=method, row_offset=1.0, prior=np.full(step.left.shape, 10.0, np.float32))
    assert len(wrong.rows) < 0.5 * len(free.rows)
    outside = disparity(step.left, step.right, method=method, row_offset=1.0, prior=np.full(step.left.shape, 99.0, np.float32))
    assert len(outside.rows) == 0


def test_matching_from_the_right_drops_what_is_hidden():
    step = small()[0]
    hidden = {}
    for left_right_check in (True, False):
        found = disparity(step.left, step.right, row_offset=1.0, left_right_check=left_right_check)
        hidden[left_right_check] = int((~step.visible[found.rows, found.cols]).sum())
    assert 0 < 2 * hidden[True] < hidden[False]


def test_one_hot_pixel_does_not_decide_what_white_is():
    step = small()[0]
    clean = stereo.edge_disparity(step.left / 255, step.right / 255, disparity_range=RANGE, row_offset=1.0)
    hot = step.left / 255
    hot[100, 100] = 2.0
    found = stereo.edge_disparity(hot, step.right / 255, disparity_range=RANGE, row_offset=1.0)
    assert len(found.values) > 0.99 * len(clean.values) > 4000


@pytest.mark.parametrize(("side", "hot"), [(9, 1.6), (9, 40.0), (24, 1.6)])
def test_a_hot_patch_does_not_decide_what_white_is(side, hot):
    step = small()[0]
    left, right = step.left / 255, step.right / 255
    clean = disparity(left, right, row_offset=1.0)
    left[100 : 100 + side, 100 : 100 + side] = hot
    found = disparity(left, right, row_offset=1.0)
    assert len(found.values) > 0.95 * len(clean.values) > 4000


@pytest.mark.parametrize("method", METHODS)
def test_rows_beyond_those_that_are_searched_are_warned_of(method):
    step = small()[0]
    lower = np.roll(step.right, 5, axis=0)
    with pytest.warns(UserWarning, match="row_range: .* -4 to 4"):
        found = disparity(step.left, lower, row_range=(-4, 4), method=method)
    wrong = np.abs(found.values - step.disparity[found.rows, found.cols]) > 1
    assert wrong.mean() > 0.25
    with pytest.warns(UserWarning, match="row_range: "):
        stereo.estimate_row_offset(step.left, lower, disparity_range=RANGE)
    for options in ({"row_range": (-8, 8)}, {"row_offset": 6.0}):
        assert disparity(step.left, lower, method=method, **options).row_offset == pytest.approx(6.0, abs=0.05)


def test_results_pickle():
    step = small()[0]
    found = disparity(step.left, step.right, row_offset=1.0)
    same(found, pickle.loads(pickle.dumps(found)))


@pytest.mark.parametrize("gain", [0.9, 0.6, 0.4, 1.6])
def test_another_gain_of_the_right_camera_costs_a_tenth_of_a_pixel_at_most(gain):
    """A bias drops out of everything; of a gain some hundredths are left, which move the steps along x by
    less than a twentieth of a px."""
    step = small()[0]
    found = disparity(step.left, step.right)
    again = disparity(step.left.astype(float), gain * step.right.astype(float) + 10)
    both = np.isfinite(found.disparity) & np.isfinite(again.disparity)
    assert both.sum() > 0.95 * len(found.rows)
    assert np.median(np.abs(found.disparity - again.disparity)[both]) < 0.1
    assert again.row_offset == pytest.approx(found.row_offset, abs=0.02)
