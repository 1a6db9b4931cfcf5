"""`FlowFilter.smooth`: each field from the frames before and after it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import jacoflow
from jacoflow import FilterProfile, FlowFilter
from jacoflow.status import Status

SIZE, COUNT = (28, 36), 60
PROFILE = FilterProfile(name="measured", form="fast", Q=[1e-4, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6, 1e-6])


def picture(dx, dy):
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(float)
    x, y = x - dx, y - dy
    return 128 + 40 * np.sin(0.35 * x + 0.1 * y) + 35 * np.cos(0.3 * y - 0.12 * x)


def swinging():
    """Frames of a texture that swings along x, and its velocity."""
    t = np.arange(COUNT)
    place = 4.0 * np.sin(0.12 * t)
    rng = np.random.default_rng(4)
    frames = [np.clip(np.rint(picture(dx, 0.0) + rng.normal(0, 1, SIZE)), 0, 255).astype(np.uint8) for dx in place]
    return np.array(frames), 4.0 * 0.12 * np.cos(0.12 * t)


@pytest.fixture(scope="module")
def runs():
    frames, velocity = swinging()
    filter_ = FlowFilter(profile=PROFILE, precision="float64")
    smoothed = filter_.smooth(frames)
    assert filter_.frames_pushed == 0
    return frames, velocity, [filter_.push(frame) for frame in frames], smoothed


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def test_a_smoother_does_not_lag(runs):
    _, velocity, filtered, smoothed = runs
    assert smoothed.shape == (COUNT, *SIZE) and [field.frame_index for field in smoothed] == list(range(COUNT))
    inner = slice(5, COUNT - 5)
    of_filter = rms([field.u - u for field, u in zip(filtered[inner], velocity[inner], strict=True)])
    of_smoother = rms(smoothed.u[inner] - velocity[inner, None, None])
    assert of_smoother < 0.6 * of_filter, (of_smoother, of_filter)


def test_its_deviation_is_at_most_that_of_the_filter_and_holds(runs):
    _, velocity, filtered, smoothed = runs
    for name in ("u", "v", "u_x", "v_y"):
        ratio = smoothed.std(name)[:-1] / np.array([field.std(name) for field in filtered[:-1]])
        assert np.nanmax(ratio) <= 1 + 1e-9
    z = ((smoothed.u - velocity[:, None, None]) / smoothed.std("u"))[5:-5, 6:-6, 6:-6]
    assert np.mean(np.abs(z) < 1.96) > 0.9


def test_the_last_frame_is_that_of_the_filter_within_what_one_frame_says(runs):
    *_, filtered, smoothed = runs
    assert_allclose(smoothed.u[-1], filtered[-1].u, atol=0.05)
    assert_array_equal(smoothed.status[0] == Status.BORDER, filtered[0].status == Status.BORDER)


def test_reversed_frames_have_the_negative_flow(runs):
    frames, *_, smoothed = runs
    back = FlowFilter(profile=PROFILE, precision="float64").smooth(frames[::-1])
    assert_allclose(back.u[5:-5], -smoothed.u[::-1][5:-5], atol=0.02)


@pytest.mark.parametrize("kind", ["nan", "masked"])
def test_a_missing_frame_has_the_motion_around_it(runs, kind):
    frames, velocity, *_ = runs
    if kind == "nan":
        given = [frame.astype(np.float32) for frame in frames]
        given[30] = np.full(SIZE, np.nan, np.float32)
    else:
        given = [np.ma.masked_array(frame, np.full(SIZE, t == 30)) for t, frame in enumerate(frames)]
    field = FlowFilter(profile=PROFILE).smooth(given)[30]
    inner = (slice(6, -6), slice(6, -6))
    assert (field.status[inner] == Status.PREDICTED).all()
    assert abs(np.median(field.u[inner]) - velocity[30]) < 2 * np.median(field.std("u")[inner]) < 0.2


def test_units_and_missing_covariances_pass_through(runs):
    frames, *_, smoothed = runs
    field = FlowFilter(profile=PROFILE, precision="float64", fps=50.0, pixel_pitch=(0.5, 0.25), length_unit="mm", covariance=False).smooth(frames)
    assert field.covariance is None and field.unit("u") == "mm/s"
    assert_allclose(field.u, smoothed.u * 25.0)
    assert_allclose(field.jacobian[..., 0, 1], smoothed.jacobian[..., 0, 1] * 100.0)


def test_any_number_of_threads_gives_the_same(runs):
    frames = runs[0][:12]
    one, two = (FlowFilter(profile=PROFILE, threads=threads).smooth(frames) for threads in (1, 2))
    for name in ("flow", "jacobian", "covariance", "status"):
        assert_array_equal(getattr(one, name), getattr(two, name))


@pytest.mark.parametrize(
    ("frames", "error", "words"),
    [
        ([], ValueError, "frames: expected at least 1 frame"),
        ([np.zeros(SIZE), np.zeros((9, 9))], ValueError, "frames: expected 36 x 28 pixels, as before, got 9 x 9"),
        ([np.zeros(SIZE, np.uint8), np.zeros(SIZE)], TypeError, "frames: expected uint8 like the first frame, got float64"),
    ],
)
def test_what_cannot_be_smoothed_is_named(frames, error, words):
    with pytest.raises(error, match=words):
        FlowFilter().smooth(frames)


def test_masked_pixels_cost_their_neighbourhoods_only():
    frames = swinging()[0][:6]
    hidden = np.zeros(SIZE, bool)
    hidden[10:14, 10:14] = True
    filter_, whole = FlowFilter(), FlowFilter()
    for t, frame in enumerate(frames):
        field = filter_.push(np.ma.masked_array(frame, hidden & (t == 5)))
        plain = whole.push(frame)
    assert (field.status[10:14, 10:14] == Status.NON_FINITE).all()
    assert_allclose(field.u[:, 20:], plain.u[:, 20:], rtol=1e-5, atol=1e-6)
    wide = frames[0].astype(np.uint16) * 257
    masked, plain = FlowFilter(), FlowFilter()
    masked.push(np.ma.masked_array(wide))
    plain.push(wide)
    assert_array_equal(masked.state, plain.state)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize(
    "profile",
    [
        FilterProfile(Q=np.zeros(12), R=1e-6, P0=np.full(12, 100.0)),
        FilterProfile(name="measured", P0=np.full(12, 1e3)),
        FilterProfile(Q=np.zeros(12), R=1e-13, P0=np.full(12, 1e6)),
        FilterProfile(Q=np.full(12, 1e-12), R=1e-12, P0=np.full(12, 1e12)),
    ],
)
def test_covariances_are_definite(profile, precision):
    smoothed = FlowFilter(profile=profile, precision=precision).smooth(swinging()[0][:10])
    matrices = np.asarray(smoothed.covariance, float)[smoothed.valid]
    deviations = np.sqrt(np.einsum("nii->ni", matrices))
    assert (deviations > 0).all()
    eigenvalues = np.linalg.eigvalsh(matrices / deviations[:, :, None] / deviations[:, None, :])
    assert eigenvalues.min() > (-1e-5 if precision == "float32" else -1e-12)


def test_sites_that_no_frame_shows_stay_unknown():
    smoothed = FlowFilter().smooth(np.full((4, *SIZE), np.nan))
    assert not smoothed.valid.any() and np.isnan(smoothed.u).all()


def test_more_frames_than_there_is_memory_are_refused_at_once():
    with pytest.raises(MemoryError, match="^frames"):
        FlowFilter().smooth(np.broadcast_to(np.uint8(3), (10**12, 30, 30)))


def test_frames_may_be_any_iterable(runs):
    frames = runs[0][:4]

    class Recording:
        def __iter__(self):
            return iter(frames)

    assert_array_equal(FlowFilter().smooth(Recording()).u, FlowFilter().smooth(frames).u)
    assert_array_equal(jacoflow.estimate(dict(enumerate(frames)).values(), method="windowed").u, jacoflow.estimate(frames, method="windowed").u)
