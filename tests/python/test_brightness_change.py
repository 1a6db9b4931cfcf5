"""Pictures that are not equally bright, saturated pixels, and large motions: what real recordings bring."""

import numpy as np
import pytest

import jacoflow
from benchmarks.scenes import disturbed as scenes
from benchmarks.scenes import steps


def errors(frames, shift, **options):
    """Root-mean-square error of the flow, px, and share of 95 % intervals that hold."""
    field = jacoflow.flow(*frames, **options)
    error = scenes.inner(field.flow - np.array(shift))
    std = scenes.inner(np.stack([field.std("u"), field.std("v")], axis=-1))
    return float(np.sqrt(np.mean(np.sum(error**2, axis=-1)))), float(np.mean(np.abs(error) <= 1.96 * std))


@pytest.mark.parametrize("shift", [(0.5, 0.0), (6.3, -2.4)])
@pytest.mark.parametrize("change", scenes.CHANGES)
def test_a_change_of_brightness_costs_little(change, shift):
    """At most 1.3 times the error between equal frames, with intervals that hold as often in the mean."""
    lost = []
    for seed in (11, 12):
        equal, share = errors(scenes.changed_pair(seed, shift), shift)
        changed, held = errors(scenes.changed_pair(seed, shift, change), shift)
        assert changed < 1.3 * equal + 0.001, seed
        lost.append(share - held)
    assert np.mean(lost) < 0.05


def test_flicker_does_not_disturb_three_frames():
    for seed in (13, 14):
        picture = 110 + 22 * scenes.texture(seed)
        frames = [scenes.view(picture, (1.2 * t, -0.7 * t)) for t in (-1, 0, 1)]
        equal, _ = errors([scenes.noisy(frame, t) for t, frame in enumerate(frames)], (1.2, -0.7))
        gains = [lambda frame, gain=gain: gain * frame for gain in (0.9, 1.1, 0.8)]
        flicker = [scenes.noisy(frame, t, gain) for t, (gain, frame) in enumerate(zip(gains, frames, strict=True))]
        assert errors(flicker, (1.2, -0.7))[0] < 1.3 * equal + 0.001


def test_noise_that_is_given_grows_with_the_gain_that_is_removed():
    """The second of two frames is divided by .5, with its noise: variance (1 + 4) / 2 for 1. The noise is so
    low that standard deviations are proportional to it, and above the other errors."""
    picture = 110 + 22 * scenes.texture(16)
    views = [scenes.view(picture, (0, 0)), scenes.view(picture, (0.4, 0.2))]
    equal = jacoflow.flow(*[scenes.noisy(frame, n) for n, frame in enumerate(views)], noise=1.0)
    darker = [scenes.noisy(gain * frame, n) for n, (gain, frame) in enumerate(zip((1, 0.5), views, strict=True))]
    ratio = np.median(jacoflow.flow(*darker, noise=1.0).std("u") / equal.std("u"))
    assert 1.3 < ratio < 1.7


def test_equal_frames_are_taken_as_they_are():
    """Motion alone is no change of brightness: a constant added to both frames changes nothing."""
    pair = scenes.changed_pair(15, (4.0, 1.5))
    plain = jacoflow.flow(*pair).flow
    brighter = jacoflow.flow(*[frame + 30 for frame in pair]).flow
    np.testing.assert_allclose(plain, brighter, atol=1e-4)


def test_a_change_that_the_motion_explains_is_not_removed():
    """Along the first, poor motion of an expansion the brightness of these frames seems to change."""
    frames = [steps.moved(steps.texture(3), np.eye(2) * 1.2**k) for k in (-1, 0, 1)]
    error = np.abs(jacoflow.flow(*frames).flow - steps.flow(1.2 * np.eye(2)))[40:-40, 40:-40]
    assert np.median(error) < 0.003 and error.max() < 0.03


def test_a_few_saturated_pixels_change_nothing_elsewhere():
    for seed in range(2):
        clean, spoilt, far = scenes.specks(seed)
        one, other = jacoflow.flow(*clean), jacoflow.flow(*spoilt)
        std = np.stack([one.std("u"), one.std("v")], axis=-1)
        assert np.mean((np.abs(other.flow - one.flow) > 0.1 * std)[far]) < 0.05, seed


@pytest.mark.parametrize("shift", [(56, 0), (0, -64), (80, 60)])
def test_shifts_of_up_to_100_px_are_found(shift):
    field = jacoflow.flow(*scenes.shifted_speckle(7, shift))
    assert np.quantile(np.linalg.norm(field.flow - np.array(shift), axis=-1)[scenes.FOUND], 0.99) < 0.05
