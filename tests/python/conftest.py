"""Pictures that several tests look at."""

import numpy as np
import pytest

from jacoflow import scenes

# Those that take longest begin, so that no process works on one of them when all others are through.
SLOWEST = [
    *("test_stereo_track_scenes", "test_motion3d_tables", "test_motion3d_points", "test_motion3d_layouts", "test_motion3d_recordings"),
    *("test_track_limits", "test_motion3d_six", "test_accuracy", "test_calibration", "test_fork"),
]

METHODS = ["windowed", "coarse_to_fine", "instantaneous", "lucas_kanade", "horn_schunck"]


def moving_texture(count=3, motion=(0.3, -0.2, 0.01, 0.02, -0.02, 0.01), width=48, height=40, seed=3):
    """Smooth texture moving by the affine `motion` (u, v, u_x, v_x, u_y, v_y): float64 frames (count, H, W)
    in grey levels."""
    names = ("u", "v", "u_x", "v_x", "u_y", "v_y")
    return scenes.Scene("affine", width=width, height=height, random_state=seed, **dict(zip(names, motion, strict=True))).frames(count)


def pytest_collection_modifyitems(items):
    place = {name: k for k, name in enumerate(SLOWEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(SLOWEST)))


@pytest.fixture(scope="session")
def texture():
    """Three uint8 frames (3, 40, 48)."""
    frames = np.clip(np.round(moving_texture()), 0, 255).astype(np.uint8)
    frames.flags.writeable = False
    return frames
