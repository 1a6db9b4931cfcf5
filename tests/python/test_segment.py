"""Graph segmentation: published cases, scikit-image's partitions, inputs and mistakes."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from jacoflow import segment

DATA = Path(os.environ.get("JACOFLOW_DATA", Path(__file__).parents[2] / ".." / "shared" / "data"))

PHOTOGRAPHS = [
    "middlebury_flow/RubberWhale/frame10.png",
    "sintel/clean/easy/frame_0001.png",
    "stereo_stills/teddy/im2.png",
    "kitti2015/000000/frame1.png",
    "track_otb/Crossing/img/0001.jpg",
]


def tiles():
    """The specification's coloured tiles, uint8 (24, 32, 3)."""
    y, x = np.mgrid[:24, :32]
    return np.stack([(37 * (x // 4) + 61 * (y // 3)) % 256, 55 * (x // 8) * (y // 6) % 256, 90 + 3 * x], axis=-1).astype(np.uint8)


def count(image, *options):
    return int(segment.felzenszwalb(image, *options).max()) + 1


def adjusted_rand_index(a, b):
    """Agreement of two partitions, 1 where they are the same (Hubert and Arabie 1985)."""
    table = np.zeros((a.max() + 1, b.max() + 1))
    np.add.at(table, (a.ravel(), b.ravel()), 1)
    pairs = lambda n: float((n * (n - 1) / 2).sum())  # noqa: E731
    both, first, second, every = pairs(table), pairs(table.sum(1)), pairs(table.sum(0)), pairs(np.array([a.size]))
    expected = first * second / every
    return 1.0 if first == second == both else (both - expected) / ((first + second) / 2 - expected)


def test_published_cases():
    step = np.repeat(np.array([[0, 0, 0, 100, 100, 100]], np.uint8), 4, axis=0)
    assert (count(step, 1199, 0, 1), count(step, 1200, 0, 1)) == (2, 1)
    ramp = np.arange(0, 100, 10, dtype=np.uint8)[None]
    assert (count(ramp, 9, 0, 1), count(ramp, 10, 0, 1)) == (10, 1)
    dot = np.zeros((5, 5), np.uint8)
    dot[2, 2] = 255
    assert (count(dot, 1, 0, 1), count(dot, 1, 0, 2)) == (2, 1)


@pytest.mark.parametrize(
    ("options", "segments", "largest"),
    [
        ((50, 0, 1), 64, []),
        ((300, 0, 1), 41, [48, 48, 36, 36]),
        ((300, 0.8, 1), 25, [185, 157, 67, 47]),
        ((300, 0.8, 20), 12, [199, 161, 68, 62]),
        ((1000, 0.8, 20), 4, [359, 239, 132, 38]),
    ],
)
@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32", "float64"])
def test_tiles_in_every_type(options, segments, largest, kind):
    image = {"uint8": tiles(), "uint16": tiles() * np.uint16(257), "float32": tiles() / np.float32(255), "float64": tiles() / 255.0}[kind]
    assert image.dtype == kind
    labels = segment.felzenszwalb(image, *options)
    assert labels.dtype == np.int32 and labels.shape == (24, 32)
    sizes = np.sort(np.bincount(labels.ravel()))[::-1]
    assert len(sizes) == segments and sizes[: len(largest)].tolist() == largest


def same_partition(image, scale, min_size):
    theirs = pytest.importorskip("skimage.segmentation").felzenszwalb(image, scale, 0.8, min_size, channel_axis=-1 if image.ndim == 3 else None)
    ours = segment.felzenszwalb(image, scale, 0.8, min_size)
    assert ours.max() == theirs.max()
    assert adjusted_rand_index(ours, theirs) > 0.9995  # 1.000


SETTINGS = pytest.mark.parametrize(("scale", "min_size"), [(150, 30), (300, 60)])


@SETTINGS
@pytest.mark.parametrize("name", ["astronaut", "coffee", "chelsea"])
def test_partitions_of_pictures_that_come_with_scikit_image(name, scale, min_size):
    image = getattr(pytest.importorskip("skimage.data"), name)()[:300, 100:400]
    same_partition(image, scale, min_size)
    same_partition(image[..., 1], scale, min_size)
    same_partition(image / 255.0, scale, min_size)


@SETTINGS
@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_partitions_of_photographs(name, scale, min_size):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not there")
    same_partition(pytest.importorskip("cv2").imread(str(path))[..., ::-1], scale, min_size)


@SETTINGS
@pytest.mark.parametrize("seed", [0, 1])
def test_partitions_of_scenes(monkeypatch, seed, scale, min_size):
    folder = DATA / "particle_scenes"
    if not (folder / "scenes.py").exists():
        pytest.skip(f"{folder} is not there")
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    import scenes as particle_scenes

    frames, _ = particle_scenes.make(list(particle_scenes.SCENES)[seed], seed=seed, scale=0.5, T=2)
    same_partition(frames[1], scale, min_size)


@given(
    st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32 - 1), st.floats(0, 500), st.integers(0, 40), st.sampled_from([0.0, 0.8])
)
@settings(max_examples=50, deadline=None)
def test_labels_are_numbered_in_order_and_regions_large_enough(height, width, seed, scale, min_size, sigma):
    image = np.random.default_rng(seed).integers(0, 256, (height, width, 3)).astype(np.uint8)
    labels = segment.felzenszwalb(image, scale, sigma, min_size)
    numbers, first = np.unique(labels, return_index=True)
    assert_array_equal(numbers, np.arange(len(numbers)))
    assert (np.diff(first) > 0).all()
    assert len(numbers) == 1 or np.bincount(labels.ravel()).min() >= min_size
    assert_array_equal(labels, segment.felzenszwalb(image, scale, sigma, min_size, threads=3))


@pytest.mark.parametrize("colour", [False, True])
def test_strides_make_no_difference(colour):
    image = tiles() if colour else tiles()[..., 0]
    expected = segment.felzenszwalb(image, 300, 0.8, 5)
    padded = np.zeros((50, 70, 4), np.uint8)
    padded[2:50:2, 3:67:2, :3] = tiles()
    assert_array_equal(segment.felzenszwalb(padded[2:50:2, 3:67:2, :3] if colour else padded[2:50:2, 3:67:2, 0], 300, 0.8, 5), expected)
    assert_array_equal(segment.felzenszwalb(np.asfortranarray(image), 300, 0.8, 5), expected)
    turned = segment.felzenszwalb(np.ascontiguousarray(image[:, ::-1])[:, ::-1], 300, 0.8, 5)
    assert_array_equal(turned, expected)
    assert_array_equal(segment.felzenszwalb((image.astype(np.uint16) * 257).astype(">u2"), 300, 0.8, 5), expected)
    assert_array_equal(segment.felzenszwalb((image / 255.0).tolist(), 300, 0.8, 5), segment.felzenszwalb(image / 255.0, 300, 0.8, 5))


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_pixel_that_is_not_finite_stays_alone(kind, bad):
    image = np.full((20, 20, 3), 0.5, kind)
    image[10, 10, 1] = bad
    labels = segment.felzenszwalb(image, 300, 0.8, 1)
    assert labels[10, 10] == 1 and labels.sum() == 1
    assert not segment.felzenszwalb(image, 300, 0.8, 2).any()
    with pytest.raises(ValueError, match="^image: expected at least one finite pixel, got none$"):
        segment.felzenszwalb(np.full((3, 4), bad, kind), 1, 0.8, 0)
    alone = np.full((3, 4), bad, kind)
    alone[1, 2] = 0.5
    assert count(alone, 1, 0.8, 0) == 12


def test_limits():
    assert segment.felzenszwalb(np.zeros((1, 1), np.uint8)).tolist() == [[0]]
    assert segment.felzenszwalb(np.zeros((1, 1, 1), np.uint8)).tolist() == [[0]]
    assert count(tiles(), 0, 0, 24 * 32 + 1) == count(tiles(), 0, 0, 2**70) == 1
    assert count(np.array([[1, 1, 2]], np.uint8), 0, 0, 0) == 2


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"scale": -1}, ValueError, "scale: expected a finite number, at least 0, got -1"),
        ({"scale": float("nan")}, ValueError, "scale: "),
        ({"sigma": -0.1}, ValueError, "sigma: expected a finite number, at least 0, got -0.1"),
        ({"sigma": 1e5}, ValueError, "sigma: "),
        ({"min_size": -1}, ValueError, "min_size: expected a number of pixels, at least 0, got -1"),
        ({"min_size": 1.5}, TypeError, "min_size: expected an integer, got 1.5"),
        ({"threads": 0}, ValueError, "threads: "),
        ({"image": np.zeros((0, 5), np.uint8)}, ValueError, "image: expected from 1 to 1073741824 pixels, got 0 x 5"),
        ({"image": np.zeros((5, 5, 4), np.uint8)}, ValueError, r"image: expected shape \(H, W\) or \(H, W, 3\), got \(5, 5, 4\)"),
        ({"image": np.zeros(5)}, ValueError, "image: "),
        ({"image": np.zeros((5, 5), complex)}, TypeError, "image: .*complex128"),
        ({"image": np.ma.masked_all((5, 5))}, ValueError, "image: expected at least one finite pixel, got none"),
    ],
)
def test_mistakes_are_named(change, error, message):
    with pytest.raises(error, match=message):
        segment.felzenszwalb(**{"image": np.zeros((5, 5), np.uint8), **change})


def test_region_means():
    labels = np.array([[0, 0, 1], [2, 2, 2]])
    assert_allclose(segment.region_means(labels, [[1, 3, 5], [1, 2, 6]]), [2, 5, 3])
    assert_allclose(segment.region_means(labels, labels == 2), [0, 0, 1])
    values = np.arange(12.0).reshape(2, 3, 2)
    values[0, 1, 1] = values[0, 2, 0] = np.nan
    assert_allclose(segment.region_means(labels, values), [[1, 1], [np.nan, 5], [8, 9]])
    assert segment.region_means(labels, np.zeros((2, 3, 0))).shape == (3, 0)
    assert_array_equal(segment.region_means(np.array([[2]]), [[4.0]]), [np.nan, np.nan, 4])
    assert segment.region_means(np.zeros((0, 3), int), np.zeros((0, 3))).shape == (0,)


def test_region_means_are_those_of_each_region():
    rng = np.random.default_rng(0)
    labels, values = rng.integers(0, 9, (31, 17)).astype(np.uint16), rng.normal(size=(31, 17, 2))
    expected = np.array([values[labels == i].mean(0) for i in range(9)])
    assert_allclose(segment.region_means(labels[:, ::-1], values[:, ::-1]), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("labels", "values", "error", "message"),
    [
        ([[0, -1]], [[1, 2]], ValueError, "labels: expected 0 to 134217728, got -1"),
        (np.array([[2**63]], np.uint64), [[1]], ValueError, "labels: "),
        ([[1.0]], [[1]], TypeError, "labels: expected integers, got float64"),
        ([0, 1], [1, 2], ValueError, r"labels: expected shape \(H, W\)"),
        ([[0, 1]], [[1, 2, 3]], ValueError, "values: expected shape"),
        ([[0, 1]], [["a", "b"]], TypeError, "values: "),
    ],
)
def test_mistakes_of_region_means_are_named(labels, values, error, message):
    with pytest.raises(error, match=message):
        segment.region_means(labels, values)


def test_labels_whose_sums_memory_does_not_hold_are_an_error():
    """The largest label alone decides how many sums there are."""
    limited = (
        "import resource, numpy as np; from jacoflow import segment\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2 << 30,) * 2)\n"
        "assert segment.region_means([[2**20]], [[3.0]])[2**20] == 3\n"
        "try: segment.region_means([[2**27]], [[1.0]])\n"
        "except MemoryError as error: print(error)"
    )
    ended = subprocess.run([sys.executable, "-c", limited], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (0, f"labels: expected what fits into memory, got {16 * (2**27 + 1)} bytes\n"), ended.stderr
