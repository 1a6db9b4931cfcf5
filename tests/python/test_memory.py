"""Results and frames that are let go of leave their memory to later ones; nobody may notice."""

import functools

import numpy as np

import jacoflow

OPTIONS = {"method": "instantaneous", "threads": 1}


@functools.cache
def drawn(seed, size):
    """Drawing takes longer than all else."""
    scene = jacoflow.scenes.Scene("affine", width=size[0], height=size[1], random_state=seed)
    return [scene.frame(t) for t in range(3)]


def frames(seed, size=(200, 150), dtype=np.float32):
    """In memory of their own each time."""
    return [frame.astype(dtype) for frame in drawn(seed, size)]


def values(field):
    return [field.flow.copy(), field.jacobian.copy(), field.status.copy(), np.asarray(field.covariance).copy()]


def same(a, b):
    return all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a, b, strict=True))


def test_a_result_does_not_depend_on_whose_memory_it_lies_in():
    mask = np.ones((150, 200), bool)
    mask[40:60, 50:90] = False
    for dtype in (np.float32, np.float64, np.uint8):
        first = values(jacoflow.flow(*frames(1, dtype=dtype), **OPTIONS))
        for other in (frames(2, dtype=dtype), frames(2, (150, 200), dtype)):
            jacoflow.flow(*other, **OPTIONS)
            bad = [np.array(frame, copy=True) for frame in frames(3, dtype=dtype)]
            jacoflow.flow(*bad, mask=mask, **OPTIONS)
            jacoflow.flow(*bad, **{**OPTIONS, "method": jacoflow.Instantaneous(model="translational")})
            assert same(values(jacoflow.flow(*frames(1, dtype=dtype), **OPTIONS)), first)


def test_a_result_that_is_kept_is_never_written_to_again():
    kept = jacoflow.flow(*frames(1), **OPTIONS)
    before, view = values(kept), kept.u
    part = jacoflow.estimate(np.stack(frames(4) + frames(5)), **OPTIONS, ends="drop")[1]
    stack = values(part)
    for seed in range(2, 6):
        jacoflow.flow(*frames(seed), **OPTIONS)
    assert same(values(kept), before) and same(values(part), stack)
    del kept
    for seed in range(2, 6):
        jacoflow.flow(*frames(seed), **OPTIONS)
    assert np.array_equal(view, before[0][..., 0], equal_nan=True)


def test_a_stream_gives_what_triples_give():
    sequence = frames(1) + frames(2)
    stream = jacoflow.FlowEstimator(**OPTIONS)
    fields = [field for field in map(stream.push, sequence) if field is not None]
    for t, field in enumerate(fields):
        assert same(values(field), values(jacoflow.flow(*sequence[t : t + 3], **OPTIONS)))
