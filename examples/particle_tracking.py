"""Two people who look alike cross before a hand-held camera: who is who afterwards?

A particle filter follows each. Corners that move with a person, not with the background, distinguish them,
which colour cannot. The map of what is not background comes from the corners alone, with a camera that moves.
"""

from __future__ import annotations

import numpy as np

from jacoflow import scenes, track
from picture import check, save

FIRST, LAST = 40, 78
"""Frames between which they cross, at frame 58."""


def overlap(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Intersection over union of boxes (..., 4): left, top, width, height."""
    low = np.maximum(one[..., :2], other[..., :2])
    high = np.minimum(one[..., :2] + one[..., 2:], other[..., :2] + other[..., 2:])
    common = np.clip(high - low, 0, None).prod(axis=-1)
    return common / (one[..., 2:].prod(axis=-1) + other[..., 2:].prod(axis=-1) - common)


def main() -> None:
    scene = scenes.TargetScene("people_handheld", random_state=10)
    frames = [scene.frame(t) for t in range(FIRST, LAST)]
    truth = scene.boxes()[FIRST:LAST]
    tracks = track.track_particles(frames, truth[0], keep_frames=True)
    found = np.stack([step.boxes for step in tracks])
    quality = overlap(found, truth)
    shaken = np.array([step.camera[:, 2] for step in tracks])
    print(f"the camera moves by up to {np.abs(shaken).max():.1f} px a frame")
    for number in tracks.ids:
        words = tracks.track(number).status
        covered = sum(word != "tracking" for word in words)
        print(f"person {number}: overlap with the truth {quality[:, number].mean():.2f}, {quality[-1, number]:.2f} in the end; covered in {covered} of {len(words)} frames")
        check(f"person {number}, overlap in the end", quality[-1, number], 1.0, 0.5)
        # The other one is somewhere else by now.
        check(f"person {number}, overlap with the other", overlap(found[-1, number], truth[-1, 1 - number]), 0.0, 0.1)

    def draw(figure):
        axes = figure.subplots(2, 2).ravel()
        moments = (0, 58 - FIRST, LAST - FIRST - 1)
        for panel, t in zip(axes, moments, strict=False):
            panel.imshow(frames[t])
            for number, colour in zip(tracks.ids, ("gold", "deepskyblue"), strict=True):
                left, top, width, height = tracks[t].boxes[number]
                x, y = found[: t + 1, number, :2].T + found[: t + 1, number, 2:].T / 2
                panel.plot(x, y, color=colour, lw=1)
                panel.add_patch(_rectangle((left, top), width, height, fill=False, ec=colour, lw=2))
                panel.text(left, top - 3, f"{number}: {tracks[t].status[number]}", color=colour, fontsize=8)
            panel.set_title(f"frame {FIRST + t}")
        shown = axes[3].imshow(tracks[-1].foreground, vmin=0, vmax=1, cmap="magma")
        axes[3].set_title(f"what is not background, frame {LAST - 1}")
        figure.colorbar(shown, ax=axes[3])
        for panel in axes:
            panel.set_axis_off()
        axes[0].set_xlim(-0.5, scene.size[0] - 0.5)

    save("particle_tracking", draw, (11, 7.5))


def _rectangle(*arguments, **options):
    """A box of matplotlib, which may be missing."""
    from matplotlib.patches import Rectangle

    return Rectangle(*arguments, **options)


if __name__ == "__main__":
    main()
