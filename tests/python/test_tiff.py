"""TIFF files of laboratories: axes, scale, and ways of storing."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import jacoflow
from jacoflow import io

tifffile = pytest.importorskip("tifffile")
codecs = pytest.importorskip("imagecodecs")

RNG = np.random.default_rng(5)
STACK = RNG.integers(0, 256, (5, 12, 16)).astype(np.uint8)
# T, C, Y, X and T, Z, C, Y, X.
CHANNELS = RNG.integers(0, 256, (5, 2, 12, 16)).astype(np.uint8)
VOLUMES = RNG.integers(0, 256, (4, 3, 2, 12, 16)).astype(np.uint16)


def read(path, **options):
    return np.array(list(io.frames(path, **options)))


@pytest.mark.parametrize("ome", [False, True])
def test_channels_are_not_taken_for_time(ome, tmp_path):
    path = tmp_path / ("stack.ome.tif" if ome else "stack.tif")
    tifffile.imwrite(path, CHANNELS, imagej=not ome, ome=ome, metadata={"axes": "TCYX"}, photometric="minisblack")
    with pytest.raises(jacoflow.FormatError, match=r"holds 2 channels \(C\) at each of 5 times; choose one with channel=0 to channel=1"):
        io.frames(path)
    for channel in (0, 1):
        assert_array_equal(read(path, channel=channel), CHANNELS[:, channel])
    with pytest.raises(ValueError, match="channel: expected an index below 2, got 2"):
        io.frames(path, channel=2)


def test_the_flow_of_a_channel_is_that_of_its_motion(tmp_path):
    """1.5 px a frame in one channel, none in the other; pixels of 5 µm, 0.4 s a frame."""
    texture = RNG.uniform(0, 255, (64, 160))
    for axis in (0, 1, 0, 1):
        texture = (np.roll(texture, -1, axis) + 2 * texture + np.roll(texture, 1, axis)) / 4
    spectrum, waves = np.fft.rfft(texture, axis=1), np.fft.rfftfreq(160)
    moving = [np.fft.irfft(spectrum * np.exp(-2j * np.pi * waves * 1.5 * k), 160, axis=1)[:, 20:116] for k in range(4)]
    stack = np.rint([[texture[:, 20:116], frame] for frame in moving]).astype(np.uint8)
    path = tmp_path / "cells.tif"
    tifffile.imwrite(path, stack, imagej=True, resolution=(0.2, 0.2), metadata={"axes": "TCYX", "finterval": 0.4, "unit": "micron"})
    for channel, shift in ((0, 0.0), (1, 1.5)):
        found = jacoflow.estimate(io.frames(path, channel=channel))[1].measure("u")
        assert found.unit == "µm/s" and abs(found.value - shift * 5 / 0.4) < max(4 * found.std, 0.1), found
        command = [sys.executable, "-m", "jacoflow", "measure", str(path), "--channel", str(channel), "--quantity", "u"]
        row = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[1].split(",")
        assert row[1] == "0.4" and row[7] == "µm/s" and abs(float(row[5]) - shift * 5 / 0.4) < max(4 * float(row[6]), 0.1), row


@pytest.mark.parametrize("kind", ["imagej", "ome"])
def test_slices_are_chosen_too(kind, tmp_path):
    path = tmp_path / "stack.ome.tif"
    tifffile.imwrite(path, VOLUMES, **{kind: True}, metadata={"axes": "TZCYX"}, photometric="minisblack")
    with pytest.raises(jacoflow.FormatError, match=r"holds 3 slices \(Z\) at each of 4 times; choose one with z=0 to z=2"):
        io.frames(path, channel=1)
    assert_array_equal(read(path, channel=1, z=2), VOLUMES[:, 2, 1])
    with pytest.raises(ValueError, match="z: expected an index, as the file holds 4 times"):
        io.frames(path, channel=1, z="time")
    with pytest.raises(ValueError, match="z: expected an index below 3, got 3"):
        io.frames(path, channel=1, z=3)


def test_slices_without_times_may_be_frames(tmp_path):
    path = tmp_path / "stack.ome.tif"
    tifffile.imwrite(path, STACK, ome=True, metadata={"axes": "ZYX"}, photometric="minisblack")
    with pytest.raises(jacoflow.FormatError, match=r'holds 5 slices \(Z\); choose one with z=0 to z=4.* or take them as frames with z="time"'):
        io.frames(path)
    assert_array_equal(read(path, z="time"), STACK)
    assert_array_equal(read(path, z=3), STACK[3:4])


def test_every_order_of_dimensions_in_ome(tmp_path):
    for order in ("TZCYX", "TCZYX", "ZTCYX", "ZCTYX", "CTZYX", "CZTYX"):
        path = tmp_path / f"{order}.ome.tif"
        stack = np.moveaxis(VOLUMES, [0, 1, 2], [order.index(axis) for axis in "TZC"])
        tifffile.imwrite(path, np.ascontiguousarray(stack), ome=True, metadata={"axes": order}, photometric="minisblack")
        assert_array_equal(read(path, channel=0, z=1), VOLUMES[:, 1, 0], order)


def test_ome_says_where_planes_are(tmp_path):
    path = tmp_path / "stack.tif"
    xml = """<?xml version="1.0"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06"><Image ID="Image:0">
    <Pixels ID="Pixels:0" DimensionOrder="XYCZT" Type="uint8" SizeX="16" SizeY="12" SizeC="1" SizeZ="1" SizeT="3">
    <Channel ID="Channel:0:0" SamplesPerPixel="1"/>
    <TiffData IFD="2" FirstT="0"/><TiffData IFD="0" FirstT="1"/><TiffData IFD="1" FirstT="2"/>
    <Plane TheC="0" TheZ="0" TheT="0" DeltaT="0"/><Plane TheC="0" TheZ="0" TheT="1" DeltaT="30" DeltaTUnit="ms"/>
    <Plane TheC="0" TheZ="0" TheT="2" DeltaT="0.1"/></Pixels></Image></OME>"""
    tifffile.imwrite(path, STACK[:3], description=xml, metadata=None, photometric="minisblack")
    assert_array_equal(read(path), STACK[[2, 0, 1]])
    times = [time for time, _ in io.frames(path).timed()]
    np.testing.assert_allclose(times, [0, 0.03, 0.1])
    two = xml.replace("</Image></OME>", '</Image><Image><Pixels SizeX="16" SizeY="12"/></Image></OME>')
    tifffile.imwrite(path, STACK[:3], description=two, metadata=None, photometric="minisblack")
    with pytest.raises(jacoflow.FormatError, match="describes 2 images"):
        io.frames(path)


def test_interval_and_scale_come_from_the_file(tmp_path):
    path = tmp_path / "stack.tif"
    tifffile.imwrite(path, STACK, imagej=True, resolution=(4, 2), metadata={"axes": "TYX", "finterval": 0.25, "unit": "micron", "fps": 7.0})
    reader = io.frames(path)
    assert (reader.frame_rate, reader.pixel_pitch, reader.length_unit) == (4.0, (0.25, 0.5), "µm")
    assert [time for time, _ in reader.timed()] == [0, 0.25, 0.5, 0.75, 1.0]
    assert io.frames(path, step=2).frame_rate == 2.0
    tifffile.imwrite(path, STACK, imagej=True, resolution=(72, 72), metadata={"axes": "TYX", "fps": 7.0, "unit": "inch"})
    reader = io.frames(path)
    assert (reader.frame_rate, reader.pixel_pitch, reader.length_unit, reader.time) == (7.0, None, None, None)
    path = tmp_path / "stack.ome.tif"
    scale = {"PhysicalSizeX": 0.5, "PhysicalSizeY": 0.25, "PhysicalSizeXUnit": "mm", "PhysicalSizeYUnit": "mm", "TimeIncrement": 20.0, "TimeIncrementUnit": "ms"}
    tifffile.imwrite(path, STACK, ome=True, metadata={"axes": "TYX", **scale}, photometric="minisblack")
    reader = io.frames(path)
    assert (reader.frame_rate, reader.pixel_pitch, reader.length_unit) == (50.0, (0.5, 0.25), "mm")
    for scale, pitch in (
        ({"PhysicalSizeX": 500.0, "PhysicalSizeXUnit": "nm", "PhysicalSizeY": 0.25}, (500.0, 250.0)),
        ({"PhysicalSizeX": 500.0, "PhysicalSizeXUnit": "nm"}, (500.0, 500.0)),
    ):
        tifffile.imwrite(path, STACK, ome=True, metadata={"axes": "TYX", **scale}, photometric="minisblack")
        reader = io.frames(path)
        assert_allclose(reader.pixel_pitch, pitch)
        assert reader.length_unit == "nm"


def test_axes_without_names_are_refused(tmp_path):
    path = tmp_path / "stack.tif"
    tifffile.imwrite(path, CHANNELS, photometric="minisblack")
    with pytest.raises(jacoflow.FormatError, match=r"planes of shape \(5, 2\) along axes that are not all named"):
        io.frames(path)
    tifffile.imwrite(path, CHANNELS, photometric="minisblack", metadata={"axes": "TCYX"})
    assert_array_equal(read(path, channel=1), CHANNELS[:, 1])
    tifffile.imwrite(path, STACK, photometric="minisblack")
    assert_array_equal(read(path), STACK)
    with pytest.raises(ValueError, match="channel: expected an index below 1, got 1"):
        io.frames(path, channel=1)
    tifffile.imwrite(path, STACK, photometric="minisblack", metadata=None)
    with pytest.raises(ValueError, match="channel: expected none"):
        io.frames(path, channel=0)
    assert_array_equal(read(path), STACK)


def test_planes_behind_a_single_directory(tmp_path):
    for kind in ({"imagej": True, "metadata": {"axes": "TCYX"}}, {"metadata": {"axes": "TCYX"}, "photometric": "minisblack"}):
        path = tmp_path / "stack.tif"
        tifffile.imwrite(path, CHANNELS, truncate=True, **kind)
        with tifffile.TiffFile(path) as file:
            assert len(file.pages) == 1
        assert_array_equal(read(path, channel=1, start=1), CHANNELS[1:, 1])
        path.write_bytes(path.read_bytes()[: -12 * 16])
        with pytest.raises(jacoflow.FormatError, match="metadata name 10 planes, the file has 1 pages"):
            io.frames(path, channel=1)


def test_a_folder_of_files_with_channels(tmp_path):
    for index, pair in enumerate(CHANNELS):
        tifffile.imwrite(tmp_path / f"t{index}.tif", pair, imagej=True, metadata={"axes": "CYX"})
    assert_array_equal(read(tmp_path, channel=1), CHANNELS[:, 1])
    with pytest.raises(jacoflow.FormatError, match=r"t0\.tif: holds 2 channels"):
        next(io.frames(tmp_path))
    assert_array_equal(io.read_image(tmp_path / "t3.tif", channel=0), CHANNELS[3, 0])


def test_a_file_of_several_pages_in_a_list_is_refused(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", STACK[0], metadata=None)
    tifffile.imwrite(tmp_path / "b.tif", STACK[:2], photometric="minisblack", metadata=None)
    (tmp_path / "list.txt").write_text("a.tif\nb.tif\n")
    for source in (tmp_path, tmp_path / "list.txt", tmp_path / "?.tif"):
        reader = io.frames(source)
        assert_array_equal(next(reader), STACK[0])
        with pytest.raises(jacoflow.FormatError, match=r"b\.tif: holds several pages; expected one picture a file"):
            next(reader)


def test_thumbnails_are_left_out(tmp_path):
    path = tmp_path / "stack.tif"
    with tifffile.TiffWriter(path) as writer:
        for frame in STACK:
            writer.write(frame, metadata=None)
            writer.write(frame[::2, ::2], subfiletype=1, metadata=None)
    assert_array_equal(read(path), STACK)
    tifffile.imwrite(tmp_path / "one.tif", STACK[0], metadata=None)
    with tifffile.TiffWriter(tmp_path / "one.tif", append=True) as writer:
        writer.write(STACK[0][::2, ::2], subfiletype=1, metadata=None)
    assert_array_equal(io.read_image(tmp_path / "one.tif"), STACK[0])


@pytest.mark.parametrize(
    ("dtype", "core"),
    [("int8", "float32"), ("int16", "float32"), ("float16", "float32"), ("int32", "float64"), ("uint32", "float64"), ("int64", "float64"), ("uint64", "float64"), ("float64", "float64")],
)
@pytest.mark.parametrize("order", ["<", ">"])
def test_sample_types(dtype, core, order, tmp_path):
    values = (STACK.astype(np.float64) - (0 if dtype.startswith("u") else 128)).astype(dtype)
    tifffile.imwrite(tmp_path / "s.tif", values, photometric="minisblack", byteorder=order)
    got = read(tmp_path / "s.tif")
    assert got.dtype == core
    assert_array_equal(got, values.astype(core))


def test_samples_that_no_frame_holds_are_refused(tmp_path):
    tifffile.imwrite(tmp_path / "s.tif", np.array([[2**53 + 1, 0], [0, 0]], np.uint64), photometric="minisblack")
    with pytest.raises(jacoflow.FormatError, match=r"s\.tif: samples of 64 bits beyond 2\^53"):
        io.read_image(tmp_path / "s.tif")


@pytest.mark.parametrize("compression", ["zstd", "lzma", "lzw", "zlib", "packbits"])
@pytest.mark.parametrize("layout", [{}, {"predictor": True}, {"tile": (16, 16)}, {"byteorder": ">", "predictor": True}, {"bigtiff": True, "rowsperstrip": 5}])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_compression(compression, layout, dtype, tmp_path):
    if compression == "packbits":
        layout = {name: value for name, value in layout.items() if name != "predictor"}
    values = (STACK.astype(np.float64) * (257 if dtype == "uint16" else 1)).astype(dtype)
    tifffile.imwrite(tmp_path / "s.tif", values, photometric="minisblack", compression=compression, **layout)
    got = read(tmp_path / "s.tif")
    assert got.dtype == dtype
    assert_array_equal(got, values)


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_tiles_of_noise_in_lzw_that_reach_beyond_the_picture(dtype, tmp_path):
    for seed in range(30):
        shape = (37 + seed, 53 + 7 * seed)
        values = np.random.default_rng(seed).integers(0, 256, shape).astype(dtype)
        tifffile.imwrite(tmp_path / "s.tif", values, photometric="minisblack", compression="lzw", tile=(16, 32))
        assert_array_equal(read(tmp_path / "s.tif")[0], values)


@pytest.mark.parametrize("compression", ["zstd", "lzma"])
def test_damage_in_compressed_files_is_an_error(compression, tmp_path):
    path = tmp_path / "s.tif"
    tifffile.imwrite(path, STACK, photometric="minisblack", compression=compression)
    whole = path.read_bytes()
    with tifffile.TiffFile(path) as file:
        start, length = file.pages[2].dataoffsets[0], file.pages[2].databytecounts[0]
    for damaged in (whole[:start] + bytes(length) + whole[start + length :], whole[:start] + whole[start + length // 2 :]):
        path.write_bytes(damaged)
        with pytest.raises((jacoflow.FormatError, OSError)):
            read(path)


def test_colour_in_chunks_and_planes(tmp_path):
    colour = RNG.integers(0, 256, (3, 12, 16, 3)).astype(np.uint8)
    tifffile.imwrite(tmp_path / "c.tif", colour, photometric="rgb")
    tifffile.imwrite(tmp_path / "p.tif", np.moveaxis(colour, 3, 1), photometric="rgb", planarconfig="separate")
    for name in ("c.tif", "p.tif"):
        assert_array_equal(read(tmp_path / name, colour="rgb"), colour)
        with pytest.raises(jacoflow.FormatError, match="holds colour"):
            read(tmp_path / name)


def test_colour_in_planes_of_tiles_that_reach_beyond_the_picture(tmp_path):
    colour = RNG.integers(0, 256, (20, 30, 3)).astype(np.uint8)
    tifffile.imwrite(tmp_path / "t.tif", np.moveaxis(colour, 2, 0), tile=(16, 16), photometric="rgb", planarconfig="separate")
    assert_array_equal(read(tmp_path / "t.tif", colour="rgb"), colour[None])
    with pytest.raises(jacoflow.MissingDependencyError, match="tiles that reach beyond the picture"):
        io.read_image(tmp_path / "t.tif", colour="luminance")


@pytest.mark.parametrize("compression", [None, "zlib", "zstd"])
def test_palettes(compression, tmp_path):
    ramp = np.arange(256, dtype=np.uint16) * 257
    grey = np.array([ramp[::-1]] * 3)
    tifffile.imwrite(tmp_path / "g.tif", STACK, photometric="palette", colormap=grey, compression=compression)
    got = read(tmp_path / "g.tif")
    assert got.dtype == np.uint8
    assert_array_equal(got, 255 - STACK)
    tifffile.imwrite(tmp_path / "d.tif", STACK, photometric="palette", colormap=np.array([ramp // 2] * 3), compression=compression)
    assert_array_equal(read(tmp_path / "d.tif"), (ramp // 2)[STACK])
    colours = np.array([ramp, ramp[::-1], ramp * 0])
    tifffile.imwrite(tmp_path / "c.tif", STACK, photometric="palette", colormap=colours, compression=compression)
    with pytest.raises(jacoflow.FormatError, match="holds colour"):
        read(tmp_path / "c.tif")
    assert_array_equal(read(tmp_path / "c.tif", colour="rgb"), np.stack([STACK, 255 - STACK, 0 * STACK], axis=-1))


def test_bilevel_pictures_are_black_and_white(tmp_path):
    tifffile.imwrite(tmp_path / "b.tif", STACK[0] > 128, bitspersample=1, photometric="minisblack", metadata=None)
    assert_array_equal(io.read_image(tmp_path / "b.tif"), np.where(STACK[0] > 128, 255, 0))


def test_other_kinds_are_read_through_tifffile(tmp_path, monkeypatch):
    path = tmp_path / "s.tif"
    tifffile.imwrite(path, CHANNELS, photometric="minisblack", compression="png", metadata={"axes": "TCYX"})
    assert_array_equal(read(path, channel=1, start=1), CHANNELS[1:, 1])
    with pytest.raises(ValueError, match="channel: expected an index below 2, got 5"):
        io.frames(path, channel=5)
    monkeypatch.setitem(sys.modules, "tifffile", None)
    with pytest.raises(jacoflow.MissingDependencyError, match=r"s\.tif: .*Save it uncompressed or with LZW.*tifffile"):
        io.frames(path, channel=1)


@pytest.mark.parametrize("name", ["s", "s.stk", "s.btf", "s.tf8", "s.bak", "s.dat", "s.npz"])
def test_all_pages_are_read_under_any_name(name, tmp_path):
    path = tmp_path / name
    tifffile.imwrite(tmp_path / "s.tif", STACK, photometric="minisblack", metadata=None)
    (tmp_path / "s.tif").rename(path)
    assert_array_equal(read(path), STACK)
    done = subprocess.run([sys.executable, "-m", "jacoflow", "info", str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "frames        5" in done.stdout, done.stderr
    # Kinds that only tifffile reads are found under any name, too.
    with open(path, "wb") as file:
        tifffile.imwrite(file, STACK, photometric="minisblack", compression="png", metadata=None)
    assert_array_equal(read(path), STACK)


def test_the_binary_reads_the_same(tmp_path):
    path = tmp_path / "stack.tif"
    tifffile.imwrite(path, CHANNELS, imagej=True, compression="zstd", resolution=(4, 4), metadata={"axes": "TCYX", "finterval": 0.5, "unit": "um"})

    def run(*arguments):
        return subprocess.run([sys.executable, "-m", "jacoflow", *arguments], capture_output=True, text=True, check=False)

    refused = run("info", str(path))
    assert refused.returncode == 1 and "holds 2 channels (C) at each of 5 times" in refused.stderr and "--channel" in refused.stderr
    told = run("info", str(path), "--channel", "1")
    assert told.returncode == 0 and "0.25 x 0.25 µm" in told.stdout and "fps           2" in told.stdout.replace("2.0", "2")
    out = tmp_path / "out"
    done = run("flow", str(path), "--channel", "0", "--method", "windowed", "-o", str(out))
    assert done.returncode == 0, done.stderr
    assert "as the file says: 2.0 frames/s, pixels of 0.25 x 0.25 µm" in done.stderr
    field = io.read_npz(sorted(out.iterdir())[0])
    assert field.pixel_pitch == (0.25, 0.25) and field.frame_period == 0.5
    plain = run("flow", str(path), "--channel", "0", "--method", "windowed", "--fps", "1", "--pixel-pitch", "1", "-o", str(out), "--force")
    assert plain.returncode == 0 and "as the file says" not in plain.stderr
    assert io.read_npz(sorted(out.iterdir())[0]).pixel_pitch == (1.0, 1.0)


def test_estimate_takes_the_units_that_the_file_notes(tmp_path):
    path = tmp_path / "stack.tif"
    tifffile.imwrite(path, STACK, imagej=True, resolution=(4, 2), metadata={"axes": "TYX", "finterval": 0.25, "unit": "micron"})
    field = jacoflow.estimate(io.frames(path), method="windowed")
    assert (field.frame_period, field.pixel_pitch, field.length_unit) == (0.25, (0.25, 0.5), "µm")
    plain = jacoflow.estimate(STACK, method="windowed")
    assert plain.frame_period is None
    assert_allclose(field.flow, plain.flow * np.array([0.25, 0.5]) / 0.25, rtol=1e-6)
    other = jacoflow.estimate(io.frames(path), method="windowed", fps=1, pixel_pitch=(2.0, 3.0), length_unit="mm")
    assert (other.frame_period, other.pixel_pitch, other.length_unit) == (1.0, (2.0, 3.0), "mm")
    half = jacoflow.estimate(io.frames(path, step=2), method="windowed")
    assert half.frame_period == 0.5


def test_values_that_are_neither_grey_nor_rgb_are_refused(tmp_path):
    inks, pairs, damaged = (tmp_path / name for name in ("inks.tif", "pairs.tif", "damaged.tif"))
    tifffile.imwrite(inks, np.zeros((24, 32, 4), np.uint8), photometric="separated")
    tifffile.imwrite(pairs, np.zeros((24, 32, 2), np.uint8), photometric="minisblack", planarconfig="contig")
    tifffile.imwrite(damaged, np.zeros((24, 32), np.uint8))
    with tifffile.TiffFile(damaged, mode="r+") as file:
        file.pages[0].tags["Compression"].overwrite(9999)
    for path, words in ((inks, "holds colours of the model SEPARATED"), (pairs, "holds 2 values a pixel"), (damaged, "no TIFF file that can be read")):
        for colour in (None, "rgb", "luminance"):
            with pytest.raises(jacoflow.FormatError, match=f"{path.name}: {words}"):
                list(io.frames(path, colour=colour))
