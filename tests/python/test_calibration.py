"""What `estimate` says by default, against exact truth: its errors lie within its deviations, and are smaller
than the baselines'."""

import itertools
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

import jacoflow
from benchmarks.ablation.flow import disc
from jacoflow import scenes

MARGIN = 20
CASES = [("affine", "noise"), ("affine", "speckle"), ("affine", "particles"), ("vortex", "noise"), ("vortex", "particles"), ("plane", None)]


# Motions that bend take long to follow: what is drawn is kept for other noise and other methods, and the
# truth for other textures, which move alike.


def scene_of(name, carrier, seed, parameters, size):
    return scenes.Scene(name, width=size[0], height=size[1], random_state=seed, carrier=carrier, **dict(parameters))


@cache
def still(name, carrier, seed, parameters=(), size=(112, 96)):
    """Frames at -1, 0 and 1 without noise."""
    return [scene_of(name, carrier, seed, parameters, size).frame(t) for t in (-1.0, 0.0, 1.0)]


@cache
def truth_of(name, carrier, seed, parameters=(), size=(112, 96), between=(0.0, 1.0)):
    return scene_of(name, carrier, seed, parameters, size).truth(0.0, between=between)


def camera_frames(frames, noise, seed):
    camera = scenes.Sensor(noise=noise, rounding="nearest", saturate=True, random_state=seed)
    return [camera.apply_u8(frame, index) for index, frame in enumerate(frames)]


def inner(field, truth):
    inside = np.zeros(field.shape, bool)
    inside[MARGIN:-MARGIN, MARGIN:-MARGIN] = True
    return inside & field.valid & truth.valid


def flow_error(field, truth, known):
    return np.sqrt(np.mean(np.sum((field.flow - truth.flow)[known] ** 2, axis=-1)))


# Errors of the second go together over some 20 px: a frame of this size holds only a few independent ones, so
# that it takes more frames.
@pytest.mark.parametrize(("method", "seeds", "share"), [("windowed", 1, 0.88), ("coarse_to_fine", 8, 0.9)])
@pytest.mark.parametrize("noise", [0.0, 2.0])
@pytest.mark.parametrize(("name", "carrier"), CASES)
def test_errors_lie_within_their_deviations(name, carrier, noise, method, seeds, share):
    held = {}
    for seed in range(3, 3 + seeds):
        # To the next frame, or at the middle one.
        truth = truth_of(name, carrier, seed, between=(0.0, 1.0) if method == "coarse_to_fine" else None)
        field = jacoflow.flow(*camera_frames(still(name, carrier, seed), noise, seed), method=method)
        known = inner(field, truth)
        assert known.sum() > 0.99 * (112 - 2 * MARGIN) * (96 - 2 * MARGIN)
        for parameter in (*field.parameters, "divergence", "curl"):
            error = (field.value(parameter) - truth.value(parameter))[known]
            held.setdefault(parameter, []).append(np.mean(np.abs(error) < 2 * field.std(parameter)[known]))
    for parameter, shares in held.items():
        assert np.mean(shares) > share, (parameter, shares)


@pytest.mark.parametrize(("name", "carrier"), CASES)
def test_the_default_beats_the_baselines(name, carrier):
    frames, truth = camera_frames(still(name, carrier, 3), 1.0, 1), truth_of(name, carrier, 3)
    ours = jacoflow.flow(*frames)
    known = inner(ours, truth)
    for method in ("lucas_kanade", "horn_schunck"):
        other = jacoflow.flow(*frames, method=method)
        assert flow_error(ours, truth, known) < flow_error(other, truth, known & other.valid), method


@pytest.mark.parametrize("carrier", ["noise", "speckle", "particles"])
def test_the_flow_is_not_drawn_to_zero(carrier):
    """Slope of the estimate over the truth, on a vortex seen in 8 bits."""
    field, truth = jacoflow.flow(*camera_frames(still("vortex", carrier, 5), 1.0, 1)), truth_of("vortex", carrier, 5)
    known = inner(field, truth)
    slope = np.sum((field.flow * truth.flow)[known]) / np.sum(truth.flow[known] ** 2)
    assert abs(slope - 1) < 0.05


MOTIONS = {
    "affine": {"u": 2.3, "v": -1.2, "u_x": 0.01, "v_x": 0.02, "u_y": -0.02, "v_y": 0.01},
    "waves": {"speed": 1.5, "wavelength": 128.0},
    "turbulence": {"speed": 1.5, "longest": 192.0},
}


@pytest.mark.parametrize("frames", [2, 3])
@pytest.mark.parametrize("carrier", ["noise", "speckle", "particles"])
def test_intervals_of_the_coarse_to_fine_estimate_hold_the_truth(carrier, frames):
    """95 % intervals over three motions and two noise levels together: .92 to .97 is required. One texture
    has few independent errors, since windows reach over 20 px, and those of pairs and of affine motion are
    stated on the wide side (benchmarks/tables/coverage.py), most of all noise textures in three frames (.99):
    .90 to .995 is allowed here.
    """
    held = {name: [] for name in ("u", "v", "divergence", "curl")}
    for (motion, parameters), noise, seed in ((m, n, s) for m in MOTIONS.items() for n, s in ((1.0, 1), (3.0, 2))):
        moves = tuple(parameters.items())
        pictures = camera_frames(still(motion, carrier, seed, moves, (176, 160))[3 - frames :], noise, seed)
        truth = truth_of(motion, "noise", seed, moves, (176, 160))
        field = jacoflow.flow(*pictures, method=jacoflow.CoarseToFine(time_scheme="pair" if frames == 2 else None))
        inside = np.s_[16:-16, 16:-16]
        for name, shares in held.items():
            error = np.abs(field.value(name) - truth.value(name))[inside]
            shares.append(np.mean(error < 1.96 * field.std(name)[inside]))
    for name, shares in held.items():
        assert 0.90 <= np.mean(shares) <= 0.995, (name, shares)


def test_intervals_of_a_small_disc_hold_its_motion():
    """Smoothness holds back a disc of 20 px that turns by .02 rad: by half of its motion without the step
    beyond chance, and half of the intervals of u missed that."""
    missed, relative = np.mean([disc(seed, 0.02) for seed in range(61, 65)], axis=0)
    assert missed < 0.05 and relative < 0.35


@pytest.mark.parametrize("frames", [2, 3])
def test_what_leaves_the_frame_has_wide_intervals(frames):
    """Beside an edge that motion of 6 px crosses nothing is seen; a field that is continued from inside is
    stated to be so."""
    shares, wider = [], []
    shear = {"u": 6.0, "v": 0.5, "u_x": 0.0, "v_x": 0.0, "u_y": 0.02, "v_y": 0.0}
    motions = (("affine", shear), ("waves", {"speed": 6.0, "wavelength": 128.0}))
    for (motion, parameters), seed in itertools.product(motions, range(3, 5)):
        moves = tuple(parameters.items())
        pictures = camera_frames(still(motion, "noise", seed, moves, (176, 160))[3 - frames :], 1.0, seed)
        truth = truth_of(motion, "noise", seed, moves, (176, 160))
        field = jacoflow.flow(*pictures, method=jacoflow.CoarseToFine(time_scheme="pair" if frames == 2 else None))
        columns, rows = np.meshgrid(np.arange(176), np.arange(160))
        ways = [truth.flow, -truth.flow] if frames == 3 else [truth.flow]
        seen = np.logical_and.reduce([(columns + w[..., 0] >= 0) & (columns + w[..., 0] <= 175) & (rows + w[..., 1] >= 0) & (rows + w[..., 1] <= 159) for w in ways])
        assert (~seen).sum() > 500
        for name in ("u", "v"):
            shares.append(np.mean((np.abs(field.value(name) - truth.value(name)) < 1.96 * field.std(name))[~seen]))
            wider.append(np.median(field.std(name)[~seen]) / np.median(field.std(name)[40:-40, 40:-40]))
    assert np.mean(shares) > 0.8 and min(wider) > 3, (shares, wider)


@pytest.mark.parametrize("size", [(160, 128), (161, 129), (157, 124)])
def test_deviations_of_mirrored_frames_are_mirrored(size):
    """All four sides are told the same, whatever the size is a multiple of."""
    scene = scenes.Scene("turbulence", width=size[0], height=size[1], random_state=2, carrier="noise", speed=2.0, longest=192.0)
    frames = [np.round(scene.frame(t)).astype(np.float32) for t in (0.0, 1.0)]
    deviations = jacoflow.flow(*frames, method=jacoflow.CoarseToFine(time_scheme="pair")).std("u")
    mirrored = jacoflow.flow(*[np.ascontiguousarray(frame[::-1, ::-1]) for frame in frames], method=jacoflow.CoarseToFine(time_scheme="pair")).std("u")[::-1, ::-1]
    sides = [np.s_[:2], np.s_[-2:], np.s_[:, :2], np.s_[:, -2:]]
    for side in sides:
        # SamplingGrid are every second pixel, so that the estimates themselves differ at an edge.
        assert 0.5 < np.median(mirrored[side]) / np.median(deviations[side]) < 2.0
        assert np.median(deviations[side]) > 1.5 * np.median(deviations)
    assert abs(np.log(mirrored / deviations)[16:-16, 16:-16]).mean() < 0.1


def test_the_covariance_is_positive_definite_and_grows_with_noise_and_without_texture():
    rng = np.random.default_rng(2)
    scene = scenes.Scene("affine", width=160, height=128, random_state=4, carrier="noise", u=1.2, v=0.4, u_x=0.0, v_x=0.0, u_y=0.0, v_y=0.0)
    clean = [scene.frame(t) for t in (0.0, 1.0)]
    fade = np.where(np.arange(160) < 80, 1.0, 0.0)
    deviations = []
    for noise in (1.0, 4.0):
        frames = [128 + (frame - 128) * fade + rng.normal(0, noise, frame.shape) for frame in clean]
        field = jacoflow.flow(*frames, method=jacoflow.CoarseToFine(time_scheme="pair"))
        scale = np.sqrt(np.einsum("...ii->...i", field.covariance))
        correlation = field.covariance / scale[..., :, None] / scale[..., None, :]
        assert np.linalg.eigvalsh(correlation).min() > 1e-3
        deviations.append((np.median(field.std("u")[16:-16, 16:56]), np.median(field.std("u")[16:-16, 120:-16])))
    assert deviations[1][0] > 1.5 * deviations[0][0]
    assert deviations[0][1] > 3 * deviations[0][0]


def flat_area(kind, width, centre):
    """Signed distance, px, from the edge of a flat square or stripe, or of the flat half of a frame: negative
    where it is flat."""
    y, x = np.indices((256, 256)).astype(float)
    return {"square": np.maximum(abs(x - centre), abs(y - centre)) - width / 2, "stripe": abs(x - centre) - width / 2, "half": x - centre}[kind]


@pytest.mark.parametrize(
    ("preset", "kind", "width", "textures", "least"),
    [
        ("fast", "square", 40, 2, 0.85),
        ("fast", "square", 80, 1, 0.9),
        ("fast", "stripe", 48, 1, 0.85),
        ("fast", "half", 256, 1, 0.75),
        ("balanced", "square", 28, 1, 0.9),
        ("balanced", "square", 80, 1, 0.9),
        ("balanced", "stripe", 32, 1, 0.9),
        ("balanced", "half", 256, 1, 0.85),
    ],
)
def test_what_coarse_levels_leave_beneath_areas_without_texture_is_reported(preset, kind, width, textures, least):
    """In a scene that moves as a whole nothing bends, but only coarse levels see into flat areas. Where the
    area lies on the grid that deviations are given at must not matter. They may be wide, but not so wide that
    nothing is told."""
    y, x = np.indices((256, 256)).astype(float)
    inside, rim, wide = [], [], []
    for at, centre in enumerate((128, 132, 136, 140)):
        beyond = flat_area(kind, width, centre)
        for seed in range(2) if textures == 2 else [at % 2]:
            rng = np.random.default_rng(seed)
            smooth = gaussian_filter(rng.standard_normal(x.shape), 1.5, mode="wrap")
            first = 128 + 40 * smooth / smooth.std() * np.clip(beyond / 3 + 0.5, 0, 1)
            u, v = 1.7 + 0.6 * seed, -0.9 + 0.5 * seed
            second = map_coordinates(first, [y - v, x - u], order=3, mode="wrap")
            pair = [np.clip(np.rint(frame + rng.standard_normal(x.shape)), 0, 255).astype(np.uint8) for frame in (first, second)]
            field = jacoflow.flow(*pair, method=jacoflow.CoarseToFine(preset=preset))
            errors = {"u": field.u - u, "v": field.v - v, "divergence": field.divergence, "curl": field.curl}
            held = np.array([abs(error) < 1.96 * field.std(name) for name, error in errors.items()])[:, 16:-16, 16:-16]
            beyond_edge = beyond[16:-16, 16:-16]
            inside.append(held[:, beyond_edge < -6].mean(axis=1))
            rim.append(held[:, abs(beyond_edge - 1) < 7].mean(axis=1))
            wide.append(np.median(field.std("u")[16:-16, 16:-16][beyond_edge < -6]))
    inside, rim = np.array(inside), np.array(rim)
    print(preset, kind, width, np.round(inside.mean(axis=0), 2), np.round(rim.mean(axis=0), 2), np.round([inside.min(), rim.min()], 2), np.round(np.median(wide), 3))
    assert inside.mean(axis=0).min() > least and rim.mean(axis=0).min() > least
    assert kind == "half" or np.median(wide) < 0.8


@pytest.mark.parametrize("preset", ["fast", "balanced"])
@pytest.mark.parametrize("frames", [2, 3])
def test_texture_of_one_direction_shows_motion_across_it_and_not_along_it(preset, frames):
    """A square of 80 px has upright stripes, the rest of the scene has texture of all directions; all of it
    moves as a whole."""
    y, x = np.indices((240, 320)).astype(float)
    area = np.s_[90:150, 130:190]
    across, along = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        stripes = gaussian_filter(rng.standard_normal(x.shape[1]), 1.5, mode="wrap")
        blobs = gaussian_filter(rng.standard_normal(x.shape), 1.5, mode="wrap")
        within = np.maximum(abs(x - 160), abs(y - 120)) < 40
        scene = 128 + 40 * np.where(within, stripes / stripes.std(), blobs / blobs.std())
        u, v = 1.7, -0.9 + 0.5 * seed
        sequences = [map_coordinates(scene, [y - k * v, x - k * u], order=3, mode="wrap") for k in range(2 - frames, 2)]
        sequence = [np.clip(np.rint(frame + rng.standard_normal(x.shape)), 0, 255).astype(np.uint8) for frame in sequences]
        field = jacoflow.flow(*sequence, method=jacoflow.CoarseToFine(preset=preset))
        for found, name, truth in ((across, "u", u), (along, "v", v)):
            error, told = (field.value(name) - truth)[area], field.std(name)[area]
            found.append((np.mean(abs(error) < 1.96 * told), np.sqrt(np.mean(error**2)), np.median(told)))
    across, along = np.mean(across, axis=0), np.mean(along, axis=0)
    print(preset, frames, "across: held, error, told", np.round(across, 4), "along", np.round(along, 3))
    assert across[2] < 6 * across[1] and across[2] < 0.03, across
    assert along[0] > 0.85 and along[2] > 10 * across[2], along


@pytest.mark.parametrize(("preset", "least"), [("fast", 0.85), ("balanced", 0.85)])
def test_areas_without_texture_are_reported_as_uncertain_as_they_are(preset, least):
    """Beneath a flat patch of 50 px flow bends: it is continued from the textured sites around, and the
    intervals say how far motion departs from that. Without this they hold the truth in an eighth to three
    fifths of the patch. A bend that nothing shows outside the patch cannot be known: fewer than 95 of 100
    intervals must hold."""
    y, x = np.indices((200, 200)).astype(float)

    def along(x):
        return 2 * np.sin(2 * np.pi * x / 120) * np.cos(2 * np.pi * y / 140)

    start = x
    for _ in range(30):
        start = x - along(start)
    distance = np.maximum(abs(x - 100), abs(y - 100))
    shares, wider = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        smooth = gaussian_filter(rng.standard_normal(x.shape), 1.5, mode="wrap")
        flat = gaussian_filter((distance < 25).astype(float), 1.0)
        first = 128 + 40 * smooth / smooth.std() * (1 - flat)
        second = map_coordinates(first, [y, start], order=3, mode="wrap")
        pair = [np.clip(np.rint(frame + rng.standard_normal(x.shape)), 0, 255).astype(np.uint8) for frame in (first, second)]
        field = jacoflow.flow(*pair, method=jacoflow.CoarseToFine(preset=preset))
        inside, outside = distance < 21, (distance > 40) & (distance < 80)
        shares.append(np.mean((abs(field.u - along(x)) < 1.96 * field.std("u"))[inside]))
        wider.append(np.median(field.std("u")[inside]) / np.median(field.std("u")[outside]))
    print(preset, np.round(shares, 2), np.round(wider, 1))
    assert np.mean(shares) > least and min(wider) > 1.5
