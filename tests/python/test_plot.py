"""Pictures: right colours, right places, clear refusals."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import jacoflow
from jacoflow import plot


def make_field(flow, jacobian=None, points=None):
    flow = np.asarray(flow, dtype=float)
    if jacobian is None:
        jacobian = np.zeros((*flow.shape[:-1], 2, 2))
    return SimpleNamespace(flow=flow, jacobian=np.asarray(jacobian), points=points)


@pytest.fixture
def pyplot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


@pytest.fixture
def turning():
    y, x = np.mgrid[0:20, 0:30].astype(float)
    flow = np.stack([-0.1 * (y - 10), 0.1 * (x - 15)], axis=-1)
    jacobian = np.broadcast_to([[0.02, -0.1], [0.1, 0.03]], (20, 30, 2, 2))
    return make_field(flow, jacobian)


def test_directions_have_their_colours():
    image = plot.flow_image(make_field([[[1.0, 0], [0, 1.0], [0, 0], [np.nan, 0]]]), max_speed=1.0)
    assert image.dtype == np.uint8 and image.shape == (1, 4, 3)
    right, down, still, unknown = image[0].astype(int)
    assert right.tolist() == [255, 0, 0]
    assert down[0] > 200 and down[1] > 200 and down[2] < 30
    assert still.tolist() == [255, 255, 255] and unknown.tolist() == [0, 0, 0]


def test_speed_is_saturation_and_beyond_the_range_is_darker():
    image = plot.flow_image(make_field([[[0.5, 0], [1.0, 0], [3.0, 0]]]), max_speed=1.0)
    assert image[0, :, 0].tolist() == [255, 255, 191] and image[0, :, 1].tolist() == [127, 0, 0]


def test_wheel_agrees_with_the_flow_that_it_explains():
    wheel = plot.wheel_image(101)
    assert wheel[50, 95].tolist()[0] == 255 and wheel[50, 95, 1] < 40
    assert wheel[0, 0].tolist() == [255, 255, 255]


def test_divergence_and_curl_show_their_values(pyplot, turning):
    for draw, value in ((plot.divergence, 0.05), (plot.curl, 0.2)):
        axes = draw(turning, limit=1.0)
        shown = axes.images[0]
        assert np.allclose(shown.get_array(), value) and shown.get_clim() == (-1.0, 1.0)
        assert axes.get_title() == draw.__name__


def test_unsigned_map_starts_at_zero(pyplot):
    axes = plot.scalar_map(np.arange(12.0).reshape(3, 4), signed=False, limit=11.0, label="speed", unit="px/frame")
    assert axes.images[0].get_clim() == (0.0, 11.0) and axes.get_title() == "speed"


def test_arrows_stand_at_their_pixels(pyplot):
    y, x = np.mgrid[5:25:2, 10:40:2]
    flow = np.ones((10, 15, 2))
    flow[3, 4] = np.nan
    axes = plot.quiver(make_field(flow, points=np.stack([x, y], axis=-1)), step=1, scale=2.0)
    arrows = axes.collections[0]
    assert len(arrows.U) == 149 and np.allclose(arrows.U, 2.0)
    assert arrows.get_offsets().min(axis=0).tolist() == [10.0, 5.0]
    assert axes.yaxis_inverted()


def test_arrows_of_points(pyplot):
    field = make_field([[1.0, 0], [0, 2.0]], points=np.array([[3, 4], [7, 9]]))
    axes = plot.quiver(field, scale=1.0)
    assert axes.collections[0].get_offsets().tolist() == [[3.0, 4.0], [7.0, 9.0]]


def test_a_region_is_drawn_where_it_lies(pyplot):
    y, x = np.mgrid[4:24:4, 8:32:4]
    axes = plot.flow_colour(make_field(np.ones((5, 6, 2)), points=np.stack([x, y], axis=-1)), legend=False)
    assert tuple(axes.images[0].get_extent()) == (6.0, 30.0, 22.0, 2.0)


def test_overview_has_four_panels_and_draws(pyplot, turning):
    figure = plot.overview(turning, frame=np.zeros((20, 30)))
    titles = {axes.get_title() for axes in figure.axes}
    assert {"flow", "divergence", "curl"} <= titles
    figure.canvas.draw()


def test_drawing_into_given_axes_makes_no_figure(pyplot, turning):
    figure, axes = pyplot.subplots()
    assert plot.flow_colour(turning, axes=axes) is axes
    assert pyplot.get_fignums() == [figure.number]


def test_fields_without_any_known_value_are_drawn(pyplot):
    field = make_field(np.full((6, 7, 2), np.nan), np.full((6, 7, 2, 2), np.nan))
    plot.overview(field).canvas.draw()
    axes = plot.quiver(field)
    axes.figure.canvas.draw()
    assert axes.get_xlim()[1] >= 6 and axes.get_ylim()[0] >= 5, "the whole field is shown"


@pytest.mark.parametrize("draw", [plot.flow_colour, plot.flow_image, plot.divergence, plot.quiver])
def test_stacks_are_refused_by_name(pyplot, draw):
    with pytest.raises(ValueError, match="field"):
        draw(make_field(np.zeros((2, 5, 6, 2))))


def test_bad_numbers_are_refused_by_name(pyplot, turning):
    with pytest.raises(ValueError, match="max_speed"):
        plot.flow_image(turning, max_speed=0.0)
    with pytest.raises(ValueError, match="step"):
        plot.quiver(turning, step=0)
    with pytest.raises(ValueError, match="values"):
        plot.scalar_map(np.zeros(5))


def test_missing_matplotlib_says_how_to_get_it(monkeypatch, turning):
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for draw in (plot.flow_colour, plot.quiver, plot.divergence, plot.overview):
        with pytest.raises(jacoflow.MissingDependencyError, match="matplotlib"):
            draw(turning)
    assert plot.flow_image(turning).shape == (20, 30, 3)


def test_what_cannot_be_drawn_is_refused_by_name(pyplot, turning):
    for options, error, message in (
        ({"axes": "x"}, TypeError, "axes: expected an object like matplotlib.axes.Axes, got str"),
        ({"frame": "x"}, ValueError, r"frame: expected a grey frame \(H, W\), got 'x'"),
        ({"frame": np.zeros((4, 4, 3))}, ValueError, r"frame: expected a grey frame \(H, W\), got shape \(4, 4, 3\)"),
        ({"scale": np.nan}, ValueError, "scale: expected a number above 0, got nan"),
        ({"colour": 5}, ValueError, "colour: expected a colour as matplotlib takes it, got 5"),
    ):
        with pytest.raises(error, match=f"^{message}"):
            plot.quiver(turning, **options)
    with pytest.raises(TypeError, match="^figure: expected an object like matplotlib.figure.Figure, got int"):
        plot.overview(turning, figure=5)
    field = jacoflow.FlowField.from_arrays(np.zeros((20, 30, 2)))
    with pytest.raises(ValueError, match=r"^frame: expected the field's frame, shape \(20, 30\), got shape \(30, 20\)"):
        plot.quiver(field, frame=np.zeros((30, 20)))


def test_arrows_are_in_pixels_whatever_the_field_is_measured_in(pyplot):
    frames = jacoflow.scenes.Scene("affine", width=64, height=64, u=1.0, v=1.0).frames(2)
    field = jacoflow.flow(*frames, method="windowed", pixel_pitch=(1.0, 4.0), length_unit="mm", fps=50)
    arrows = plot.quiver(field, step=10, scale=1.0).collections[0]
    assert_allclose([np.median(arrows.U), np.median(arrows.V)], 1.0, atol=0.1)
