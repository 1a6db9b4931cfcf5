"""Hostile arguments: what no caller means, and what one passes by mistake."""

import numpy as np


class Spiteful:
    """An object whose conversions fail in unusual ways."""

    def __len__(self):
        raise RuntimeError("no length")

    def __float__(self):
        raise ZeroDivisionError("no number")

    def __array__(self, *_args, **_options):
        raise LookupError("no array")


class Path:
    def __fspath__(self):
        return "\0"


def nested(depth):
    """A list in a list in a list."""
    value = []
    for _ in range(depth):
        value = [value]
    return value


SCALARS = [
    None, True, 0, 1, -1, 2, 3, 7, 2**31, -(2**31) - 1, 2**63, -(2**63) - 1, 2**70, -(2**70), 10**400, 0.0, -0.0, 0.5, -1.5, 1e-300, 1e-30, 1e30, 1e300,
    float("nan"), float("inf"), float("-inf"), 1 + 2j, "", "x", "\0", "nan", "x" * 10_000, b"", b"\xff", (), [], {}, set(), (0, 0), (1, 2, 3, 4),
    (-1, -1, 5, 5), (2**70, 2**70), [float("nan")] * 2, [1, "a"], {"a": 1}, nested(40), range(3), iter(()), lambda *a, **k: None, object(), Spiteful(), Path(),
    np.int64(-3), np.uint64(2**64 - 1), np.float32("nan"), np.str_("abc"), np.datetime64("2020-01-01"), np.True_,
]  # fmt: skip


def arrays(rng):
    """An array of a shape and type that may not fit."""
    shapes = [(), (0,), (1,), (2,), (3,), (7,), (0, 0), (0, 5), (1, 1), (2, 2), (3, 3), (5, 2), (5, 3), (16, 16), (24, 32), (24, 33), (24, 32, 3), (24, 32, 2), (3, 24, 32), (2, 2, 2, 2), (1,) * 20]  # fmt: skip
    kinds = [np.uint8, np.uint16, np.int32, np.int64, np.uint64, np.float16, np.float32, np.float64, np.longdouble, np.complex64, bool, object, "U3", "datetime64[s]", ">f8", ">u2"]  # fmt: skip
    shape, kind = rng.choice(shapes), np.dtype(rng.choice(kinds))
    numbers = np.random.default_rng(rng.getrandbits(32))
    array = (numbers.uniform(0, 255, shape) if kind.kind not in "Mb" else numbers.integers(0, 2, shape)).astype(kind)
    if kind.kind == "f" and array.size and rng.random() < 0.6:
        array = np.asarray(array)
        array.flat[:: rng.choice([1, 2, 5])] = rng.choice([np.nan, np.inf, -np.inf, 1e30, -1.0, 0.0])
    return rng.choice([plain, reversed_, read_only, masked, fortran, listed])(array)


def plain(array):
    return array


def reversed_(array):
    return array[::-1] if array.ndim else array


def read_only(array):
    array.flags.writeable = False
    return array


def masked(array):
    return np.ma.masked_array(array)


def fortran(array):
    return np.asfortranarray(array)


def listed(array):
    return array.tolist()


def endless(rng):
    """A view of one sample with more elements than memory."""
    shape = rng.choice([(2**18, 2**18), (2**40,), (2**36, 2), (2**36, 3), (2**20, 2**10, 2**10), (2**18, 2**18, 3), (2**30, 2, 2)])
    return np.broadcast_to(np.zeros((), rng.choice([np.uint8, np.float32, np.float64, bool, np.int64])), shape)


def hostile(rng, good):
    """A value in place of a good one."""
    chance = rng.random()
    if chance < 0.55:
        return rng.choice(SCALARS)
    if chance < 0.85:
        return arrays(rng)
    if chance < 0.92:
        return endless(rng)
    if isinstance(good, np.ndarray) and good.size and good.dtype.kind == "f":
        bad = good.copy()
        bad.flat[rng.randrange(bad.size)] = rng.choice([np.nan, np.inf, 1e300, -1e300, 1e-300])
        return bad
    if isinstance(good, np.ndarray) and good.ndim:
        return rng.choice([good[:0], good[:1], good[..., :1], good.T, good[None], np.repeat(good, 2, -1)])
    return rng.choice([[good], (good, good), str(good), good])
