"""Files of every format that is read, damaged, and what reads them."""

import contextlib
import io as streams
import json
import os
import pathlib
import pickle
import struct
import zipfile
import zlib

import numpy as np

import jacoflow
from jacoflow import FlowField, FlowFilter, io, scenes, track

FOREIGN = 1 / 16
"""Share of the damaged pickles, graphs and tables that the command line describes."""

EDGES = [0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF]
WORDS = [b"0", b"-1", b"1", b"18446744073709551516", b"4294967296", b"9223372036854775807", b"nan", b"inf", b"1e308", b"-0.0", b"99999999999999999999"]


def tiff(pixels):
    """A little-endian TIFF of one strip."""
    height, width = pixels.shape
    tags = [(256, 4, width), (257, 4, height), (258, 3, 8 * pixels.itemsize), (259, 3, 1), (262, 3, 1), (273, 4, 8), (277, 3, 1), (278, 4, height), (279, 4, pixels.nbytes)]
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    return struct.pack("<2sHI", b"II", 42, 8 + pixels.nbytes) + pixels.tobytes() + struct.pack("<H", len(tags)) + entries + bytes(4)


def bmp(pixels):
    """A BMP of 24 bits, grey."""
    height, width = pixels.shape
    data = np.repeat(pixels[:, :, None], 3, 2).tobytes()
    return struct.pack("<2sIHHI", b"BM", 54 + len(data), 0, 0, 54) + struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, len(data), 0, 0, 0, 0) + data


class Samples:
    """Whole files by name, and the functions that read them."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        frames = [scenes.Sensor().apply_u8(frame, t) for t, frame in enumerate(scenes.Scene("affine", width=20, height=16).frames(3))]
        self.frame, self.options = frames[0], {"precision": "float64"}
        self.whole = dict(self.of_frames(frames) + self.of_fields(frames) + self.of_states(frames))

    def written(self, name, write):
        path = self.folder / f"whole_{name}"
        write(path)
        return name, path.read_bytes()

    def of_frames(self, frames):
        colour = np.stack([frames[0]] * 3, -1)
        colour[0, 0] = (1, 2, 3)
        made = [
            self.written("a.npy", lambda path: np.save(path, np.array(frames))),
            self.written("fortran.npy", lambda path: np.save(path, np.asfortranarray(np.array(frames, np.float32)))),
            self.written("colour.npy", lambda path: np.save(path, np.array([colour] * 2))),
            self.written("a.y4m", lambda path: io.write_frames(path, frames)),
            self.written("colour.y4m", lambda path: io.write_frames(path, [colour] * 2)),
        ]
        for name, given in (("eight", frames[0]), ("sixteen", frames[0].astype(np.uint16) * 257), ("colour", colour)):
            folder = self.folder / name
            io.write_frames(folder, [given])
            made.append((f"{name}.png", (folder / "frame_000000.png").read_bytes()))
        grey = b"P5\n20 16\n255\n" + frames[0].tobytes()
        return [*made, ("a.pgm", grey), ("a.ppm", b"P6\n20 16\n255\n" + colour.tobytes()), ("a.tif", tiff(frames[0])), ("a.bmp", bmp(frames[0]))]

    def of_fields(self, frames):
        field, flow = jacoflow.flow(*frames, method="windowed"), np.random.default_rng(0).normal(size=(16, 20, 2)).astype(np.float32)
        disparity = np.abs(flow[..., 0])
        return [
            self.written("field.npz", field.save),
            self.written("wide.npz", jacoflow.flow(*[frame.astype(float) for frame in frames], method="windowed").save),
            self.written("a.flo", lambda path: io.write_flo(path, flow)),
            self.written("kitti.png", lambda path: io.write_kitti(path, flow)),
            self.written("a.pfm", lambda path: io.write_pfm(path, flow[..., 0])),
            self.written("three.pfm", lambda path: io.write_pfm(path, np.dstack([flow, flow[..., 0]]))),
            *(self.written(f"disparity.{kind}", lambda path: io.write_disparity(path, disparity)) for kind in ("npz", "pfm", "png")),
        ]

    def of_states(self, frames):
        made = FlowFilter(**self.options)
        made.push(frames[0])
        views = track.StereoTracker(grid=(4, 5, None), n_components=2)
        wide = np.kron(frames[0], np.ones((2, 2), np.uint8))
        views.update(wide, wide)
        colour = scenes.TargetScene("people_static", scale=0.1, frames=2)
        particle = track.ParticleTracker(colour.frame(0), colour.boxes()[0], n_particles=8, n_near=8)
        objects = {"filter": made, "stereo": views, "gradient": track.GradientTracker(frames[0], (4, 4, 8, 8)), "particle": particle, "step": particle.step}
        pickles = [(f"{name}.pickle", pickle.dumps(made)) for name, made in objects.items()]
        return [self.written("state.npz", made.save), ("graph.json", views.graph.to_json().encode()), ("points.csv", b"x,y\n1,2\n3,4\n"), *pickles]

    def reader(self, name, path, rng):
        """What reads a file of this name."""

        def each_frame():
            for colour, grey in ((None, None), ("luminance", None), ("rgb", "repeat")):
                with contextlib.suppress(jacoflow.FormatError):
                    for _ in zip(range(8), io.frames(path, colour=colour, grey=grey), strict=False):
                        pass

        def resume():
            made = FlowFilter(**self.options)
            made.load(path)
            made.push(self.frame)

        kind = path.suffix
        readers = {
            ".flo": [lambda: FlowField.load(path)],
            ".pfm": [lambda: FlowField.load(path), lambda: io.read_pfm(path), lambda: io.read_disparity(path)],
            ".npz": [lambda: FlowField.load(path), lambda: io.read_disparity(path), resume],
            ".json": [lambda: track.TrackGraph.from_json(path.read_text("latin-1"))],
            ".pickle": [lambda: unpickled(path)],
            ".csv": [lambda: io.frames(path)],
        }
        if name == "kitti.png":
            readers[".png"] = [lambda: io.read_kitti(path), each_frame]
        if name == "disparity.png":
            readers[".png"] = [lambda: io.read_disparity(path)]
        found = readers.get(kind, [each_frame, lambda: io.read_image(path, colour="luminance")])
        # The program knows none of these formats and starts ffmpeg, which takes longer than every other
        # reader.
        if kind in (".json", ".pickle", ".csv") and rng.random() > FOREIGN:
            return found
        return [*found, lambda: information(path)]

    def pick(self, rng):
        """Name, path and readers of a damaged file."""
        name = rng.choice(sorted(self.whole))
        damaged = damage(rng, name, self.whole[name])
        path = self.folder / f"damaged{rng.getrandbits(24):06x}{pathlib.Path(name).suffix}"
        path.write_bytes(damaged)
        return name, path, self.reader(name, path, rng)


def unpickled(path):
    """The object of our own restoring function: pickle itself runs what a file says, and is not ours."""
    saved = pickle.loads(path.read_bytes())
    return repr(saved)


def information(path):
    """What the command line says of it, without its words."""
    from jacoflow._jacoflow import _run_command_line

    code = _run_command_line(["jacoflow", "info", str(path), "--json", "--quiet"])
    if code not in (0, 1, 2, 3):
        raise AssertionError(f"info ends with {code}")


def damage(rng, name, content):
    """A copy with some bytes changed; of archives and pictures inside the checksums, as often as not."""
    kind = pathlib.Path(name).suffix
    inside = rng.random() < 0.7
    if kind == ".npz" and inside:
        return in_archive(rng, content)
    if kind == ".png" and inside:
        return in_chunks(rng, content)
    if kind == ".json" and inside:
        return in_words(rng, content)
    if kind == ".pickle":
        return in_state(rng, content)
    return changed(rng, content)


def changed(rng, content):
    """One to four changes of bytes, more often near the beginning."""
    content = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 4])):
        if not content:
            break
        at = int(len(content) * rng.random() ** rng.choice([1, 4]))
        how = rng.randrange(7)
        if how == 0:
            content[at] ^= 1 << rng.randrange(8)
        elif how == 1:
            content[at : at + 4] = struct.pack(rng.choice("<>") + "I", rng.choice(EDGES))
        elif how == 2:
            del content[at:]
        elif how == 3:
            content[at:at] = bytes(rng.choice(EDGES) & 0xFF for _ in range(rng.choice([1, 8, 300])))
        elif how == 4:
            del content[at : at + rng.choice([1, 4, 40])]
        elif how == 5:
            digits = [i for i in range(min(len(content), 300)) if 48 <= content[i] < 58]
            if digits:
                i = rng.choice(digits)
                content[i : i + 1] = rng.choice(WORDS)
        else:
            content[at : at + 8] = struct.pack("<d", rng.choice([float("nan"), float("inf"), 1e308, -1.0, 5e-324]))
    return bytes(content)


def in_archive(rng, content):
    """One of the arrays changed, and the archive written again."""
    with zipfile.ZipFile(streams.BytesIO(content)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(sorted(parts))
    how = rng.randrange(8)
    if how == 0:
        del parts[name]
    elif how == 1:
        parts[name] = parts[rng.choice(sorted(parts))]
    else:
        parts[name] = changed(rng, parts[name])
    out = streams.BytesIO()
    with zipfile.ZipFile(out, "w", rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])) as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    return out.getvalue()


def in_chunks(rng, content):
    """One of the chunks of a PNG changed, with a true checksum."""
    chunks, at = [], 8
    while at < len(content):
        (length,) = struct.unpack_from(">I", content, at)
        chunks.append((content[at + 4 : at + 8], content[at + 8 : at + 8 + length]))
        at += 12 + length
    place = rng.choice([0, 0, rng.randrange(len(chunks))])
    kind, data = chunks[place]
    if kind == b"IDAT" and rng.random() < 0.7:
        data = zlib.compress(changed(rng, zlib.decompress(data)))
    else:
        data = changed(rng, data)
    chunks[place] = (kind, data)
    return content[:8] + b"".join(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks)


def in_words(rng, content):
    """A value of a JSON text replaced."""
    value = json.loads(content)
    nodes = value.get("nodes") or [value]
    target = rng.choice([value, rng.choice(nodes)])
    target[rng.choice(sorted(target))] = rng.choice([None, -1, 2**70, 1e308, "x", [], {}, [[1e999]], True])
    return json.dumps(value).encode()


def in_state(rng, content):
    """The bytes of the state changed; what unpickling calls is left as it is."""
    import pickletools

    spots = [(at, argument) for operation, argument, at in pickletools.genops(content) if isinstance(argument, bytes) and len(argument) > 8]
    if not spots:
        return content
    at, argument = max(spots, key=lambda spot: len(spot[1]))
    start = content.index(argument, at)
    damaged = bytearray(argument)
    damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    return content[:start] + bytes(damaged) + content[start + len(argument) :]


def leftovers(folder, before):
    """Files in a folder that were not there before."""
    return sorted(set(os.listdir(folder)) - before)
