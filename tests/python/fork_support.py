"""What the processes of test_fork compute: those begun anew import this, and nothing that takes long."""

import functools
import hashlib

import numpy as np

import jacoflow
from jacoflow import scenes


def digest(*arrays):
    """A fingerprint of every bit."""
    return hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).digest()


@functools.cache
def sequence(count=3):
    """Frames so large that their work is split between threads. A forked child has those of its parent:
    drawing them takes longer than most of what is done with them."""
    return scenes.Scene("affine", width=320, height=240, random_state=4).frames(count)


def field(method="instantaneous", **options):
    return jacoflow.estimate(sequence(), method=method, **options, ends="drop")


def results(threads):
    """A fingerprint of what takes little time."""
    found = field(threads=threads)
    return digest(jacoflow.smooth(sequence()[0], 1.5, threads=threads), found.flow, found.jacobian)


def report(connection, threads):
    """In another process: sends its results."""
    connection.send(results(threads))
