"""Pictures that are not equally bright, specks, and large motions: what real recordings bring."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

import jacoflow

SIZE = (200, 260)
MARGIN = 24
"""Of the texture around the frame, px; also left out along each side of the field."""


def texture(seed, scale=1.5, shape=SIZE):
    """Fine and coarse grain, mean 0 and standard deviation 1, with a margin."""
    rng = np.random.default_rng(seed)
    noise = [rng.standard_normal([side + 2 * MARGIN for side in shape]) for _ in range(2)]
    grain = [gaussian_filter(part, size) for part, size in zip(noise, (scale, 4 * scale), strict=True)]
    both = grain[0] / grain[0].std() + grain[1] / grain[1].std()
    return both / both.std()


def view(picture, shift, shape=SIZE):
    """The frame in which the picture has moved by `shift` px, (x, y)."""
    y, x = np.indices(shape).astype(float)
    return map_coordinates(picture, [y + MARGIN - shift[1], x + MARGIN - shift[0]], order=5, mode="nearest")


def noisy(frame, seed, change=lambda frame: frame):
    """8-bit levels with noise of one level before a change of brightness."""
    return np.clip(np.rint(change(frame + np.random.default_rng(seed).standard_normal(frame.shape))), 0, 255)


def inner(plane):
    return plane[MARGIN:-MARGIN, MARGIN:-MARGIN]


def errors(frames, shift, **options):
    """Root-mean-square error of the flow, px, and share of 95 % intervals that hold."""
    field = jacoflow.estimate(frames, **options)
    error = inner(field.flow - np.array(shift))
    std = inner(np.stack([field.std("u"), field.std("v")], axis=-1))
    return float(np.sqrt(np.mean(np.sum(error**2, axis=-1)))), float(np.mean(np.abs(error) <= 1.96 * std))


X = np.linspace(0, 1, SIZE[1])
CHANGES = {
    "gain .5": lambda frame: 0.5 * frame,
    "gain .8": lambda frame: 0.8 * frame,
    "gain 1.4": lambda frame: 1.4 * frame,
    "offset 60": lambda frame: frame + 60,
    "offset -50": lambda frame: frame - 50,
    "gain .8, offset 20": lambda frame: 0.8 * frame + 20,
    "gain .7 to 1.1 along x": lambda frame: (0.7 + 0.4 * X) * frame,
}


@pytest.mark.parametrize("shift", [(0.5, 0.0), (6.3, -2.4)])
@pytest.mark.parametrize("change", CHANGES)
def test_a_change_of_brightness_costs_little(change, shift):
    """At most 1.3 times the error between equal frames, with intervals that hold as often in the mean."""
    lost = []
    for seed in (11, 12):
        picture = 110 + 22 * texture(seed)
        first, second = view(picture, (0, 0)), view(picture, shift)
        equal, share = errors([noisy(first, 1), noisy(second, 2)], shift)
        changed, held = errors([noisy(first, 1), noisy(second, 2, CHANGES[change])], shift)
        assert changed < 1.3 * equal + 0.001, seed
        lost.append(share - held)
    assert np.mean(lost) < 0.05


def test_flicker_does_not_disturb_three_frames():
    for seed in (13, 14):
        picture = 110 + 22 * texture(seed)
        frames = [view(picture, (1.2 * t, -0.7 * t)) for t in (-1, 0, 1)]
        equal, _ = errors([noisy(frame, t) for t, frame in enumerate(frames)], (1.2, -0.7))
        gains = [lambda frame, gain=gain: gain * frame for gain in (0.9, 1.1, 0.8)]
        flicker = [noisy(frame, t, gain) for t, (gain, frame) in enumerate(zip(gains, frames, strict=True))]
        assert errors(flicker, (1.2, -0.7))[0] < 1.3 * equal + 0.001


def test_equal_frames_are_taken_as_they_are():
    """Motion alone is no change of brightness: a constant added to both frames changes nothing."""
    picture = 100 + 25 * texture(15)
    pair = [noisy(view(picture, (0, 0)), 1), noisy(view(picture, (4.0, 1.5)), 2)]
    plain = jacoflow.estimate(pair).flow
    brighter = jacoflow.estimate([frame + 30 for frame in pair]).flow
    np.testing.assert_allclose(plain, brighter, atol=1e-4)


def test_a_few_saturated_pixels_change_nothing_elsewhere():
    shape = (480, 640)
    for seed in range(3):
        picture = 1500 + 300 * texture(20 + seed, shape=shape)
        rng = np.random.default_rng(seed)
        views = [view(picture, (0.25 * t, 0), shape) for t in (-1, 0, 1)]
        frames = [np.rint(frame + 3 * rng.standard_normal(shape)) for frame in views]
        clean = jacoflow.estimate([frame.astype(np.uint16) for frame in frames])
        rows, columns = rng.integers(20, shape[0] - 20, 20), rng.integers(20, shape[1] - 20, 20)
        frames[1][rows, columns] = 4095
        specks = jacoflow.estimate([frame.astype(np.uint16) for frame in frames])
        y, x = np.indices(shape)
        distance = np.min([np.hypot(x - c, y - r) for r, c in zip(rows, columns, strict=True)], axis=0)
        change = np.abs(specks.flow - clean.flow)[distance > 20]
        std = np.stack([clean.std("u"), clean.std("v")], axis=-1)[distance > 20]
        assert np.mean(change > 0.1 * std) < 0.05, seed


@pytest.mark.parametrize("shift", [(56.0, 0.0), (0.0, -64.0), (80.0, 60.0)])
def test_shifts_of_up_to_100_px_are_found(shift):
    """Fine speckle of 400 x 400 px, which has nothing to follow on the coarsest levels."""
    rng = np.random.default_rng(7)
    speckle = gaussian_filter(rng.standard_normal((620, 620)), 1.5)
    speckle = 128 + 40 * speckle / speckle.std()
    u, v = (round(side) for side in shift)
    pair = [speckle[110:510, 110:510], speckle[110 - v : 510 - v, 110 - u : 510 - u]]
    field = jacoflow.estimate(pair)
    # Off the parts that leave the frame.
    inside = np.s_[130:-150, 130:-150]
    assert np.quantile(np.linalg.norm(field.flow - np.array(shift), axis=-1)[inside], 0.99) < 0.05
