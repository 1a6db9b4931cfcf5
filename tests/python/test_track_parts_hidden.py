"""Targets of which only a part is seen: begun half behind something still, going beyond the border, and large
ones of which only the outline moves."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from jacoflow import track

SHAPE = (150, 220)


def rough(shape, sigma, mean, deviation, seed):
    """Smooth noise of a mean and a deviation, grey levels."""
    noise = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), sigma, mode="wrap")
    return mean + deviation * noise / noise.std()


def movie(path, side, *, texture=0.0, hidden=None, bar=130.0, seed=0):
    """Frames (T, H, W) of a square along a path (T, 2), with a bar over the columns `hidden` = (first, beyond
    the last)."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    behind = rough(SHAPE, 3, 90, 20, seed + 100)
    surface = rough((side + 40, side + 40), 2, 200, texture, seed + 200)
    frames = []
    for right, down in path:
        cover = np.clip((side + 1) / 2 - abs(x - right), 0, 1) * np.clip((side + 1) / 2 - abs(y - down), 0, 1)
        bright = map_coordinates(surface, [y - down + side / 2 + 20, x - right + side / 2 + 20], order=3, mode="nearest") if texture else 200.0
        frame = behind * (1 - cover) + bright * cover
        if hidden is not None:
            frame[:, hidden[0] : hidden[1]] = bar
        frames.append(np.clip(np.rint(frame + rng.normal(0, 2, SHAPE)), 0, 255).astype(np.uint8))
    return np.stack(frames)


def box_about(centre, side):
    """Box of a square about its centre."""
    return (centre[0] - side / 2, centre[1] - side / 2, side, side)


def straight(velocity, frames=50, start=(70.0, 75.0)):
    """A path (T, 2), px."""
    return np.array(start) + np.arange(frames)[:, None] * velocity


def held(found, path):
    """Share of frames in which both coordinates are within two stated deviations."""
    deviations = np.sqrt(found.covariance[:, :, 0, 0])
    return (np.abs(found.position - path) < 2 * deviations).all(axis=1)[1:].mean()


@pytest.mark.parametrize("texture", [0.0, 25.0])
@pytest.mark.parametrize("speed", [0.6, 1.5, 3.0])
@pytest.mark.parametrize("side", [15, 21, 41, 61])
def test_a_target_begun_half_behind_something_still_is_distinguished_from_it(side, speed, texture):
    path = straight((speed, 0.0), frames=int(np.clip(side / speed + 12, 30, 90)))
    found = track.track(movie(path, side, texture=texture, hidden=(0, 70)), box_about(path[0], side))
    errors = np.linalg.norm(found.position - path, axis=1)
    # Three pixels of motion tell it; before that the deviations hold what may be wrong.
    assert errors.max() < 3.0 + speed and errors[-5:].mean() < 0.5
    assert held(found, path) > (0.7 if speed > 1 else 0.4)
    assert "occluded" in found.status[1:] and {"lost", "out"}.isdisjoint(found.status)
    assert np.abs(found.box[-5:, 2:] - side).max() < 0.1 * side


@pytest.mark.parametrize("share", [0.3, 0.7])
@pytest.mark.parametrize("bar", [40.0, 130.0, 240.0])
def test_any_share_may_be_hidden_by_anything(share, bar):
    path = straight((1.2, 0.8))
    found = track.track(movie(path, 31, hidden=(0, round(70 - 15.5 + 31 * share)), bar=bar), box_about(path[0], 31))
    errors = np.linalg.norm(found.position - path, axis=1)
    assert errors.max() < 5.0 and errors[-10:].mean() < 0.5


def test_a_target_begun_half_behind_a_bar_goes_behind_it_and_comes_out():
    path = straight((-1.0, 0.0), frames=60, start=(120.0, 75.0))
    found = track.track(movie(path, 41, hidden=(96, 120)), box_about(path[0], 41))
    errors = np.linalg.norm(found.position - path, axis=1)
    assert errors.max() < 3.0 and errors[-5:].mean() < 1.0 and set(found.status) <= {"tracking", "occluded"}


@pytest.mark.parametrize("larger", [1.0, 1.2])
def test_what_is_behind_the_target_is_not_taken_for_what_is_before_it(larger):
    """A margin of the box that stays is no part of the target."""
    path = straight((1.5, 0.5))
    found = track.track(movie(path, 21), box_about(path[0], 21 * larger))
    assert np.linalg.norm(found.position - path, axis=1).max() < 1.5 and np.mean(found.status == "tracking") > 0.9
