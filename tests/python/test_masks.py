"""Beside a mask the flow is nearly as good as beside the frame's edge: what the mask hides does not hold it
back."""

import numpy as np
import pytest

from benchmarks.scenes import steps
import jacoflow

EDGE = 90
"""First hidden column."""
BESIDE = np.s_[12:-12, EDGE - 12 : EDGE]
MOTIONS = {
    "shift": (np.eye(2), (2.6, -1.3)),
    "turn": (steps.turn(0.04), (0.0, 0.0)),
    "growth": (1.05 * np.eye(2), (1.5, 0.0)),
}


def pair(seed, matrix, shift):
    """Two 8-bit frames with noise of one grey level."""
    rng, picture = np.random.default_rng(seed), steps.waves(seed)
    frames = (steps.moved(picture, np.eye(2)), steps.moved(picture, matrix, shift))
    return [np.clip(np.rint(frame + rng.standard_normal(frame.shape)), 0, 255).astype(np.uint8) for frame in frames]


def rms(field, truth, region):
    return float(np.sqrt(np.nanmean((field.flow - truth)[region] ** 2)))


@pytest.mark.parametrize("name", MOTIONS)
def test_a_mask_costs_little_more_than_the_edge_of_the_frame(name):
    matrix, shift = MOTIONS[name]
    truth, hidden, cropped, outside = steps.flow(matrix, shift), [], [], []
    for seed in range(61, 65):
        frames = pair(seed, matrix, shift)
        mask = np.ones(frames[0].shape, bool)
        mask[:, EDGE:] = False
        field = jacoflow.flow(*frames, mask=mask)
        assert not field.valid[:, EDGE:].any()
        hidden.append(rms(field, truth, BESIDE))
        cropped.append(rms(jacoflow.flow(*(frame[:, :EDGE] for frame in frames)), truth[:, :EDGE], BESIDE))
        off = np.abs(field.flow - truth)[BESIDE]
        std = np.stack([field.std("u"), field.std("v")], axis=-1)[BESIDE]
        outside.append(np.mean((off > 4 * std)[field.valid[BESIDE]]))
    assert np.sqrt(np.mean(np.square(hidden))) < 2 * np.sqrt(np.mean(np.square(cropped)))
    assert np.mean(outside) < 0.02


@pytest.mark.parametrize("width", [10, 20])
def test_flow_along_a_narrow_channel_is_not_held_back_by_its_walls(width):
    shift = (0.0, 4.0)
    channel = np.s_[12:-12, 70 : 70 + width]
    for seed in range(61, 64):
        mask = np.zeros((steps.SIZE, steps.SIZE), bool)
        mask[:, channel[1]] = True
        field = jacoflow.flow(*pair(seed, np.eye(2), shift), mask=mask)
        valid = field.valid[channel]
        off = (field.flow - np.array(shift))[channel][valid]
        assert valid.mean() > 0.6
        assert np.sqrt(np.mean(off**2)) < 0.05
