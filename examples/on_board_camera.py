"""On-board camera: which of the things ahead come nearer, in how many seconds, and which draw away or cross.

A camera drives towards a far background. Ahead of it are a car that it closes in on, a car that has overtaken
and draws away, and one that crosses the road. Three frames are enough: a thing's divergence is 2 / (time to
contact), for any movement of its own across the picture, and the point that stands still in the background is
where the camera is heading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import jacoflow
from jacoflow import plot, scenes
from picture import check, save

WIDTH, HEIGHT, FPS = 320, 200, 30.0
HEADING = (170.0, 80.0)
"""Focus of expansion of the background, px."""


@dataclass
class Thing:
    """Something in view: a box that moves by (u, v) px/frame and comes nearer with a time to contact in
    frames (negative: draws away, None: neither)."""

    name: str
    centre: tuple[float, float]
    half_width: float
    half_height: float
    velocity: tuple[float, float]
    contact: float | None

    def scene(self, seed: int) -> scenes.Scene:
        rate = 0.0 if self.contact is None else 1.0 / self.contact
        x, y = self.centre
        u, v = self.velocity
        return scenes.Scene("affine", width=WIDTH, height=HEIGHT, random_state=seed, centre_x=x, centre_y=y, u=u, v=v, u_x=rate, u_y=0.0, v_x=0.0, v_y=rate)

    def mask(self, t: float) -> np.ndarray:
        grow = 1.0 if self.contact is None else np.exp(t / self.contact)
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
        dx, dy = x - self.centre[0] - self.velocity[0] * t, y - self.centre[1] - self.velocity[1] * t
        return (np.abs(dx) <= self.half_width * grow) & (np.abs(dy) <= self.half_height * grow)

    def region(self) -> tuple[int, int, int, int]:
        """The box at time 0, (x, y, width, height)."""
        (x, y), w, h = self.centre, self.half_width, self.half_height
        return round(x - w), round(y - h), 2 * w + 1, 2 * h + 1


THINGS = (
    Thing("car ahead, closing in", (170, 120), 34, 28, (0.0, 0.3), 45.0),
    Thing("car that has overtaken", (60, 130), 30, 26, (0.8, -0.3), -60.0),
    Thing("car crossing", (265, 110), 32, 22, (-1.4, 0.0), None),
)


def look(t: float) -> np.ndarray:
    """The camera's 8-bit frame of time t."""
    rate = 1.0 / 200.0
    background = scenes.Scene(
        "affine", width=WIDTH, height=HEIGHT, random_state=1, centre_x=HEADING[0], centre_y=HEADING[1], u=0.0, v=0.0, u_x=rate, u_y=0.0, v_x=0.0, v_y=rate
    )
    image = background.frame(t)
    for seed, thing in enumerate(THINGS, start=2):
        image = np.where(thing.mask(t), thing.scene(seed).frame(t), image)
    camera = scenes.Sensor(noise=1.0, rounding="nearest", saturate=True, random_state=9)
    return camera.apply_u8(image, index=int(t) + 1)


def main() -> None:
    frames = [look(t) for t in (-1.0, 0.0, 1.0)]
    field = jacoflow.flow(*frames, method=jacoflow.Windowed(window_sigma=4.0), fps=FPS)
    # With the frame rate known, times are in seconds.
    print(f"{'what':24} {'divergence (truth)':>20} {'time to contact':>22} {'across, px/frame':>16}   verdict")
    for thing in THINGS:
        divergence, contact_time = (field.measure(name, thing.region()) for name in ("divergence", "time_to_contact"))
        mean, error = divergence.value, divergence.std
        u, v = (field.measure(name, thing.region()).value / FPS for name in ("u", "v"))
        truth = 0.0 if thing.contact is None else 2.0 / thing.contact * FPS
        if abs(mean) < 5 * error or abs(mean) < 0.25:
            verdict, contact = "keeps its distance", f"{'-':>22}"
        else:
            verdict = "comes nearer" if mean > 0 else "draws away"
            contact = f"{contact_time.value:8.2f} s +- {contact_time.std:.2f} s".rjust(22)
        print(f"{thing.name:24} {mean:+.3f} ({truth:+.3f}) 1/s  {contact} ({u:+.2f}, {v:+.2f})   {verdict}")
        check(f"divergence of the {thing.name}", mean, truth, 0.12)
        check(f"speed of the {thing.name}", u, thing.velocity[0], 0.1)
    heading = where_it_heads(field)
    print(f"heading: ({heading[0]:.1f}, {heading[1]:.1f}) px, truth ({HEADING[0]:.1f}, {HEADING[1]:.1f}) px")
    check("heading x", heading[0], HEADING[0], 6.0)
    check("heading y", heading[1], HEADING[1], 6.0)

    def draw(figure):
        left, right = figure.subplots(1, 2)
        plot.quiver(field, axes=left, frame=frames[1])
        plot.divergence(field, axes=right, limit=0.06)

    save("on_board_camera", draw)


def where_it_heads(field: jacoflow.FlowField) -> tuple[float, float]:
    """The point at rest of the background, which most of the picture follows."""
    x, y = (field.measure(f"rotation_centre_{axis}").value for axis in "xy")
    return x, y


if __name__ == "__main__":
    main()
