"""The stereo tracker: a sequence whose answer is known, edge cases, the graph there and back."""

import io
import json
import pickle

import numpy as np
import pytest

from benchmarks.scenes.stereo import curved, small
from benchmarks.scores.stereo_tracking import Truth
from jacoflow import video
from jacoflow.track import StereoCamera, StereoTracker, TrackGraph

SMALL = {"disparity_range": (-8, 8), "grid": (30, 40, None), "row_offset": 0.0}


def cells(seed=1, rows=15, columns=26):
    """Blocks of 8 px, each of one grey level, a little blurred."""
    blocks = np.random.default_rng(seed).integers(10, 240, (rows, columns)).repeat(8, 0).repeat(8, 1).astype(float)
    return (blocks + np.roll(blocks, 1, 0) + np.roll(blocks, 1, 1) + np.roll(blocks, (1, 1), (0, 1))) / 4


def sequence(steps=5):
    """A wall that moves 2 px/step to the right at disparity -4, before it a board that moves 3 px/step to the
    left at disparity 5: left and right views."""
    wall, board = cells(), cells(2)[:48, :56]
    for t in range(steps):
        left, right = (wall[:, 24 - 2 * t + shift : 184 - 2 * t + shift].copy() for shift in (0, -4))
        x = 80 - 3 * t
        left[36:84, x : x + 56] = board
        right[36:84, x - 5 : x + 51] = board
        yield np.rint(left).astype(np.uint8), np.rint(right).astype(np.uint8)


def followed(mode="improved", **options):
    """A tracker after the sequence, and its last step."""
    tracker = StereoTracker(mode, n_components=6, **{**SMALL, **options})
    for left, right in sequence():
        step = tracker.update(left, right)
    return tracker, step


def biggest(step, disparity):
    """The largest cluster near a disparity."""
    return max((c for c in step.clusters if abs(c.mean[2] - disparity) < 1.5), key=lambda c: c.n_pixels)


def test_two_objects_that_move_are_two_tracks_with_their_motions():
    tracker, step = followed()
    wall, board = biggest(step, -4), biggest(step, 5)
    assert np.allclose(wall.velocity, [2, 0, 0], atol=0.1)
    assert np.allclose(board.velocity, [-3, 0, 0], atol=0.1)
    assert np.allclose(board.affine[:2], [-3, 0], atol=0.1)
    assert np.isnan(board.next_velocity).all()
    assert wall.group != board.group and wall.track_id != board.track_id
    assert tracker.tracks[board.track_id].times.tolist() == [0, 1, 2, 3, 4]
    assert np.isnan(tracker.tracks[board.track_id].velocities[0]).all()


def test_what_grows_is_measured_as_far_as_its_rim():
    """A tenth a step: 120 px from the middle that is 12 px, which no translation explains."""
    from scipy.ndimage import gaussian_filter, map_coordinates

    for seed in range(3):
        texture = gaussian_filter(np.random.default_rng(seed).uniform(0, 255, (60, 80)).repeat(8, 0).repeat(8, 1), 2.0)
        rows, columns = np.mgrid[:240, :320]
        tracker = StereoTracker(n_components=1, disparity_range=(-8, 8))
        for scale in (1.0, 1.1, 1.21):
            left = map_coordinates(texture, [240 + (rows - 120) / scale, 320 + (columns - 160) / scale], order=1).astype(np.float32)
            step = tracker.update_disparity(left, np.where(np.hypot(*np.gradient(left)) > 8, 2.0, np.nan))
        (cluster,) = step.clusters
        np.testing.assert_allclose(cluster.affine[2:], [0.1, 0.0, 0.0, 0.1], atol=0.005)


def test_every_edge_pixel_has_its_cluster():
    _, step = followed()
    assert len(step.rows) == len(step.cols) == len(step.values) == len(step.cluster_of_pixel) > 500
    counts = np.bincount(step.cluster_of_pixel, minlength=6)
    assert {c.index: c.n_pixels for c in step.clusters} == {k: n for k, n in enumerate(counts) if n}
    near = step.cluster_of_pixel == biggest(step, 5).index
    assert np.abs(step.values[near] - 5).max() < 3


def biggest_at(tracker, t):
    """The largest cluster of a step."""
    return max((node for (at, _), node in tracker.graph.nodes.items() if at == t), key=lambda node: node.n_pixels)


def shown_at(moments, mode="improved", speed=2.0, told=True, **options):
    """A tracker after a wall that moves so many px for each unit of time, at these moments."""
    wall, tracker = cells(columns=60), StereoTracker(mode, n_components=4, **{**SMALL, **options})
    for last, now in zip([None, *moments], moments):
        x = 300 - round(speed * now)
        left, right = (np.rint(wall[:, x + shift : x + shift + 160]).astype(np.uint8) for shift in (0, -4))
        step = tracker.update(left, right, dt=now - last if told and last is not None else None)
    return tracker, step


def test_velocities_are_for_the_unit_of_time():
    uneven = [0, 1, 2, 4, 5, 9]
    tracker, step = shown_at(uneven)
    assert step.time == 5 and step.clock == 9.0
    wall = biggest(step, -4)
    track = tracker.tracks[wall.track_id]
    assert track.times.tolist() == [0, 1, 2, 3, 4, 5] and track.clock.tolist() == uneven
    np.testing.assert_allclose(track.velocities[1:], [[2, 0, 0]] * 5, atol=0.05)
    for node in tracker.graph.nodes.values():
        np.testing.assert_array_equal(node.velocity[:2], node.affine[:2])
    blind, _ = shown_at(uneven, told=False)
    assert np.allclose(blind.tracks[wall.track_id].velocities[5], [8, 0, 0], atol=0.1)
    # In seconds at 25 a second, one frame missing: the limits are still those of frames.
    seconds, step = shown_at([0.0, 0.04, 0.08, 0.16, 0.2], speed=50, step_time=0.04)
    assert step.clock == pytest.approx(0.2)
    for key, node in shown_at([0, 1, 2, 4, 5])[0].graph.nodes.items():
        same = seconds.graph.nodes[key]
        assert (same.track_id, same.n_pixels, same.coasting) == (node.track_id, node.n_pixels, node.coasting)
        np.testing.assert_allclose(same.velocity, node.velocity / 0.04, rtol=1e-6, atol=1e-6)
    on_paper, _ = shown_at([0, 4, 8, 16], "paper", speed=2.0)
    velocities = [biggest_at(on_paper, t).velocity[0] for t in (1, 2, 3)]
    assert np.allclose(velocities, 2, atol=0.01)


def test_a_time_of_one_is_no_time_and_others_are_refused():
    plain, _ = shown_at([0, 1, 2], told=False)
    assert shown_at([0, 1, 2])[0].graph == plain.graph == shown_at([0, 2, 4], speed=1.0, told=False)[0].graph
    left, right = next(sequence())
    tracker = StereoTracker(n_components=4, **SMALL)
    for wrong in (0, -1.0, 5e-324, 1e300, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="dt: "):
            tracker.update(left, right, dt=wrong)
        with pytest.raises(ValueError, match="step_time: "):
            StereoTracker(step_time=wrong)
    with pytest.raises(TypeError, match="dt: "):
        tracker.update(left, right, dt="soon")
    assert tracker.update(left, right, dt=7).clock == 0.0


def test_who_comes_nearer_is_followed_over_missing_frames():
    """The cab of the curved scene, three of ten frames missing: its way over a gap is foreseen."""
    scene = curved()
    sequence, kept = scene.sequence(), [0, 1, 2, 4, 5, 8, 9]
    tracker = StereoTracker()
    for last, now in zip([None, *kept], kept):
        step = tracker.update(sequence[now].left, sequence[now].right, dt=None if last is None else now - last)
    graph = tracker.graph
    truths = [Truth(sequence[now].label, sequence[now].motion) for now in kept]
    assert step.clock == 9.0
    for t, truth in enumerate(truths[:-1]):
        cab = max((node for (at, _), node in graph.nodes.items() if at == t and truth.label[tuple(np.rint(node.middle[::-1]).astype(int))] == 1), key=lambda node: node.n_pixels)
        x, y = np.rint(cab.middle).astype(int)
        np.testing.assert_allclose(cab.next_velocity, truth.motion[y, x], atol=0.2)


def test_the_papers_mode_moves_by_whole_cells():
    tracker, step = followed("paper")
    board = biggest(step, 5)
    assert (np.mod(board.velocity[:2], 4) == 0).all() and np.isnan(board.affine).all()
    assert not any(cluster.coasting for cluster in step.clusters)
    assert len(tracker.graph.nodes) > 5


def test_tracks_of_the_graph_reach_from_end_to_end():
    tracker, step = followed()
    graph, last = tracker.graph, biggest(step, 5).index
    back = graph.follow(4, last, backward=True)
    assert (4, last) in back and min(t for t, _ in back) == 0
    first = min(back)
    assert (4, last) in graph.follow(*first)
    assert graph.follow(4, last, threshold=2.0, backward=True) == [(4, last)]
    with pytest.raises(TypeError, match="^backward: expected True or False, got 1$"):
        graph.follow(4, last, backward=1)
    assert all(0 <= forward <= 1 and 0 <= backward <= 1 for forward, backward in graph.arcs.values())
    assert np.allclose(graph.nodes[first].next_velocity, [-3, 0, 0], atol=0.1)


def test_a_graph_comes_back_from_json_and_pickle():
    graph = followed()[0].graph
    assert TrackGraph.from_json(graph.to_json()) == graph == pickle.loads(pickle.dumps(graph))
    assert TrackGraph() != graph and TrackGraph().nodes == {}
    with pytest.raises(ValueError, match="json"):
        TrackGraph.from_json("[]")
    for node in [(9, 0), (-1, 0), (2**70, 0)]:
        with pytest.raises(ValueError, match="node: "):
            graph.follow(*node)
    with pytest.raises(TypeError, match="node: "):
        graph.follow(0.5, 0)
    for threshold in (-0.1, 2.1, float("inf"), float("nan")):
        with pytest.raises(ValueError, match="threshold: expected a score, 0 to 2"):
            graph.follow(0, next(k for t, k in graph.nodes if t == 0), threshold=threshold)
    with pytest.raises(TypeError, match="threshold: "):
        graph.follow(0, 0, threshold="high")


def test_networkx_has_nodes_arcs_and_attributes():
    networkx = pytest.importorskip("networkx")
    graph = followed()[0].graph
    drawn = graph.to_networkx()
    assert isinstance(drawn, networkx.DiGraph)
    assert set(drawn.nodes) == set(graph.nodes) and set(drawn.edges) == set(graph.arcs)
    for edge in drawn.edges.values():
        assert edge["score"] == pytest.approx(edge["forward"] + edge["backward"])
    for key, node in drawn.nodes.items():
        np.testing.assert_array_equal(node["mean"], graph.nodes[key].mean)
        assert np.shape(node["covariance"]) == (3, 3)


def test_networkx_can_write_the_graph():
    networkx = pytest.importorskip("networkx")
    graph = followed()[0].graph
    text = json.dumps(networkx.node_link_data(graph.to_networkx(), edges="edges"))
    again = networkx.node_link_graph(json.loads(text), edges="edges")
    assert set(again.nodes) == set(graph.nodes) and set(again.edges) == set(graph.arcs)
    flat = graph.to_networkx(flat=True)
    written = io.BytesIO()
    networkx.write_graphml(flat, written)
    read = networkx.read_graphml(io.BytesIO(written.getvalue()))
    assert len(read.nodes) == len(graph.nodes) and len(read.edges) == len(graph.arcs)
    first = min(graph.nodes)
    assert read.nodes[str(first)]["mean_2"] == graph.nodes[first].mean[2]
    assert read.nodes[str(first)]["covariance_0_1"] == graph.nodes[first].covariance[0, 1]


@pytest.mark.parametrize("part", ["nodes", "arcs"])
def test_a_written_graph_says_everything_once(part):
    graph = json.loads(followed()[0].graph.to_json())
    graph[part].append(graph[part][0])
    with pytest.raises(ValueError, match="json: .*twice"):
        TrackGraph.from_json(json.dumps(graph))


def test_a_compressed_sequence_that_holds_both_views_is_followed(tmp_path):
    """As players have it: MPEG-4 of both views side by side, with the losses that go with it."""
    av = pytest.importorskip("av")
    path = tmp_path / "sequence.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=25, options={"qscale": "2"})
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = 320, 120, "yuv420p", 8_000_000
        for views in sequence():
            picture = av.VideoFrame.from_ndarray(np.hstack(views), format="gray").reformat(format="yuv420p")
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    tracker = StereoTracker(n_components=6, **SMALL)
    for both in video.frames(path):
        step = tracker.update(*np.split(both, 2, axis=1))
    assert step.time == 4
    assert np.allclose(biggest(step, -4).velocity, [2, 0, 0], atol=0.1)
    assert np.allclose(biggest(step, 5).velocity, [-3, 0, 0], atol=0.1)


@pytest.mark.filterwarnings("ignore:row_range")  # Of views of noise.
def test_the_rows_of_a_sequence_are_not_those_of_its_title():
    card = np.full((240, 320), 20, np.uint8)
    card[100:104, 60:260] = card[120:150, 80:84] = card[120:150, 200:204] = 230
    noise = [np.random.default_rng(seed).integers(0, 40, card.shape, dtype=np.uint8) for seed in (1, 2)]
    sequence = small().sequence()[:2]
    for first in ((card, card), noise, (np.full_like(card, 16),) * 2):
        tracker = StereoTracker(disparity_range=(-20, 12))
        tracker.update(*first)
        for shown in sequence:
            step = tracker.update(shown.left, shown.right)
            wrong = np.abs(step.values - shown.disparity[step.rows, step.cols]) > 1
            assert len(step.rows) > 4000 and wrong.mean() < 0.04


def test_rows_that_nothing_agrees_with_are_warned_of():
    shown = small().sequence()[0]
    tracker = StereoTracker(disparity_range=(-20, 12))
    assert tracker.row_offset is None
    with pytest.warns(UserWarning, match="row_range: .* -4 to 4"):
        step = tracker.update(shown.left, np.roll(shown.right, 5, axis=0))
    assert step.rows_doubtful and tracker.row_offset is None
    step = tracker.update(shown.left, shown.right)
    assert not step.rows_doubtful
    assert step.row_offset == tracker.row_offset == pytest.approx(1.0, abs=0.05)
    assert StereoTracker(row_offset=0.5).row_offset == 0.5


def edges_at(left, disparity):
    """Disparities of a view's edges, NaN elsewhere."""
    return np.where(np.hypot(*np.gradient(left.astype(float))) > 15, np.float32(disparity), np.float32(np.nan))


def test_disparities_outside_of_the_range_are_left_out_and_reported():
    left, _ = next(sequence())
    disparity = edges_at(left, 5)
    near = np.isfinite(disparity)
    disparity[:, 80:][near[:, 80:]] = 60
    tracker = StereoTracker(n_components=4, **SMALL)
    with pytest.warns(UserWarning, match=r"disparity: \d+ of \d+ are outside of disparity_range, \(-8, 8\)"):
        step = tracker.update_disparity(left, disparity)
    assert step.left_out == near[:, 80:].sum() > 100
    assert len(step.rows) == len(step.cluster_of_pixel) == near[:, :80].sum() > 100
    assert (step.values == 5).all() and all(abs(cluster.mean[2] - 5) < 0.5 for cluster in step.clusters)
    tracker = StereoTracker(n_components=4, grid=(30, 40, 72), disparity_range=(-8, 8))
    step = tracker.update_disparity(left, disparity)
    assert step.left_out == 0 and {round(cluster.mean[2]) for cluster in step.clusters} == {5, 60}


@pytest.mark.parametrize("truth", [5.0, 5.45, -3.3])
def test_depth_is_that_of_the_pixels_and_not_of_their_layers(truth):
    left, _ = next(sequence())
    camera = StereoCamera(200.0, 0.1, -10.0)
    for given in (truth + np.random.default_rng(3).normal(0, 0.05, left.shape), np.full(left.shape, np.rint(truth))):
        # More components would share out the pixels by their layers.
        tracker = StereoTracker(n_components=1, **SMALL, camera=camera)
        step = tracker.update_disparity(left, edges_at(left, given))
        for cluster in step.clusters:
            off = abs(cluster.mean[2] - truth)
            # What is given in whole px is known to half of one.
            assert off < (0.03 if given.std() > 0 else 0.46)
            assert off < 2 * np.sqrt(cluster.covariance[2, 2])
            assert cluster.depth == pytest.approx(20 / (cluster.mean[2] + 10))
            assert tracker.tracks[cluster.track_id].positions[0, 2] == cluster.mean[2]
            assert np.linalg.eigvalsh(cluster.covariance).min() > 0


def test_known_cameras_give_depth_and_speed():
    _, step = followed(camera=StereoCamera(200.0, 0.1, -10.0))
    board = biggest(step, 5)
    assert board.depth == pytest.approx(20 / (board.mean[2] + 10))
    assert board.metric_velocity[0] == pytest.approx(-3 * board.depth / 200, rel=0.1)
    assert np.isnan(biggest(followed()[1], 5).depth)
    for given, named in [((-1.0, 1.0), "focal"), ((np.nan, 1.0), "focal"), ((1.0, 0.0), "baseline"), ((1.0, 1.0, np.nan), "d_infinity")]:
        with pytest.raises(ValueError, match=f"^{named}: .*(above 0|disparity)"):
            StereoCamera(*given)
    with pytest.raises(TypeError, match="baseline: "):
        StereoCamera(1.0, None)
    with pytest.raises(TypeError, match="camera: "):
        StereoTracker(camera=(1.0, 1.0, 0.0))


def leaving(steps=9):
    """A board of 56 px that moves 16 px/step to the right before a wall that rests, and is gone at step 7."""
    wall, board = np.tile(cells(columns=25), 2)[:, :400], cells(2)[:48, :56]
    for t in range(steps):
        left, right = wall.copy(), np.roll(wall, 4, axis=1)
        x = 180 + 16 * t
        left[36:84, x : x + 56] = board
        right[36:84, x - 5 : x + 51] = board
        yield tuple(np.rint(view[:, 120:280]).astype(np.uint8) for view in (left, right))


@pytest.mark.parametrize("mode", ["improved", "paper"])
def test_what_leaves_the_picture_is_measured_while_half_of_it_is_left(mode):
    tracker = StereoTracker(mode, n_components=6, **SMALL)
    for t, (left, right) in enumerate(leaving()):
        step = tracker.update(left, right)
        boards = [c for c in step.clusters if abs(c.mean[2] - 5) < 1.5]
        if 1 <= t <= 5:
            board = max(boards, key=lambda c: c.n_pixels)
            assert np.allclose(board.velocity, [16, 0, 0], atol=0.1)
            # Of its 207 edge pixels at step 4 only 102 are in the picture at step 5, less than half: it
            # coasts, unless outliers decide.
            assert t == 5 or not board.coasting
        # At step 5 there are 20 px of it, at step 6 only 4: nothing can be measured between them.
        if t == 6:
            assert all(np.isnan(c.velocity).all() or c.coasting for c in boards)
        if t >= 7:
            assert boards == []
    ids = {cluster.track_id for (t, _), cluster in tracker.graph.nodes.items() if t in (0, 5) and abs(cluster.mean[2] - 5) < 1.5}
    assert len(ids) == 1


@pytest.mark.parametrize("mode", ["improved", "paper"])
def test_nothing_to_see_is_a_step_without_clusters(mode):
    tracker = StereoTracker(mode, n_components=6, **SMALL)
    views = list(sequence())
    grey = np.full((120, 160), 90, np.uint8)
    for left, right in [(grey, grey), *views[:3], (grey, grey), *views[4:]]:
        step = tracker.update(left, right)
        assert bool(step.clusters) == bool((left != grey).any())
        assert len(step.rows) == len(step.cluster_of_pixel)
    assert step.time == 5


def test_nobody_knows_how_anything_moved_to_or_from_a_pair_of_nothing():
    grey = np.full((120, 160), 90, np.uint8)
    tracker = StereoTracker("paper", n_components=6, **SMALL)
    views = list(sequence())
    for left, right in [views[0], views[1], (grey, grey), views[3], views[4]]:
        tracker.update(left, right)
    nodes = tracker.graph.nodes
    known = {name: {t: [np.isfinite(getattr(c, name)).any() for (at, _), c in nodes.items() if at == t] for t in (0, 1, 3, 4)} for name in ("velocity", "next_velocity")}
    assert not any(known["velocity"][3]) and not any(known["next_velocity"][1])
    assert any(known["velocity"][1]) and any(known["velocity"][4]) and any(known["next_velocity"][0]) and any(known["next_velocity"][3])


@pytest.mark.parametrize("dark", [0.0, 0.005])
def test_a_sequence_of_floats_may_begin_with_black(dark):
    rng = np.random.default_rng(5)
    views = [[(view + rng.normal(0, 2, view.shape)).astype(np.float32) for view in pair] for pair in sequence()]
    usual, late = (StereoTracker(n_components=6, **SMALL) for _ in range(2))
    late.update(*(np.float32(dark) * view for view in views[0]))
    for pair in views:
        seen, step = usual.update(*pair), late.update(*pair)
    assert abs(len(step.rows) - len(seen.rows)) <= 0.01 * len(seen.rows)
    for disparity, velocity in ((-4, [2, 0, 0]), (5, [-3, 0, 0])):
        cluster = biggest(step, disparity)
        assert np.allclose(cluster.velocity, velocity, atol=0.1)
        assert cluster.residual < 10


def test_a_track_rests_while_nothing_is_seen():
    tracker = StereoTracker(n_components=6, **SMALL)
    views = list(sequence())
    grey = np.full((120, 160), 90, np.uint8)
    before = [tracker.update(*views[t]) for t in range(3)][-1]
    tracker.update(grey, grey)
    after = tracker.update(*views[4])
    assert biggest(after, 5).track_id in {c.track_id for c in before.clusters if abs(c.mean[2] - 5) < 1.5}


def test_a_few_edges_where_nothing_was_are_a_scene_of_their_own():
    tracker = StereoTracker(n_components=6, **SMALL)
    for left, right in sequence(2):
        tracker.update(left, right)
    few = np.full(left.shape, np.nan, np.float32)
    few[10:110:20, 15] = 1
    step = tracker.update_disparity(left, few)
    assert sum(cluster.n_pixels for cluster in step.clusters) == 5


@pytest.mark.parametrize("mode", ["improved", "paper"])
def test_results_do_not_depend_on_threads(mode):
    one, two = followed(mode, threads=1)[0].graph, followed(mode, threads=2)[0].graph
    assert one == two


def test_pixels_that_are_not_finite_do_no_harm():
    tracker = StereoTracker(n_components=6, **SMALL)
    for left, right in sequence():
        left, right = left.astype(np.float32), right.astype(np.float32)
        left[50:54, 20:24] = np.nan
        right[10, 10] = np.inf
        step = tracker.update(left, right)
    assert np.allclose(biggest(step, -4).velocity, [2, 0, 0], atol=0.1)


def test_disparities_from_elsewhere():
    tracker = StereoTracker(n_components=6, **SMALL)
    for t, (left, _) in enumerate(sequence()):
        disparity = np.full(left.shape, np.nan, np.float32)
        edges = np.hypot(*np.gradient(left.astype(float))) > 15
        disparity[edges] = -4
        disparity[36:84, 80 - 3 * t : 136 - 3 * t][edges[36:84, 80 - 3 * t : 136 - 3 * t]] = 5
        step = tracker.update_disparity(left, disparity)
    assert np.allclose(biggest(step, 5).velocity, [-3, 0, 0], atol=0.1)
    with pytest.raises(ValueError, match="disparity"):
        tracker.update_disparity(left, disparity[:-1])
    with pytest.raises(TypeError, match="disparity"):
        tracker.update_disparity(left, left)


def test_views_that_do_not_fit_are_refused_with_both_shapes():
    tracker = StereoTracker(**SMALL)
    left, right = next(sequence())
    with pytest.raises(ValueError, match=r"\(120, 160\).*\(120, 159\)"):
        tracker.update(left, right[:, 1:])
    tracker.update(left, right)
    with pytest.raises(ValueError, match=r"\(120, 160\).*\(100, 160\)"):
        tracker.update(left[:100], right[:100])
    with pytest.raises(ValueError, match="left"):
        tracker.update(left[None], right)
    with pytest.raises(ValueError):
        StereoTracker().update(left[:16], right[:16])
    colour = np.repeat(left[:, :, None], 3, 2)
    assert tracker.update(colour, np.repeat(right[:, :, None], 3, 2)).clusters


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("mode", "fast"),
        ("n_components", 0),
        ("n_components", -1),
        ("search", 0),
        ("grid", (0, 80, None)),
        ("grid", (60, 80)),
        ("grid", (60, 80, 63)),
        ("threads", 0),
        ("disparity_range", (5, -5)),
        ("row_offset", float("nan")),
        ("mode", None),
        ("random_state", -1),
        ("disparity_range", (1,)),
        ("disparity_range", (0, 2**40)),
        ("grid", (2**70, 80, None)),
        ("search", 2**70),
        ("random_state", 2**64),
    ],
)
def test_options_out_of_range_are_named(option, value):
    with pytest.raises(ValueError, match=f"{option}: "):
        StereoTracker(**{option: value})


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("search", 1.5),
        ("random_state", None),
        ("row_offset", "high"),
        ("grid", 5),
        ("grid", (60.5, 80, None)),
        ("grid", (None, 80, None)),
        ("disparity_range", "ab"),
        ("threads", 1.5),
    ],
)
def test_options_of_another_kind_are_named(option, value):
    with pytest.raises(TypeError, match=f"{option}: "):
        StereoTracker(**{option: value})


def test_a_step_that_failed_changes_nothing():
    good, other = StereoTracker(n_components=6, **SMALL), StereoTracker(n_components=6, **SMALL)
    left, right = next(sequence())
    dark = np.full((120, 160), 0.5, np.float32)
    with pytest.raises(ValueError, match="right"):
        other.update(dark, dark[1:])
    for view in sequence():
        good.update(*(each.astype(np.float32) for each in view))
        other.update(*(each.astype(np.float32) for each in view))
        with pytest.raises(ValueError, match="left"):
            other.update(left[:60], right[:60])
        with pytest.raises(ValueError, match="disparity"):
            other.update_disparity(left, dark[:60])
    assert good.graph == other.graph


@pytest.mark.parametrize("text", [3, b"{}", None])
def test_what_is_no_text_is_no_graph(text):
    with pytest.raises(TypeError, match="^json: expected a text"):
        TrackGraph.from_json(text)


def test_words_that_are_no_text_are_named():
    with pytest.raises(ValueError, match=r"^mode: expected .*, got '\\ud800'"):
        StereoTracker(mode="\ud800")
