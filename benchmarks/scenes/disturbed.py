"""What real recordings bring, on textures with exact flow: frames that are not equally bright, saturated
pixels, motions of a quarter of the frame, detail that pixels do not resolve."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

Array = NDArray[np.floating]
SIZE = (200, 260)
"""Height and width of the frames that are not equally bright."""
MARGIN = 24
"""Of the texture around the frame, px; also left out along each side of the field."""
LARGE = (480, 640)
"""Height and width of the frames with saturated pixels."""
FAINT = 110
"""First row of the faint texture that is compared, px."""
PLAIN = slice(90, 110)
"""Rows of the plain strip that are compared, px; those of columns up to 110."""
_X = np.linspace(0, 1, SIZE[1])
CHANGES: dict[str, Callable[[Array], Array]] = {
    "gain .5": lambda frame: 0.5 * frame,
    "gain .8": lambda frame: 0.8 * frame,
    "gain 1.4": lambda frame: 1.4 * frame,
    "offset 60": lambda frame: frame + 60,
    "offset -50": lambda frame: frame - 50,
    "gain .8, offset 20": lambda frame: 0.8 * frame + 20,
    "gain .7 to 1.1 along x": lambda frame: (0.7 + 0.4 * _X) * frame,
}
"""Of the second frame; none leaves the range of 8 bits."""


def texture(seed: int, shape: tuple[int, int] = SIZE) -> Array:
    """Fine and coarse grain, mean 0 and standard deviation 1, with a margin."""
    rng = np.random.default_rng(seed)
    noise = [rng.standard_normal([side + 2 * MARGIN for side in shape]) for _ in range(2)]
    grain = [gaussian_filter(part, size) for part, size in zip(noise, (1.5, 6.0), strict=True)]
    both: Array = grain[0] / grain[0].std() + grain[1] / grain[1].std()
    return both / both.std()


def view(picture: Array, shift: tuple[float, float], shape: tuple[int, int] = SIZE) -> Array:
    """The frame in which the picture has moved by `shift` px, (x, y)."""
    y, x = np.indices(shape).astype(float)
    moved: Array = map_coordinates(
        picture, [y + MARGIN - shift[1], x + MARGIN - shift[0]], order=5, mode="nearest"
    )
    return moved


def noisy(frame: Array, seed: int, change: Callable[[Array], Array] = lambda frame: frame) -> Array:
    """8-bit levels with noise of one level before a change of brightness."""
    noise = np.random.default_rng(seed).standard_normal(frame.shape)
    return np.clip(np.rint(change(frame + noise)), 0, 255)


def changed_pair(seed: int, shift: tuple[float, float], change: str | None = None) -> list[Array]:
    """Two frames, the second one changed."""
    picture = 110 + 22 * texture(seed)
    second = (CHANGES[change],) if change else ()
    return [noisy(view(picture, (0, 0)), 1), noisy(view(picture, shift), 2, *second)]


def inner(plane: Array) -> Array:
    """Without the margin."""
    return plane[MARGIN:-MARGIN, MARGIN:-MARGIN]


def specks(seed: int) -> tuple[list[NDArray[np.uint16]], list[NDArray[np.uint16]], NDArray[np.bool_]]:
    """Three 12-bit frames that move by .25 px, the same with 20 saturated pixels in the middle one, and what
    is farther than 20 px from these."""
    picture, rng = 1500 + 300 * texture(20 + seed, LARGE), np.random.default_rng(seed)
    views = [view(picture, (0.25 * t, 0), LARGE) for t in (-1, 0, 1)]
    clean = [np.rint(frame + 3 * rng.standard_normal(LARGE)).astype(np.uint16) for frame in views]
    rows, columns = rng.integers(20, LARGE[0] - 20, 20), rng.integers(20, LARGE[1] - 20, 20)
    middle = clean[1].copy()
    middle[rows, columns] = 4095
    y, x = np.indices(LARGE)
    distance = np.min([np.hypot(x - c, y - r) for r, c in zip(rows, columns, strict=True)], axis=0)
    return clean, [clean[0], middle, clean[2]], distance > 20


FOUND = np.s_[130:-150, 130:-150]
"""Of the speckle, what stays in the frame, off the parts that leave it."""


def shifted_speckle(seed: int, shift: tuple[int, int]) -> list[Array]:
    """Two frames of 400 x 400 px of fine speckle that moves by whole px, of up to 100; the coarsest levels of
    a pyramid have nothing to follow."""
    speckle = gaussian_filter(np.random.default_rng(seed).standard_normal((620, 620)), 1.5)
    speckle = 128 + 40 * speckle / speckle.std()
    u, v = shift
    return [speckle[110:510, 110:510], speckle[110 - v : 510 - v, 110 - u : 510 - u]]


def layered(seed: int, count: int = 2) -> tuple[list[Array], Array, Array]:
    """A disc that moves before a ground at rest, both faintly textured: two frames, or three with one before;
    with the flow of the last frame but one and the pixels within 10 px of the boundary that it and the last
    show."""
    y, x = np.indices(SIZE).astype(float)
    middle, radius, move = (SIZE[1] / 2 - 3, SIZE[0] / 2), 55.0, (6.0, 2.0)
    ground, disc = 80 + 6 * texture(seed), 140 + 6 * texture(seed + 100)

    def distance(time: float) -> Array:
        """From the boundary, px; negative on the disc."""
        found: Array = np.hypot(x - middle[0] - time * move[0], y - middle[1] - time * move[1]) - radius
        return found

    def frame(time: int) -> Array:
        share = np.clip(distance(time) + 0.5, 0, 1)
        shown = share * view(ground, (0, 0)) + (1 - share) * view(disc, (time * move[0], time * move[1]))
        return noisy(shown, seed + time)

    on_disc = distance(0) < 0
    flow = np.where(on_disc[..., None], move, 0.0)
    near = (np.abs(distance(0)) < 10) & (on_disc | (distance(1) > 0.5)) & (np.abs(distance(0)) > 1)
    return [frame(time) for time in range(2 - count, 2)], flow, near


WAVES = 400
"""Plane waves of an undersampled texture."""
CYCLES = 0.65
"""Their largest wave number, cycles per px: more than pixels resolve."""


def undersampled(seed: int, shift: tuple[float, float], side: int = 160) -> list[Array]:
    """Two frames of faint texture, two fifths of whose spectrum are beyond half a cycle per px; 8 bits."""
    rng = np.random.default_rng(seed)
    radius, angle = CYCLES * np.sqrt(rng.uniform(size=WAVES)), rng.uniform(0, 2 * np.pi, WAVES)
    waves = 2 * np.pi * radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    phase, amplitude = rng.uniform(0, 2 * np.pi, WAVES), rng.standard_normal(WAVES)
    y, x = np.indices((side, side)).astype(float)

    def frame(u: float, v: float) -> Array:
        terms = (a * np.cos(kx * (x - u) + ky * (y - v) + p) for (kx, ky), p, a in zip(waves, phase, amplitude, strict=True))
        return np.rint(60 + 6 * sum(terms, np.zeros_like(x)) / np.sqrt(WAVES / 2))

    return [frame(0, 0), frame(*shift)]


def faint(seed: int, shift: tuple[float, float]) -> list[Array]:
    """Two frames in which a faint texture, no stronger than the noise in its gradients, moves below a strong
    one that moves differently."""
    picture = texture(seed)
    weak = gaussian_filter(np.random.default_rng(seed).standard_normal(picture.shape), 3.0)
    weak *= 3.0 / weak.std()
    is_strong = np.indices(SIZE)[0] < FAINT - MARGIN
    frames = [np.where(is_strong, 40 * view(picture, (5.0 * k, 0.0)), view(weak, (k * shift[0], k * shift[1]))) for k in (0, 1)]
    return [noisy(120 + frame, 10 * seed + k) for k, frame in enumerate(frames)]


def plain(seed: int, shift: tuple[float, float]) -> list[Array]:
    """Two frames of texture with a plain strip that moves as a whole, and beside it patches that move against
    each other."""
    y, x = np.indices(SIZE)
    pictures = texture(seed), texture(seed + 100)
    goes_right, is_strip = (y // 25 + x // 25) % 2 == 0, abs(y - PLAIN.start - 10) < 15
    frames = []
    for k in (0, 1):
        whole = view(pictures[0], (k * shift[0], k * shift[1]))
        patches = np.where(goes_right, view(pictures[1], (4.0 * k, 0.0)), view(pictures[1], (-4.0 * k, 0.0)))
        frames.append(np.where(x < 150, np.where(is_strip, 0.0, whole), patches))
    return [noisy(120 + 30 * frame, 10 * seed + k) for k, frame in enumerate(frames)]


def waves(seed: int, size: int = 160, wavelength: float = 40.0) -> tuple[list[Array], Array]:
    """Two frames, and the flow between them: waves of 1 px, exact where the first frame is the moved one."""
    picture = 110 + 40 * texture(seed, (size, size))
    y, x = np.indices((size, size)).astype(float)
    flow: Array = np.stack([np.sin(2 * np.pi * y / wavelength), np.cos(2 * np.pi * x / wavelength)], axis=-1)
    first: Array = map_coordinates(picture, [y + MARGIN + flow[..., 1], x + MARGIN + flow[..., 0]], order=5)
    return [first, view(picture, (0.0, 0.0), (size, size))], flow
