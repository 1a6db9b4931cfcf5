"""Quantities of regions: one motion, means, and rates that are those of the motion and not of its chord."""

import csv
import pickle
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

import jacoflow
from benchmarks.scenes.steps import CENTRE, SIZE, moved, texture, turn, waves

DISC = (*CENTRE, 45.0)
PICTURE = texture(0)


def turned(picture, angle):
    return moved(picture, turn(angle))


@pytest.mark.parametrize("degrees", [5.0, 10.0, 15.0])
def test_a_turn_has_its_own_rate(degrees):
    angle = np.radians(degrees)
    field = jacoflow.flow(*(turned(PICTURE, k * angle) for k in (-1, 0, 1)))
    assert_allclose(field.measure("angular_velocity", DISC).value, angle, rtol=1e-3)
    assert_allclose(field.region_mean("curl", DISC)[0], 2 * angle, rtol=1e-3)


def test_an_expansion_has_its_own_rate():
    views = [moved(PICTURE, np.eye(2) * 1.2**k) for k in (-1, 0, 1)]
    for field in (jacoflow.flow(*views[1:]), jacoflow.flow(*views)):
        assert_allclose(field.measure("divergence", DISC).value, 2 * np.log(1.2), rtol=1e-3)


@pytest.mark.parametrize("frames", [59.0, 9.0, 4.0])
def test_the_time_to_contact_counts_from_the_frame_of_the_field(frames):
    views = [moved(PICTURE, np.eye(2) * frames / (frames - k)) for k in (-1, 0, 1)]
    for field in (jacoflow.flow(*views[1:]), jacoflow.flow(*views)):
        found = field.measure("time_to_contact", DISC)
        assert abs(found.value - frames) < max(4 * found.std, 1e-3 * frames) and found.std < 0.1 * frames
        mean, std, _ = field.region_mean("time_to_contact", DISC)
        assert abs(mean - frames) < max(4 * std, 1e-3 * frames)


def test_ratios_are_formed_of_means():
    rng = np.random.default_rng(3)
    views = [moved(PICTURE, np.eye(2) * 30 / (30 - k)) for k in range(2)]
    field = jacoflow.flow(*(np.clip(np.rint(view + rng.normal(0, 12, view.shape)), 0, 255).astype(np.uint8) for view in views))
    found = field.measure("time_to_contact", DISC)
    for value, std in (field.region_mean("time_to_contact", DISC)[:2], (found.value, found.std)):
        assert abs(value - 30) < 3 * std and std < 15, (value, std)


def test_noise_adds_nothing_to_a_length():
    rng = np.random.default_rng(4)
    still = turned(PICTURE, 0.0)
    frames = [np.clip(np.rint(still + rng.normal(0, 15, still.shape)), 0, 255).astype(np.uint8) for _ in range(2)]
    field = jacoflow.flow(*frames)
    speeds = np.asarray(field.speed)[field.valid]
    value, std, _ = field.region_mean("speed", DISC)
    assert value < 3 * std and value < 0.3 * speeds.mean(), (value, std, speeds.mean())


RPM, FPS, RADIUS = 300.0, 250.0, 40.0


def fan():
    """Eight-bit frames of a textured disc of 300 rpm before a textured wall."""
    step, wall = RPM * 2 * np.pi / 60 / FPS, turned(texture(5), 0.0)
    y, x = np.mgrid[:SIZE, :SIZE]
    inside = np.hypot(x - CENTRE[0], y - CENTRE[1]) < RADIUS
    rng = np.random.default_rng(6)
    for k in range(3):
        frame = np.where(inside, turned(PICTURE, k * step), wall) + rng.normal(0, 1, wall.shape)
        yield np.clip(np.rint(frame), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def fan_field():
    return jacoflow.flow(*fan(), fps=FPS)


@pytest.mark.parametrize(
    ("region", "at"),
    [
        ((40, 40, 81, 81), None),  # A box round the fan, a fifth of it wall.
        ((60, 60, 40, 40), None),
        ((*CENTRE, 20.0), None),
        ((70, 60, 65, 40), None),  # Half of the fan and its hub, a quarter of the region wall.
        ([(50, 50), (110, 50), (110, 110), (50, 110)], None),
        (None, CENTRE),  # The whole frame, a tenth of it fan.
    ],
)
def test_a_fan_before_a_wall_has_its_speed(fan_field, region, at):
    found = fan_field.measure("rpm", region, at=at)
    assert found.status == "ok" and found.unit == "rpm"
    assert_allclose(found.value, RPM, rtol=0.01)
    assert abs(found.value - RPM) < 4 * found.std
    centre = [fan_field.measure(f"rotation_centre_{axis}", region, at=at).value for axis in "xy"]
    assert_allclose(centre, CENTRE, atol=0.3)


def test_the_rest_of_the_frame_stands_still(fan_field):
    for at in (None, (5, 5)):
        found = fan_field.measure("rpm", at=at)
        assert found.status == "ok" and abs(found.value) < 1 and found.share > 0.6


def test_without_a_dominant_motion_there_is_no_value():
    flow = np.zeros((30, 60, 2))
    flow[:, 20:40, 0], flow[:, 40:, 1] = 5.0, 5.0
    field = jacoflow.FlowField.from_arrays(flow, np.broadcast_to(1e-4 * np.eye(2), (30, 60, 2, 2)))
    found = field.measure("u")
    assert found.status == "no_dominant_motion" and np.isnan(found.value) and np.isnan(found.std)
    assert_allclose(found.share, 1 / 3)
    assert_allclose([field.measure("u", at=(x, 15)).value for x in (10, 30, 50)], [0, 5, 0], atol=1e-6)


def test_where_the_frames_contradict_most_estimates_nothing_is_said():
    # 64 px are beyond what is searched for in a frame of this size.
    wide = np.kron(np.random.default_rng(0).integers(0, 255, (50, 100)), np.ones((2, 2))).astype(np.uint8)
    field = jacoflow.flow(wide[:, 64:], wide[:, :-64])
    assert not field.valid.any() and (np.abs(field.u - 64) > 10).all()
    assert np.isnan(field.region_mean("u")[0]) and field.measure("u").status == "too_few_sites"


@pytest.mark.parametrize("seed", range(3))
def test_texture_as_fine_as_a_pixel_is_not_followed_where_it_is_not_found(seed):
    random = np.random.default_rng(seed)
    wide = random.integers(0, 255, (SIZE, 3 * SIZE)).astype(np.uint8)
    far = [wide[:, 64 * k : 64 * k + SIZE] for k in (2, 1, 0)]
    others = [random.integers(0, 255, (SIZE, SIZE)).astype(np.uint8) for _ in range(3)]
    for frames in (far[:2], far, others[:2], others):
        field = jacoflow.flow(*frames)
        assert field.valid.mean() < 0.02 and field.measure("u").status == "too_few_sites"
    near = [wide[:, 3 * k : 3 * k + SIZE] for k in (2, 1, 0)]
    for frames in (near[:2], near):
        field = jacoflow.flow(*frames)
        assert field.valid.mean() > 0.95 and abs(field.measure("u").value - 3) < 0.01


def test_noise_as_strong_as_the_texture_does_not_make_frames_unrelated():
    random, still = np.random.default_rng(1), texture(1)
    frames = [moved(still, np.eye(2), (2.0 * k, 0.0)) for k in range(3)]
    frames = [frame + random.normal(0, frame.std(), frame.shape) for frame in frames]
    for some in (frames[:2], frames):
        field = jacoflow.flow(*some)
        measured = field.measure("u")
        assert field.valid.mean() > 0.7 and abs(measured.value - 2) < 3 * measured.std


@pytest.mark.parametrize("dtype", ["uint8", "float32", "float64"])
def test_a_blank_wall_beside_moving_texture_is_not_sure_of_its_motion(dtype):
    for seed in range(4):
        first, second = (moved(texture(seed), np.eye(2), (4.0 * k, 0.0)) for k in range(2))
        for frame in (first, second):
            frame[:, 90:] = 25.0
        frames = [np.rint(frame).astype(np.uint8) if dtype == "uint8" else (frame / 255).astype(dtype) for frame in (first, second)]
        found = jacoflow.flow(*frames).measure("u", region=(110, 40, 40, 80))
        assert not abs(found.value) > 4 * found.std, (seed, found)


def test_what_the_frames_contradict_does_not_make_the_rest_dominant():
    # Still, moving, and unrelated: the still part is most of what is valid, and not most of the region.
    columns = np.arange(SIZE)
    still, gone = (moved(waves(1), np.eye(2), (shift, 0.0)) for shift in (0.0, 3.0))
    after = np.where(columns < 60, still, np.where(columns < 90, gone, moved(waves(2), np.eye(2))))
    field = jacoflow.flow(*(np.clip(np.rint(frame), 0, 255).astype(np.uint8) for frame in (still, after)))
    found = field.measure("u", (0, 0, 140, 160))
    assert found.status == "no_dominant_motion" and np.isnan(found.value), found
    assert found.share > 0.6 and found.share * found.valid_share < 1 - found.valid_share, found
    assert abs(field.measure("u", (0, 0, 60, 160)).value) < 0.05


def test_regions_of_every_kind_agree(fan_field):
    y, x = np.mgrid[:SIZE, :SIZE]
    mask = (x >= 60) & (x < 100) & (y >= 60) & (y < 100)
    corners = np.array([(59.5, 59.5), (99.5, 59.5), (99.5, 99.5), (59.5, 99.5)])
    for name in ("rpm", "u", "speed"):
        rectangle = fan_field.region_mean(name, (60, 60, 40, 40))
        assert fan_field.region_mean(name, mask) == rectangle
        assert fan_field.region_mean(name, corners) == rectangle
        assert fan_field.measure(name, mask).value == fan_field.measure(name, corners).value


@pytest.mark.parametrize(
    ("region", "words"),
    [
        ("all", "a string"),
        ((1, 2), "shape (2,)"),
        ((0, 0, 10.5, 10), "whole px"),
        ((-1, 0, 10, 10), "none negative"),
        ((150, 0, 20, 10), "rectangle inside"),
        ((10, 10, -3), "positive radius"),
        ([(0, 0), (5, 5)], "3 corners"),
        (np.ones((3, 4), bool), "(160, 160)"),
        (np.zeros((2, 2, 2)), "shape (2, 2, 2)"),
    ],
)
def test_wrong_regions_are_named(fan_field, region, words):
    for call in (fan_field.region_mean, fan_field.measure):
        with pytest.raises(ValueError, match="^region: ") as error:
            call("curl", region)
        assert words in str(error.value)


def test_a_stack_is_measured_at_every_time():
    frames = np.stack(list(fan()))
    found = jacoflow.estimate(frames, fps=FPS).measure("rpm", DISC[:2] + (25.0,))
    assert found.value.shape == (3,) and found.status[:2] == ["ok", "ok"]
    assert_allclose(found.value[:2], RPM, rtol=0.01)
    assert found.status[2] == "too_few_sites" and np.isnan(found.value[2])
    assert found.motion.shape == (3, 6) and found.covariance.shape == (3, 6, 6) and found.centre.shape == (3, 2)
    assert "3 fields, 2 ok" in repr(found)


def test_pixels_outside_the_frame_are_named(fan_field):
    with pytest.raises(ValueError, match="^at: expected a pixel"):
        fan_field.measure("rpm", at=(-1, 3))


@pytest.mark.parametrize(
    ("name", "meant"), [("vorticity", "curl"), ("div", "divergence"), ("ttc", "time_to_contact"), ("Speeed", "speed"), ("curll", "curl"), ("rotation_center_x", "rotation_centre_x")]
)
def test_names_of_other_conventions_are_understood(fan_field, name, meant):
    for call in (fan_field.std, fan_field.value, fan_field.unit, fan_field.region_mean, fan_field.measure):
        with pytest.raises(ValueError, match=f'did you mean "{meant}"'):
            call(name)


@pytest.mark.parametrize("region", [(20, 20, 60, 40), (60, 45, 80, 70)])
def test_a_mean_stands_at_the_centre_of_its_region(region):
    # Variances differ over the picture: the weighted mean of the places is not their centre.
    scene = jacoflow.scenes.Scene("affine", width=200, height=160, u=0.0, v=0.0, u_x=0.0, v_y=0.0, v_x=0.03, u_y=-0.03, random_state=1)
    field, truth = jacoflow.flow(*scene.frames(2)), scene.truth(0.0, between=(0.0, 1.0))
    x, y, width, height = region
    inside = (slice(y, y + height), slice(x, x + width))
    for name in "uv":
        value, std, _ = field.region_mean(name, region)
        assert abs(value - getattr(truth, name)[inside].mean()) < 3 * std + 1e-3 and std < 0.05
    middle = truth.flow[inside].mean(axis=(0, 1))
    assert_allclose(field.region_mean("speed", region)[0], np.hypot(*middle), atol=5e-3)
    distance = np.linalg.norm(np.linalg.solve(truth.jacobian[y, x], middle))
    assert_allclose(field.region_mean("centre_distance", region)[0], distance, atol=0.3)


def test_a_mean_without_slopes_stands_at_the_centre_of_its_region():
    """A weighted mean of the flow alone is the flow where the weights are large."""
    x, y = np.meshgrid(np.arange(100), np.arange(60))
    flow = np.stack([0.01 * (x - 49.5) + 1.0, 0.005 * (y - 29.5)], axis=-1)
    covariance = np.where(x < 50, 1e-6, 1.0)[..., np.newaxis, np.newaxis] * np.eye(2)
    field = jacoflow.FlowField.from_arrays(flow, covariance)
    value, std, count = field.region_mean("u")
    assert count == 6000
    assert_allclose(value, 1.0, atol=1e-6)
    assert std < 0.01
    assert_allclose(field.region_mean("u", (50, 0, 50, 60))[0], 1.25, atol=1e-6)


@pytest.mark.parametrize("difference", [0.15, 0.2, 0.25, 0.3])
@pytest.mark.parametrize("axis", [0, 1])
def test_motions_that_are_not_separated_are_not_sure(difference, axis):
    # Two halves, both texture, one of which moves by a fraction of a pixel; a tilted motion lies between.
    x = np.arange(SIZE) - CENTRE[axis]
    still, shifted = turned(PICTURE, 0.0), moved(PICTURE, np.eye(2), shift=(difference, 0.0))
    side = (x > 0)[None, :] if axis == 0 else (x > 0)[:, None]
    rng = np.random.default_rng(7)
    frames = [np.clip(np.rint(view + rng.normal(0, 1, view.shape)), 0, 255).astype(np.uint8) for view in (still, np.where(side, shifted, still))]
    found = jacoflow.flow(*frames).measure("u", (40, 40, 81, 81))
    slope, std = found.motion[2 + 2 * axis], np.sqrt(found.covariance[2 + 2 * axis, 2 + 2 * axis])
    nearest = min(abs(found.value), abs(found.value - difference))
    assert nearest < 4 * found.std and abs(slope) < 4 * std, (found, slope, std)


def test_the_motion_around_a_pixel_is_that_at_the_pixel():
    # A stripe of 30 px that moves before a wall that stands still.
    x = np.arange(SIZE)[None, :]
    stripe, wall = moved(PICTURE, np.eye(2), shift=(0.6, 0.0)), turned(PICTURE, 0.0)
    rng = np.random.default_rng(3)
    frames = [np.clip(np.rint(view + rng.normal(0, 2, view.shape)), 0, 255).astype(np.uint8) for view in (wall, np.where(np.abs(x - 80) < 15, stripe, wall))]
    field = jacoflow.flow(*frames)
    for at, truth in (((110, 110), 0.0), ((80, 80), 0.6)):
        found = field.measure("u", (45, 45, 71, 71), at=at)
        assert tuple(found.centre) == at
        assert found.status != "ok" or abs(found.value - truth) < 4 * found.std + 0.05, (at, found)


def test_small_objects_are_not_slowed_by_what_lies_beside_them():
    """Windows of slopes reach beyond a disc of 20 px; the flow across it does not."""
    y, x = np.mgrid[:SIZE, :SIZE]
    disc, wall = np.hypot(x - CENTRE[0], y - CENTRE[1]) < 20, turned(texture(5), 0.0)
    frames = [np.clip(np.rint(np.where(disc, turned(PICTURE, k * 0.06), wall)), 0, 255).astype(np.uint8) for k in range(2)]
    found = jacoflow.flow(*frames).measure("angular_velocity", (*CENTRE, 17.0))
    assert found.status == "ok"
    assert_allclose(found.value, 0.06, rtol=0.05)
    assert abs(found.value - 0.06) < 2 * found.std


def test_a_mean_of_what_affine_motion_does_not_have():
    scene = jacoflow.scenes.Scene("affine", width=80, height=60, u=0.5, v=0.2, random_state=1)
    field = jacoflow.flow(*scene.frames(3), method=jacoflow.Instantaneous(model="accelerating", neighbourhood=(9, 9)))
    for aggregate in ("inverse_variance", "median"):
        value, std, count = field.region_mean("u_t", (10, 10, 40, 40), aggregate)
        assert abs(value) < 4 * std and 0 < std < 0.1 and count > 1000
    with pytest.raises(ValueError, match="^name: "):
        field.measure("u_t")


def test_a_measurement_comes_back_out_of_a_pickle(fan_field):
    stack = jacoflow.estimate(list(fan()), fps=FPS)
    for found in (fan_field.measure("rpm", DISC), stack.measure("curl", DISC, at=CENTRE)):
        again = pickle.loads(pickle.dumps(found))
        assert repr(again) == repr(found) and (again.quantity, again.unit, again.status) == (found.quantity, found.unit, found.status)
        for name in ("value", "std", "share", "valid_share", "count", "motion", "covariance", "centre"):
            np.testing.assert_array_equal(getattr(again, name), getattr(found, name))


@pytest.mark.parametrize("region", [np.zeros((SIZE, SIZE), bool), [(1, 1), (9, 9), (20, 20)], [(300, 300), (310, 300), (310, 310)], (300.0, 300.0, 5.0)])
def test_a_region_without_a_pixel_is_refused(fan_field, region):
    for call in (fan_field.region_mean, fan_field.measure):
        with pytest.raises(ValueError, match="^region: expected one that holds at least one site"):
            call("curl", region)


@pytest.mark.parametrize("at", [[80.0, 80.0], np.array(CENTRE), (np.float32(80), 80)])
def test_the_pixel_may_be_any_pair(fan_field, at):
    assert fan_field.measure("rpm", at=at).status == "ok"


@pytest.mark.parametrize("at", ["x", (1, 2, 3), 5.0, [[1, 2]], ("a", 2)])
def test_what_is_no_pixel_is_named(fan_field, at):
    with pytest.raises((TypeError, ValueError), match="^at: expected"):
        fan_field.measure("rpm", at=at)


def in_the_binary(tmp_path, frames, quantity, *options):
    """Value and standard deviation in the first row of `jacoflow measure` over the disc."""
    jacoflow.io.write_frames(tmp_path / "frames.npy", np.array(frames))
    disc = ",".join(map(str, DISC))
    command = [sys.executable, "-m", "jacoflow", "measure", str(tmp_path / "frames.npy"), "--quantity", quantity, "--disc", disc, *options]
    rows = csv.DictReader(subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines())
    row = next(rows)
    assert row["status"] == "ok"
    return float(row["value"]), float(row["std"])


def test_the_binary_has_the_rates_of_the_motion(tmp_path):
    angle = np.radians(15)
    views = [turned(PICTURE, k * angle) for k in (-1, 0, 1)]
    assert_allclose(in_the_binary(tmp_path, views, "angular_velocity")[0], angle, rtol=1e-3)
    views = [moved(PICTURE, np.eye(2)), moved(PICTURE, 1.2 * np.eye(2))]
    assert_allclose(in_the_binary(tmp_path, views, "divergence")[0], 2 * np.log(1.2), rtol=1e-3)


@pytest.mark.parametrize("frames", [59.0, 9.0, 4.0])
def test_the_binary_counts_the_time_to_contact_from_the_frame_of_the_field(frames, tmp_path):
    views = [moved(PICTURE, np.eye(2) * frames / (frames - k)) for k in (-1, 0, 1)]
    for used, options in ((views, ()), (views, ("--fps", "20")), (views[1:], ())):
        period = 1 / 20 if options else 1
        value, std = in_the_binary(tmp_path, used, "time_to_contact", *options)
        assert abs(value - frames * period) < max(4 * std, 1e-3 * frames * period) and std < 0.1 * frames * period


def test_the_binary_measures_the_parameters_too(tmp_path):
    frames = jacoflow.scenes.Scene("affine", width=96, height=64).frames(3)
    jacoflow.io.write_frames(tmp_path / "frames.npy", frames)
    names = ["u", "v", "u_x", "v_x", "u_y", "v_y", "divergence"]
    place = ("--disc", "48,32,20", "--at", "50,30")
    command = [sys.executable, "-m", "jacoflow", "measure", str(tmp_path / "frames.npy"), "--quantity", ",".join(names), *place]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = list(csv.DictReader(done.stdout.splitlines()))
    field = jacoflow.flow(*frames)
    assert [row["quantity"] for row in rows] == names
    for row in rows:
        found = field.measure(row["quantity"], (48.0, 32.0, 20.0), at=(50, 30))
        np.testing.assert_allclose([float(row["value"]), float(row["std"])], [found.value, found.std], rtol=1e-9)
        assert (row["unit"], row["status"]) == (found.unit, "ok")
    refused = subprocess.run([*command[:6], "foo"], capture_output=True, text=True, check=False)
    assert refused.returncode == 2 and "quantity: expected one of u, v, u_x" in refused.stderr


@pytest.mark.parametrize(
    ("quantity", "step", "expected"),
    [
        ("angular_velocity", turn(np.radians(15)), np.radians(15)),
        ("divergence", 1.2 * np.eye(2), 2 * np.log(1.2)),
        *(("time_to_contact", frames, frames) for frames in (59.0, 9.0, 4.0)),
    ],
)
def test_the_binary_has_the_rates_of_large_steps(quantity, step, expected, tmp_path):
    """To a thousandth, or within what is stated: of pairs and of three frames."""
    powers = [np.linalg.matrix_power(step, k) if np.ndim(step) else np.eye(2) * step / (step - k) for k in (-1, 0, 1)]
    np.save(tmp_path / "frames.npy", [moved(PICTURE, power) for power in powers])
    command = [sys.executable, "-m", "jacoflow", "measure", str(tmp_path / "frames.npy"), "--quantity", quantity, "--disc", "80,80,45"]
    for more in ([], ["--time-scheme", "pair", "--start", "1"]):
        done = subprocess.run([*command, *more], capture_output=True, text=True, check=True)
        (row,) = csv.DictReader(done.stdout.splitlines())
        error = abs(float(row["value"]) - expected)
        allowed = 1e-3 * expected if np.ndim(step) else max(4 * float(row["std"]), 1e-3 * expected)
        assert row["status"] == "ok" and error < allowed and float(row["std"]) < 0.1 * expected, row
