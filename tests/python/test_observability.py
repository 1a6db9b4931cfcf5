"""Observability maps of real pictures."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import jacoflow
from jacoflow import Condition, scenes


def test_a_turning_ramp_is_observable_through_its_gradient():
    frames = scenes.Scene("ramp", width=24, height=20, origin=(40, 60)).frames(3)
    found = jacoflow.observability(frames)
    inside = (slice(1, -1), slice(1, -1))
    assert found.rank.shape == (20, 24) and found.observable[inside].all()
    assert (found.condition[inside] == Condition.TURNING_GRADIENT).all()
    assert (found.rank_single[inside] == 3).all()
    border = np.ones((20, 24), bool)
    border[inside] = False
    assert_array_equal(~found.known, border)
    assert np.isnan(found.condition_number[border]).all() and np.isfinite(found.condition_number[inside]).all()


def test_textures_are_observable_and_flat_or_striped_pictures_are_not():
    texture = jacoflow.observability(scenes.Scene("affine", width=32, height=32).frames(3))
    assert texture.observable.mean() > 0.7
    flat = jacoflow.observability(np.full((3, 16, 16), 9, np.uint8))
    assert (flat.rank == 0).all() and flat.known[1:-1, 1:-1].all()
    stripes = np.tile(10 * np.sin(np.arange(16.0)), (16, 1))
    moving = jacoflow.observability([np.roll(stripes, t, axis=1) for t in range(3)])
    assert not moving.observable.any()


def test_status_of_the_estimator_agrees_with_the_map():
    frames = list(scenes.Scene("affine", width=32, height=32).frames(3))
    found = jacoflow.observability(frames)
    field = jacoflow.flow(*frames, method="instantaneous", diagnostics=True)
    assert_array_equal(field.rank[found.known], found.rank[found.known])


def test_damage_and_wrong_counts():
    frames = scenes.Scene("affine", width=20, height=20).frames(3)
    frames[1, 10, 10] = np.nan
    found = jacoflow.observability(frames)
    assert not found.known[9:12, 9:12].any() and found.known[1:-1, 1:-1].sum() == 18 * 18 - 9
    with pytest.raises(ValueError, match="frames: expected three frames, got 4 frames"):
        jacoflow.observability(np.zeros((4, 8, 8)))
    with pytest.raises(ValueError, match="time_scheme: "):
        jacoflow.observability(frames, time_scheme="pair")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="condition|jet"):
        jacoflow.classify([1, 2], [0] * 6)
