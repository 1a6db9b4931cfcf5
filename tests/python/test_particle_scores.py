"""What the particle tracker's tables measure with: success, overlap, multiple object tracking, recordings."""


import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.rivals import particle as particle_rivals
from benchmarks.rivals.particle import Contestant, Sequence
from benchmarks.scenes import particle_recordings
from benchmarks.scores import particle as particle_scores
from benchmarks.tables import particle_tracking


def walk(frames=50, step=2.0):
    """Boxes (T, 2, 4) of two targets that walk to the right, one above the other."""
    t = np.arange(frames)
    row = np.stack([10 + step * t, np.full(frames, 20.0), np.full(frames, 12.0), np.full(frames, 30.0)], axis=-1)
    return np.stack([row, row + (0, 60, 0, 0)], axis=1)


def moved(boxes, x, y=0.0):
    return boxes + (x, y, 0, 0)


def test_success_needs_the_centre_and_the_end():
    truth = walk()
    perfect = particle_scores.success(truth, truth)
    assert perfect == [{"success": 1.0, "overlap": 1.0, "centre_error": 0.0}] * 2
    # Half a width off: the centre is on the side, the overlap a third.
    aside = particle_scores.success(moved(truth, 6.0), truth)[0]
    assert aside["success"] == 1.0 and aside["overlap"] == pytest.approx(1 / 3) and aside["centre_error"] == pytest.approx(6.0)
    assert particle_scores.success(moved(truth, 6.5), truth)[0]["success"] == 0.0
    for lost, wanted in ((10, 1.0), (11, 0.0)):
        boxes = truth.copy()
        boxes[:lost] = moved(truth[:lost], 100.0)
        assert particle_scores.success(boxes, truth)[1]["success"] == wanted
    late = truth.copy()
    # Eight of the last ten frames are missed, which the centre's share would still allow.
    late[-8:] = moved(truth[-8:], 100.0)
    assert particle_scores.success(late, truth)[0]["success"] == 0.0


def test_a_box_that_is_not_reported_stands():
    truth = walk(20)
    boxes = truth.copy()
    boxes[8:] = np.nan
    figures = particle_scores.success(boxes, truth)[0]
    assert figures["success"] == 0.0 and figures["centre_error"] == pytest.approx(2.0 * np.arange(1, 13).sum() / 20)


def test_multiple_object_measures_are_those_counted_by_hand():
    pytest.importorskip("motmetrics")
    truth = walk(10)
    truth[6:, 1] = np.nan
    boxes = walk(10)
    swapped = boxes.copy()
    # From frame 4 on both tracks follow the other's target; the second one goes on after its truth has ended.
    swapped[4:] = boxes[4:, ::-1]
    figures = particle_scores.multiple_object(swapped, truth)
    # 16 true boxes, all found; track 0 is on the target without truth in frames 6 to 9.
    assert figures["switches"] == 2 and figures["false"] == 4 and figures["missed"] == 0
    assert figures["MOTA"] == pytest.approx(1 - 6 / 16)
    straight = particle_scores.multiple_object(boxes, truth)
    assert straight["MOTA"] == pytest.approx(1 - 4 / 16) and straight["IDF1"] == pytest.approx(2 * 16 / (16 + 20))
    ended = particle_scores.multiple_object(particle_scores.ended_at_truth(boxes, truth), truth)
    assert ended["MOTA"] == 1.0 and ended["IDF1"] == 1.0
    # An overlap below one half is a false box and a missed one.
    off = particle_scores.multiple_object(moved(boxes, 4.5), truth)
    assert off["false"] == 20 and off["missed"] == 16 and off["MOTA"] == pytest.approx(-20 / 16)
    empty = particle_scores.multiple_object(np.full_like(boxes, np.nan), truth)
    assert empty["missed"] == 16 and empty["MOTA"] == 0.0


def test_overlaps_count_missing_boxes_but_not_missing_truth():
    truth, boxes = walk(4), walk(4)
    truth[3, 0], boxes[1, 1] = np.nan, np.nan
    shares = particle_scores.overlaps(boxes, truth)
    assert_array_equal(np.isnan(shares), [[False, False], [False, False], [False, False], [True, False]])
    assert_allclose(shares[1], [1, 0])


def test_targets_start_at_their_first_true_box():
    truth = walk(6)
    truth[:3, 1] = np.nan
    sequence = Sequence("walk", np.zeros((6, 120, 80, 3), np.uint8), truth)
    assert_array_equal(sequence.starts, [0, 3])
    assert sequence.contains(np.array([-5.0, 0.0, 9.0, 4.0])) and not sequence.contains(np.array([-5.0, 0.0, 8.9, 4.0]))
    assert sequence.contains(np.array([75.0, 0.0, 9.0, 4.0])) and not sequence.contains(np.array([75.1, 0.0, 9.0, 4.0]))


def test_halving_keeps_the_picture_s_edge():
    boxes = np.array([[[-0.5, -0.5, 8.0, 6.0]]])
    frame = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(1, 6, 8, 3)
    half = particle_recordings.halved(Sequence("one", frame, boxes))
    assert half.frames.shape == (1, 3, 4, 3)
    assert_allclose(half.boxes, [[[-0.5, -0.5, 4.0, 3.0]]])
    assert_allclose(half.frames[0, 1, 2], frame[0, 2:4, 4:6].reshape(4, 3).mean(axis=0), atol=0.51)


def test_the_table_of_a_perfect_tracker_is_perfect():
    truth = Contestant("truth", lambda sequence, seed: sequence.boxes)
    first = Contestant("first box", lambda sequence, seed: np.broadcast_to(sequence.boxes[0], sequence.boxes.shape), random=True)
    perfect, still = particle_tracking.comparison(["cars_handheld"], [truth, first], recordings=[1], runs=2)
    assert perfect["cars_handheld"] == "100 / 1.00 / 0.0" and perfect["n"] == "2" and perfect["mean overlap"] == 1.0
    assert still["mean success, %"] == 0.0 and still["n"] == "4"


def test_opencv_follows_a_car_from_a_box_that_is_partly_outside():
    pytest.importorskip("cv2")
    sequence = particle_tracking.scene("people_static", 3)
    short = Sequence("short", sequence.frames[:5], sequence.boxes[:5, :1].copy())
    short.boxes[0, 0] = (-6.0, 40.0, 30.0, 70.0)
    for rival in particle_rivals.rivals():
        boxes = rival.follow(short, 0)
        assert boxes.shape == (5, 1, 4)
        assert_allclose(boxes[0, 0], short.boxes[0, 0])


def test_opencv_ends_when_the_centre_leaves_the_picture():
    pytest.importorskip("cv2")
    textured = np.random.default_rng(0).integers(0, 255, (120, 300, 3), dtype=np.uint8)
    frames = np.stack([textured[:, 150 - 6 * t : 290 - 6 * t] for t in range(25)])
    start = np.array([80.0, 30.0, 40.0, 50.0])
    truth = np.stack([start + (6.0 * t, 0, 0, 0) for t in range(25)])[:, None]
    sequence = Sequence("leaving", frames, truth)
    kcf = next(rival for rival in particle_rivals.rivals(("MedianFlow", "KCF")))
    boxes = kcf.follow(sequence, 0)[:, 0]
    assert np.isfinite(boxes[:5]).all() and np.isnan(boxes[10:]).all()
