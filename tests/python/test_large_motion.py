"""Motions of many pixels: how far the pyramid reaches, and that a preset which costs more does not reach less
far."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

import jacoflow

SIZE = (240, 320)
MARGIN = 180


def moved(angle, shift, seed):
    """Three frames of a texture that turns by `angle` degrees about the middle and moves by `shift` px along
    x from frame to frame, the flow (H, W, 2) from the middle one, and where all three show the same."""
    rng = np.random.default_rng(seed)
    smooth = gaussian_filter(rng.standard_normal([side + 2 * MARGIN for side in SIZE]), 2)
    texture = 128 + 40 * smooth / smooth.std()
    y, x = np.indices(SIZE).astype(float)
    centre = [(side - 1) / 2 for side in SIZE]

    def place(time):
        """Where the pixels of the middle frame are at another time, (x, y)."""
        cosine, sine = np.cos(time * np.radians(angle)), np.sin(time * np.radians(angle))
        dx, dy = x - centre[1], y - centre[0]
        return centre[1] + cosine * dx - sine * dy + time * shift, centre[0] + sine * dx + cosine * dy

    def frame(time):
        from_x, from_y = place(-time)
        values = map_coordinates(texture, [from_y + MARGIN, from_x + MARGIN], order=1)
        return np.clip(values + rng.standard_normal(SIZE), 0, 255).astype(np.uint8)

    inside = np.ones(SIZE, bool)
    for time in (-1, 0, 1):
        px, py = place(time)
        inside &= (px > 8) & (px < SIZE[1] - 9) & (py > 8) & (py < SIZE[0] - 9)
    ahead = np.stack(place(1), axis=-1) - np.stack([x, y], axis=-1)
    return [frame(time) for time in (-1, 0, 1)], ahead, inside


def error(frames, truth, inside, preset):
    field = jacoflow.flow(*frames, method=jacoflow.CoarseToFine(preset=preset), covariance=False)
    return float(np.linalg.norm(field.flow - truth, axis=-1)[inside].mean())


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize(("angle", "shift", "frames"), [(15, 0, 2), (20, 0, 3), (0, 40, 2), (0, 40, 3)])
def test_a_fast_turn_and_a_long_way_are_followed_everywhere(angle, shift, frames, preset):
    """At 20 degrees the corners move by 70 px, a fifth of the width."""
    for seed in range(2):
        pictures, truth, inside = moved(angle, shift, seed)
        assert error(pictures[3 - frames :], truth, inside, preset) < 0.1, seed


def test_accurate_reaches_as_far_as_balanced():
    """Two frames that turn by 20 degrees are at the edge of what is found: not every texture is followed by
    either."""
    scenes = [moved(20, 0, seed) for seed in range(8)]
    found = {
        preset: sum(error(pictures[1:], truth, inside, preset) < 0.2 for pictures, truth, inside in scenes)
        for preset in ("balanced", "accurate")
    }
    print(found)
    assert found["accurate"] >= found["balanced"] >= 6
