"""What trackers are measured on and with: drawn figures, paths, truth and scores (no rival is needed
here)."""


import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.rivals import trackers
from benchmarks.scenes import textures as pictures
from benchmarks.scenes import tracking as scenes
from benchmarks.scenes import tracking_hard as hard_scenes
from benchmarks.scores.tracking import Truth, overlap, scores
from benchmarks.tables import tracking_parts as tracking_flow


def drawn(figure, t=0):
    """Share of every pixel that the figure covers."""
    picture = np.zeros((scenes.SIZE, scenes.SIZE))
    figure.draw(picture, t)
    return picture


def still(x, y, side=13.0, degrees=0.0):
    """A square of level 1 that stands at a place."""
    return scenes.figure(np.array([[x, y]]), np.array([[side, side]]), 1.0, angles=np.array([np.deg2rad(degrees)]))


def test_a_figure_covers_its_area_about_its_centre():
    y, x = np.mgrid[: scenes.SIZE, : scenes.SIZE]
    disc = scenes.disc(np.array([[90.3, 70.8]]), np.array([9.5]), level=1.0)
    for figure, area, tolerance in (
        (still(100.0, 80.0), 169.0, 1e-12),
        (still(100.37, 80.81), 169.0, 2.5),
        (still(100.4, 80.3, degrees=33.0), 169.0, 1.0),
        (disc, np.pi * 9.5**2, 1.0),
    ):
        cover = drawn(figure)
        assert cover.sum() == pytest.approx(area, abs=tolerance) and cover.min() >= 0 and cover.max() == pytest.approx(1.0)
        centre = ((cover * x).sum() / cover.sum(), (cover * y).sum() / cover.sum())
        assert_allclose(centre, figure.centres[0], atol=0.07)


def test_a_square_at_whole_pixels_is_drawn_exactly():
    expected = np.zeros((scenes.SIZE, scenes.SIZE))
    expected[74:87, 94:107] = 1.0
    assert_array_equal(drawn(still(100.0, 80.0)), expected)


def test_a_square_turns_from_x_towards_y():
    """The right side goes down: the corner on the right of the lower side wanders to the left."""
    flat = scenes.figure(np.array([[100.0, 80.0]]), np.array([[21.0, 5.0]]), 1.0, angles=np.array([np.deg2rad(30.0)]))
    cover = drawn(flat)
    assert cover[84, 107] == 1.0 and cover[76, 107] == 0.0 and cover[76, 93] == 1.0


def test_figures_beyond_the_border_leave_what_is_inside():
    assert drawn(still(255.0, 128.0)).sum() == pytest.approx(13 * 7)
    assert drawn(still(300.0, 128.0)).sum() == 0.0 and drawn(still(-50.0, 128.0)).sum() == 0.0


def test_a_surface_turns_with_its_figure():
    """The picture of a quarter turn is the turned picture."""
    surface = pictures.texture(21, 110.0, 35.0, 2.0, 4)
    turned = [pictures.Figure(np.full((1, 2), 50.0), np.full((1, 2), 21.0), np.array([angle]), np.ones(1), surface=surface) for angle in (0.0, np.pi / 2)]
    plain, quarter = (drawn(figure)[30:71, 30:71] for figure in turned)
    assert_allclose(quarter, np.rot90(plain, -1), atol=0.5)
    assert plain[10:31, 10:31].std() > 20


@pytest.mark.parametrize(("kind", "mean", "deviation"), [("smooth:4,90,20", 90, 20), ("fractal:1,90,15", 90, 15), ("flat:90", 90, 0)])
def test_backgrounds_have_their_mean_and_deviation(kind, mean, deviation):
    picture = pictures.background(kind, 3)
    assert picture.shape == (256, 256) and picture.min() >= 0 and picture.max() <= 255
    assert picture.mean() == pytest.approx(mean, abs=0.1) and picture.std() == pytest.approx(deviation, abs=0.1)
    assert_array_equal(picture, pictures.background(kind, 3))


def test_backgrounds_of_other_kinds_are_refused():
    with pytest.raises(ValueError, match="kind: smooth, fractal or flat expected, 'plaid' given"):
        pictures.background("plaid:1,2,3", 0)


def test_pictures_move_right_and_down():
    picture = pictures.background("smooth:4,90,20", 1)
    moved = pictures.shifted(picture, 3.0, -2.0)
    assert_array_equal(moved[10, 20], picture[12, 17])
    assert_allclose(pictures.shifted(pictures.shifted(picture, 0.3, 0.6), 2.7, -2.6), moved, atol=0.05)


def test_paths():
    path = scenes.circle(24.0)
    assert_allclose(path[[0, 25, 50]], [[152, 128], [104, 128], [152, 128]], atol=1e-9)
    assert_allclose(np.linalg.norm(np.diff(path, axis=0), axis=1), 48 * np.sin(np.pi / 50))
    assert path[1, 1] > 128
    whole = scenes.circle(24.0, whole=True)
    assert_array_equal(whole, np.floor(whole)) and np.abs(whole - path).max() <= 0.5
    assert_allclose(scenes.line((1.0, 2.0), (2.4, 0.4))[50], (121.0, 22.0))


def test_simulations_turn_and_grow():
    turning, growing = (scenes.simulation(n, "flat:90", 16.0) for n in (2, 3))
    assert np.rad2deg(turning.angles[[1, 50]]) == pytest.approx([1.0, 50.0]) and (turning.scales == 1).all()
    assert growing.angles is None and growing.scales[50] == pytest.approx(17 / 7)
    assert_array_equal(growing.boxes[[0, 4, 5, 50], 2], [14.0, 14.0, 16.0, 34.0])
    assert_allclose(growing.boxes[:, :2] + growing.boxes[:, 2:] / 2, growing.centres)
    assert_array_equal(turning.boxes[:, 2:], 13.0)


def test_frames_hold_the_target_and_noise_and_are_the_same_each_time():
    scene = scenes.simulation(1, "flat:90", 16.0, whole=True)
    frames = scene.frames()
    assert frames.shape == (51, 256, 256) and frames.dtype == np.uint8
    assert_array_equal(frames, scene.frames())
    for t in (0, 17, 50):
        x, y = scene.centres[t].astype(int)
        assert frames[t, y - 6 : y + 7, x - 6 : x + 7].mean() == pytest.approx(200, abs=0.5)
    corner = frames[:, :60, :60].astype(float)
    assert corner.mean() == pytest.approx(90, abs=0.05) and corner.std() == pytest.approx(np.sqrt(4 + 1 / 12), abs=0.02)
    assert not np.array_equal(frames[0, :60, :60], frames[1, :60, :60])


def test_there_are_as_many_scenes_as_the_tables_say():
    for listed, count in (
        (scenes.simulations(), 24),
        (scenes.sequences(), 96),
        (scenes.published(), 7),
        (hard_scenes.table(), 15),
        (hard_scenes.further(), 13),
        (hard_scenes.hard(), 28),
        (hard_scenes.crossings(), 14),
        (hard_scenes.others_win(), 16),
    ):
        names = [scene.name for scene in listed]
        assert len(names) == count == len(set(names))


@pytest.mark.parametrize("scene", [*hard_scenes.hard(), *hard_scenes.others_win()], ids=lambda scene: scene.name)
def test_truth_of_the_hard_scenes_is_whole(scene):
    assert scene.centres.shape == (51, 2) and scene.boxes.shape == (51, 4) and np.isfinite(scene.boxes).all()
    assert not scene.scored[0] and scene.scored.sum() >= 30 and scene.scored[-1]
    assert np.linalg.norm(np.diff(scene.centres, axis=0), axis=1).max() < 10
    assert min(scene.start_box[2:]) >= 3


def test_what_makes_scenes_hard():
    by_name = {scene.name: scene for scene in [*hard_scenes.hard(), *hard_scenes.others_win()]}
    uniform = by_name["frames 25 to 27 uniform"].frames()
    assert (uniform[25:28] == 128).all() and uniform[24].std() > 20 < uniform[28].std()
    repeated = by_name["frames 15 and 35 repeat the one before"].frames()
    assert_array_equal(repeated[15], repeated[14])
    assert not np.array_equal(repeated[16], repeated[15])
    gain = by_name["frame gain 1 to 0.6"]
    assert gain.picture(50)[:60].mean() == pytest.approx(0.6 * gain.picture(0)[:60].mean())
    bar = by_name["behind a bar"]
    assert_array_equal(bar.picture(25)[:, 120:140], hard_scenes.BAR_LEVEL)
    assert (bar.picture(25)[:, [119, 140]] != hard_scenes.BAR_LEVEL).any(axis=0).all()
    pan = by_name["level 140, camera pans"]
    assert_array_equal(pan.picture(1)[1:60, :60], pan.picture(0)[:59, 3:63])
    growing = by_name["growing disc"].boxes[:, 2] / 2
    assert_array_equal(growing[[4, 5, 7, 50]], [7, 8, 9, 30])
    width = by_name["turns out of the plane, width to 40 %"]
    assert width.boxes[:, 2].min() == pytest.approx(0.4 * 13) and width.scales is None
    assert by_name["leaves the picture and returns"].scored.sum() < 50
    halves = [np.argmax([np.mean(a * np.roll(b, -v, axis=1)) for v in range(5)]) for a, b in _halves(by_name["two background planes, 1 and 3 px/frame"])]
    assert halves == [1, 3]


def _halves(scene):
    """The upper and the lower part of pictures 0 and 1, about their means."""
    first, second = scene.picture(0), scene.picture(1)
    return [(first[rows] - first.mean(), second[rows] - second.mean()) for rows in (slice(0, 90), slice(170, 256))]


def test_scores():
    assert_allclose(overlap(np.array([[0, 0, 4, 4.0]] * 3), np.array([[0, 0, 4, 4.0], [2, 0, 4, 4], [9, 9, 4, 4]])), [1, 1 / 3, 0])
    scene = scenes.simulation(2, "flat:90", 16.0)
    steps = np.diff(scene.centres, axis=0, prepend=np.nan)
    exact = trackers.Track(scene.boxes, steps, steps, scene.centres, scene.scales, scene.angles, milliseconds=2.0)
    best = scores(exact, Truth.of(scene))
    assert best.pop("milliseconds") == 2.0
    assert [best.pop(name) for name in ("on3", "success", "mean_overlap", "window_on3")] == pytest.approx([1.0] * 4)
    assert max(best.values()) < 1e-9 and len(best) == 7
    half = scene.boxes + np.where(np.arange(51) > 25, 8.0, 0.5)[:, None] * (1, 0, 0, 0)
    worse = scores(trackers.Track(half, steps + (0.3, 0.0)), Truth.of(scene))
    assert worse["on3"] == worse["success"] == 0.5 and worse["centre_error"] == pytest.approx(4.25)
    assert worse["displacement_error_x"] == pytest.approx(0.3) and worse["displacement_error_y"] == pytest.approx(0.0, abs=1e-9)
    assert "scale_error" not in worse and "velocity_error_x" not in worse


def test_boxes_go_to_opencv_and_back():
    """A square of 13 px about (148, 128) is pixels 142 to 154."""
    assert trackers.to_opencv((141.5, 121.5, 13.0, 13.0)) == (142, 122, 13, 13)
    assert trackers.to_opencv((141.5, 121.5, 13.0, 13.0), times=3) == (426, 366, 39, 39)
    for times in (1, 3):
        assert trackers.from_opencv(trackers.to_opencv((141.5, 121.5, 13.0, 13.0), times), times) == (141.5, 121.5, 13.0, 13.0)


def test_reference_masks_are_the_printed_ones():
    value, along_x, along_y = tracking_flow.reference_masks(4)
    rows = [[31, -44, 0, 44, -31], [-5, -62, 0, 62, 5], [-17, -68, 0, 68, 17], [-5, -62, 0, 62, 5], [31, -44, 0, 44, -31]]
    assert_allclose(along_x, np.array(rows) / 420, atol=1e-12)
    assert_allclose(along_y, along_x.T, atol=1e-12)
    assert_allclose(value[2], [0.078367, 0.200816, 0.441633, 0.200816, 0.078367], atol=1e-6)
    assert_allclose(tracking_flow.reference_masks(2)[1], np.tile(np.arange(-2, 3) / 50, (5, 1)), atol=1e-12)
