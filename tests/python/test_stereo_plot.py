"""Pictures of disparities, clusters and the graph: right colours, right places, clear refusals."""

from types import SimpleNamespace

import numpy as np
import pytest

from jacoflow import plot


@pytest.fixture
def pyplot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def cluster(index, track_id, x, y, velocity=(np.nan, np.nan, np.nan)):
    return SimpleNamespace(index=index, track_id=track_id, group=0, n_pixels=10, mean=np.array([x, y, 1.0]), velocity=np.array(velocity))


@pytest.fixture
def step():
    return SimpleNamespace(
        time=3, clusters=[cluster(2, 7, 5.0, 4.0, (3.0, 0.0, 0.0)), cluster(5, 9, 15.0, 8.0)], rows=np.array([4, 4, 8]), cols=np.array([4, 6, 15]),
        values=np.array([1.0, 2.0, -3.0]), cluster_of_pixel=np.array([2, 2, 5]), disparity=np.full((10, 20), np.nan),
    )  # fmt: skip


def colours_of(axes):
    return axes.collections[0].get_facecolors()[:, :3]


def test_disparities_lie_where_they_were_found(pyplot, step):
    axes = plot.disparity(step, left=np.zeros((10, 20), np.uint8), limits=(-3.0, 2.0))
    np.testing.assert_array_equal(axes.collections[0].get_offsets(), [[4, 4], [6, 4], [15, 8]])
    axes.figure.canvas.draw()
    least, most = colours_of(axes)[[2, 1]]
    np.testing.assert_allclose([least, most], [pyplot.get_cmap("viridis")(share)[:3] for share in (0.0, 1.0)])


def test_clusters_have_the_colours_and_numbers_of_their_tracks(pyplot, step):
    axes = plot.clusters(step, left=np.zeros((10, 20, 3)))
    first, same, other = colours_of(axes)
    np.testing.assert_array_equal(first, same)
    assert np.abs(first - other).max() > 0.2
    texts = [text for text in axes.texts if text.get_text()]
    assert [(text.get_text(), text.xy) for text in texts] == [("7", (5.0, 4.0)), ("9", (15.0, 8.0))]
    arrows = [text for text in axes.texts if not text.get_text()]
    assert [arrow.xyann for arrow in arrows] == [(5.0, 4.0)] and arrows[0].xy == (8.0, 4.0)
    grouped = colours_of(plot.clusters(step, by="group", arrows=0))
    np.testing.assert_array_equal(grouped[0], grouped[2])


def test_graph_runs_to_the_right_and_leaves_weak_arcs_out(pyplot):
    nodes = {(t, k): cluster(k, k, 0.0, 0.0) for t in (0, 1) for k in (0, 1)}
    arcs = {((0, 0), (1, 0)): (0.9, 0.8), ((0, 1), (1, 0)): (0.1, 0.2), ((0, 1), (1, 1)): (0.3, 0.1)}
    axes = plot.track_graph(SimpleNamespace(nodes=nodes, arcs=arcs))
    assert [list(line.get_xdata()) + list(line.get_ydata()) for line in axes.lines] == [[0, 1, 0, 0], [0, 1, 1, 1]]
    assert axes.lines[0].get_linewidth() > axes.lines[1].get_linewidth()
    np.testing.assert_array_equal(axes.collections[0].get_offsets(), list(nodes))


def test_nothing_to_draw_is_drawn(pyplot):
    empty = np.zeros(0)
    nothing = SimpleNamespace(time=0, clusters=[], rows=empty, cols=empty, values=empty, cluster_of_pixel=empty, disparity=np.full((3, 4), np.nan))
    plot.disparity(nothing)
    plot.clusters(nothing)
    plot.track_graph(SimpleNamespace(nodes={}, arcs={}))


def test_what_cannot_be_drawn_is_named(pyplot, step):
    with pytest.raises(ValueError, match="by: "):
        plot.clusters(step, by="colour")
    with pytest.raises(ValueError, match="left: "):
        plot.clusters(step, left=np.zeros(3))
