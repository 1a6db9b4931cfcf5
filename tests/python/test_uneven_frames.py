"""Deviations where noise or texture differ from one part of the frame to another: neither far wider nor
narrower than the errors there."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

import jacoflow
from benchmarks.scenes import disturbed

MOTION = (1.3, -0.7)
APART = 40
"""Texture beyond the frame on each side, px."""


def textured(size, seed, contrast=40.0):
    """The frame moved by (u, v) px as a function of these, and the generator of its noise."""
    rng = np.random.default_rng(seed)
    texture = gaussian_filter(rng.normal(size=(size + 2 * APART,) * 2), 1.5)
    texture = 128 + contrast * texture / texture.std()
    y, x = np.indices((size, size)).astype(float)
    return (lambda u, v: map_coordinates(texture, [y + APART - v, x + APART - u], order=5)), rng


@pytest.mark.parametrize("noise", [2.0, 3.0])
def test_noise_of_a_part_of_the_frame_is_not_taken_for_motion(noise):
    """Shot noise is stronger where frames are bright: noise of 1 grey level, more in one quarter."""
    frame, rng = textured(160, 2)
    y, x = np.indices((160, 160))
    std = np.where((x > 80) & (y > 80), noise, 1.0)
    field = jacoflow.flow(*(frame(*move) + std * rng.normal(size=std.shape) for move in ((0, 0), MOTION)))
    inner = np.s_[89:148, 89:148]
    error, stated = (field.u - MOTION[0])[inner], field.std("u")[inner]
    print(f"noise {noise}: rms error {np.sqrt(np.mean(error**2)):.4f}, stated {np.median(stated):.4f}")
    assert np.mean(np.abs(error) < 2 * stated) > 0.7
    assert np.median(stated) < 2 * np.sqrt(np.mean(error**2))


@pytest.mark.parametrize("radius", [30, 40, 50])
def test_intervals_of_a_noisy_object_on_black_hold(radius):
    """A background without noise says nothing of the noise on the object."""
    held = []
    for seed in (1, 2, 3):
        frame, rng = textured(192, seed, contrast=30.0)
        y, x = np.indices((192, 192)).astype(float)
        pair = []
        for u, v in ((0, 0), MOTION):
            share = 1 / (1 + np.exp(np.hypot(x - 96 - u, y - 96 - v) - radius))
            noisy = share * frame(u, v) + np.sqrt(share) * rng.normal(size=share.shape)
            pair.append(np.clip(np.rint(np.where(share > 1e-3, noisy, 0)), 0, 255).astype(np.uint8))
        field = jacoflow.flow(*pair)
        inner = field.valid & (np.hypot(x - 96, y - 96) < radius - 14)
        held.append(np.mean(np.abs(field.u - MOTION[0])[inner] < 2 * field.std("u")[inner]))
    print(radius, np.round(held, 2))
    assert min(held) > 0.85


@pytest.mark.parametrize("preset", ["fast", "balanced", "accurate"])
def test_a_strip_of_texture_in_blank_frames_has_bounded_deviations(preset):
    frame, _ = textured(128, 0)
    pair = [np.full((128, 128), 128.0) for _ in range(2)]
    for blank, move in zip(pair, (0.0, MOTION[0]), strict=True):
        blank[60:70] = frame(move, 0)[60:70]
    field = jacoflow.flow(*pair, method=jacoflow.CoarseToFine(preset=preset))
    assert field.valid.any() and field.std("u")[field.valid].max() < 5


def card(move):
    """A still, noiseless background, and a card with a plain disc on it that moves."""
    size, (u, v) = 176, move
    y, x = np.indices((size, size)).astype(float)
    (background, _), (surface, _) = textured(size, 1), textured(size, 2)
    across, down = x - u - size / 2, y - v - size / 2
    moved = np.where(np.hypot(across, down) < 14, 128.0, surface(u, v))
    return gaussian_filter(np.where((abs(across) < 44) & (abs(down) < 44), moved, background(0, 0)), 0.5)


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("move", [(3, 2), (9, -5)])
def test_a_plain_disc_on_a_moving_card_has_the_errors_of_the_card(move, preset):
    """Most of the frame stands still without any noise, so that coarse levels do not err there."""
    field = jacoflow.flow(card((0, 0)), card(move), method=jacoflow.CoarseToFine(preset=preset))
    y, x = np.indices(field.u.shape)
    disc = field.valid & (np.hypot(x - 88, y - 88) < 11)
    error, stated = (field.u - move[0])[disc], field.std("u")[disc]
    print(f"rms error {np.sqrt(np.mean(error**2)):.4f}, stated {np.median(stated):.4f}")
    assert np.mean(np.abs(error) < 1.96 * stated) > 0.9
    assert np.median(stated) < 0.3


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rounding_in_a_blank_half_is_not_taken_for_motion(dtype):
    frame, _ = textured(128, 0)
    pair = [frame(*move).astype(dtype) for move in ((0, 0), MOTION)]
    for picture in pair:
        picture[:, 64:] = 128
    one, other = (jacoflow.flow(*pair, simd=simd).std("u") for simd in ("scalar", None))
    assert np.max(np.abs(one / other - 1)) < 0.1


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_faint_texture_has_about_the_deviations_of_its_errors(seed):
    """Only frames that are smoothed show it beneath the noise: coarser levels determine its motion. From the
    finest level alone deviations are two pixels."""
    field = jacoflow.flow(*disturbed.faint(seed, MOTION))
    inner = np.s_[disturbed.FAINT : -disturbed.MARGIN, disturbed.MARGIN : -disturbed.MARGIN]
    error, stated = (field.flow - np.array(MOTION))[inner], np.stack([field.std("u"), field.std("v")], axis=-1)[inner]
    print(f"rms error {np.sqrt(np.mean(error**2)):.3f}, stated {np.median(stated):.3f}")
    assert np.mean(np.abs(error) < 1.96 * stated) > 0.95
    assert np.median(stated) < 0.6


def test_texture_blurred_into_a_plain_area_does_not_determine_its_motion():
    """Without noise the smallest gradients of smoothed frames seem to show a motion."""
    size, turn = 176, 0.04
    y, x = np.indices((size, size)).astype(float) - size / 2
    rng = np.random.default_rng(3)
    texture = gaussian_filter(rng.normal(size=(size + 2 * APART,) * 2), 1.5)
    texture = 128 + 40 * texture / texture.std()
    texture[: APART + 88] = 128
    flow = np.stack([-turn * y, turn * x], axis=-1)
    at = np.stack([y + flow[..., 1], x + flow[..., 0]]) + APART + size / 2
    frames = [map_coordinates(texture, at, order=5), texture[APART:-APART, APART:-APART]]
    field = jacoflow.flow(*frames)
    error = np.linalg.norm(field.flow - flow, axis=-1)
    stated = np.hypot(field.std("u"), field.std("v"))
    is_silent = (error > 1) & (stated < error / 5) & (field.status == jacoflow.Status.OK)
    print(f"errors above 1 px {np.mean(error > 1):.3f}, silent {np.mean(is_silent):.3f}")
    assert np.mean(is_silent[8:-8, 8:-8]) < 0.01
