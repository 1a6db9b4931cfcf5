"""Properties that hold for any picture: gain, symmetry, shapes."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import jacoflow
from jacoflow import scenes

seeds = st.integers(0, 2**32 - 1)
motions = st.tuples(*[st.floats(-0.4, 0.4)] * 2, *[st.floats(-0.02, 0.02)] * 4)
METHODS = st.sampled_from(["windowed", "coarse_to_fine", "lucas_kanade", "horn_schunck"])


def pictures(seed, motion=(0.3, -0.2, 0.01, 0.02, -0.02, 0.01)):
    names = ("u", "v", "u_x", "v_x", "u_y", "v_y")
    return scenes.Scene("affine", width=40, height=36, random_state=seed, **dict(zip(names, motion, strict=True))).frames(3)


@settings(max_examples=15, deadline=None)
@given(seeds, METHODS, st.floats(1e-3, 1e3))
def test_intensity_gain_never_changes_the_flow(seed, method, gain):
    frames = pictures(seed)
    one = jacoflow.flow(*frames, method=method)
    other = jacoflow.flow(*frames * gain, method=method)
    assert_allclose(other.flow, one.flow, rtol=1e-5, atol=1e-7)


@settings(max_examples=15, deadline=None)
@given(seeds, st.floats(0.1, 10.0), st.sampled_from([1e-100, 1e-3, 1e3, 1e100]))
def test_smoothness_is_relative_to_the_gradient(seed, smoothness, gain):
    frames = pictures(seed)
    one, other = (
        jacoflow.flow(*frames * factor, method=jacoflow.HornSchunck(smoothness=smoothness)) for factor in (1.0, gain)
    )
    assert (other.status == one.status).all() and one.status[18, 20] == jacoflow.Status.OK
    assert_allclose(other.flow, one.flow, rtol=1e-4, atol=1e-5)


@settings(max_examples=15, deadline=None)
@given(seeds, st.integers(-3, 3))
def test_powers_of_two_change_no_bit_of_the_instantaneous_flow(seed, power):
    frames = pictures(seed)
    one = jacoflow.flow(*frames, method="instantaneous")
    other = jacoflow.flow(*frames * 2.0**power, method="instantaneous")
    assert_allclose(other.flow, one.flow, rtol=1e-12)


def symmetry_tolerance(method):
    """Iterations go row by row; sites are every second pixel from the upper left corner, and the coupling of
    neighbours is stopped before it has converged.

    The last of an even number of columns has no site of its own: there the field is extrapolated, at the
    other rim it is not.
    """
    if method == "coarse_to_fine":
        return {"rtol": 0.0, "atol": 0.05}
    return {"rtol": 1e-4, "atol": 1e-5} if method == "horn_schunck" else {"rtol": 1e-6, "atol": 1e-9}


def compared(method):
    """The part of the frame that symmetries are looked at in: windows at the rim and in the corners of so
    small a frame are mostly extrapolation."""
    return np.s_[4:-4, 4:-4] if method == "coarse_to_fine" else np.s_[:, :]


@settings(max_examples=15, deadline=None)
@given(seeds, METHODS, motions)
def test_transposing_the_picture_swaps_the_axes(seed, method, motion):
    frames = pictures(seed, motion)
    one = jacoflow.flow(*frames, method=method)
    other = jacoflow.flow(*[frame.T for frame in frames], method=method)
    tolerance = symmetry_tolerance(method)
    part = compared(method)
    assert_allclose(other.u.T[part], one.v[part], **tolerance)
    assert_allclose(other.v.T[part], one.u[part], **tolerance)
    if method == "windowed":
        assert_allclose(other.v_y.T, one.u_x, **tolerance)
        assert_allclose(other.u_y.T, one.v_x, **tolerance)


@settings(max_examples=15, deadline=None)
@given(seeds, METHODS, motions)
def test_mirroring_the_picture_mirrors_the_flow(seed, method, motion):
    frames = pictures(seed, motion)
    one = jacoflow.flow(*frames, method=method)
    other = jacoflow.flow(*[frame[:, ::-1] for frame in frames], method=method)
    tolerance = symmetry_tolerance(method)
    part = compared(method)
    assert_allclose(other.u[:, ::-1][part], -one.u[part], **tolerance)
    assert_allclose(other.v[:, ::-1][part], one.v[part], **tolerance)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(3, 24),
    st.integers(5, 24),
    st.integers(3, 6),
    st.sampled_from(["uint8", "uint16", "float32", "float64"]),
    st.sampled_from(["windowed", "coarse_to_fine", "instantaneous", "lucas_kanade", "horn_schunck"]),
    seeds,
)
def test_any_size_and_any_noise_give_arrays_of_the_right_shape(height, width, count, dtype, method, seed):
    frames = (np.random.default_rng(seed).random((count, height, width)) * 255).astype(dtype)
    field = jacoflow.estimate(frames, method=method, ends="drop")
    shape = (count - 2, height, width)
    assert field.shape == shape and field.flow.shape == (*shape, 2) and field.jacobian.shape == (*shape, 2, 2)
    assert field.speed.shape == field.status.shape == shape
    assert (field.covariance is None) == (method == "horn_schunck")
    assert field.covariance is None or field.covariance.shape == (*shape, 6, 6)
    is_empty = ~field.valid & (field.status != jacoflow.Status.INCONSISTENT)
    assert np.isfinite(field.flow[field.valid]).all() and np.isnan(field.flow[is_empty]).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(3, 16), st.integers(3, 16), st.sampled_from(["augmented", "non_augmented", "fast", "extended"]), seeds)
@example(8, 3, "augmented", 0)
def test_the_filter_survives_any_noise(height, width, form, seed):
    frames = (np.random.default_rng(seed).random((4, height, width)) * 255).astype(np.uint8)
    flow_filter = jacoflow.FlowFilter(profile=jacoflow.FilterProfile(form=form))
    for frame in frames:
        field = flow_filter.push(frame)
    assert field.shape == (height, width)
    assert np.isfinite(field.flow[field.valid]).all()
