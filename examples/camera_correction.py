"""Camera-coordinate correction: pan, roll and zoom of a shaking camera read off the flow, and undone.

A camera that pans, rolls and zooms sees the still world move by u = a + s (x - xc) - w (y - yc), v = b + w (x
- xc) + s (y - yc). The four numbers come from a fit to
the flow *and its Jacobian*, each weighted by its standard deviation; chained over the sequence they bring
every frame back to the first one's coordinates.
"""

from __future__ import annotations

import numpy as np

import jacoflow
from jacoflow import plot, scenes
from picture import check, save

WIDTH, HEIGHT, COUNT = 200, 160, 21
PAN, ROLL, ZOOM = (0.6, -0.4), 0.006, 0.004
"""Per frame: px, rad (clockwise on the screen), relative growth."""
CENTRE = ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)


def shake() -> tuple[scenes.Scene, np.ndarray]:
    """The still world through the moving camera: the scene and its 8-bit frames (COUNT, HEIGHT, WIDTH)."""
    scene = scenes.Scene(
        "affine", width=WIDTH, height=HEIGHT, random_state=12, sigma=2.5, u=PAN[0], v=PAN[1], u_x=ZOOM, u_y=-ROLL, v_x=ROLL, v_y=ZOOM
    )
    camera = scenes.Sensor(noise=1.5, rounding="nearest", saturate=True, random_state=3)
    return scene, np.array([camera.apply_u8(frame, index=k) for k, frame in enumerate(scene.frames(COUNT))])


def camera_motion(field: jacoflow.FlowField) -> np.ndarray:
    """(a, b, s, w) of one frame by weighted least squares over all valid pixels."""
    valid = np.asarray(field.valid)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    x, y = (x - CENTRE[0])[valid], (y - CENTRE[1])[valid]
    one, zero = np.ones_like(x), np.zeros_like(x)
    rows = [(one, zero, x, -y), (zero, one, y, x), (zero, zero, one, zero), (zero, zero, zero, one), (zero, zero, zero, -one), (zero, zero, one, zero)]
    names = ("u", "v", "u_x", "v_x", "u_y", "v_y")
    left, right = np.zeros((4, 4)), np.zeros(4)
    for row, name in zip(rows, names):
        design = np.stack(row, axis=1)
        weight = 1.0 / np.asarray(field.std(name))[valid] ** 2
        left += (design * weight[:, None]).T @ design
        right += design.T @ (weight * np.asarray(getattr(field, name))[valid])
    return np.linalg.solve(left, right)


def step_matrix(a: float, b: float, s: float, w: float) -> np.ndarray:
    """Where a point goes in one frame of steady camera motion, 3 x 3: exp of the generator, by its series."""
    generator = np.array([[s, -w, a], [w, s, b], [0.0, 0.0, 0.0]])
    result, term = np.eye(3), np.eye(3)
    for k in range(1, 12):
        term = term @ generator / k
        result += term
    return result


def resample(image: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """`image` read at matrix (x, y), bilinear; NaN outside."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    dx, dy = x - CENTRE[0], y - CENTRE[1]
    sx = matrix[0, 0] * dx + matrix[0, 1] * dy + matrix[0, 2] + CENTRE[0]
    sy = matrix[1, 0] * dx + matrix[1, 1] * dy + matrix[1, 2] + CENTRE[1]
    x0, y0 = np.floor(sx).astype(int), np.floor(sy).astype(int)
    inside = (x0 >= 0) & (y0 >= 0) & (x0 < WIDTH - 1) & (y0 < HEIGHT - 1)
    x0, y0 = np.clip(x0, 0, WIDTH - 2), np.clip(y0, 0, HEIGHT - 2)
    fx, fy = sx - x0, sy - y0
    image = image.astype(float)
    top = image[y0, x0] * (1 - fx) + image[y0, x0 + 1] * fx
    low = image[y0 + 1, x0] * (1 - fx) + image[y0 + 1, x0 + 1] * fx
    return np.where(inside, top * (1 - fy) + low * fy, np.nan)


def main() -> None:
    _, frames = shake()
    fields = jacoflow.estimate(frames, method=jacoflow.Windowed(window_sigma=4.0), ends="drop")
    motions = np.array([camera_motion(fields[k]) for k in range(COUNT - 2)])
    names = ("pan x, px/frame", "pan y, px/frame", "zoom, 1/frame", "roll, rad/frame")
    truth = (PAN[0], PAN[1], ZOOM, ROLL)
    print(f"{'per frame':18} {'mean':>10} {'spread':>10} {'truth':>10}")
    for name, mean, spread, true in zip(names, motions.mean(axis=0), motions.std(axis=0), truth):
        print(f"{name:18} {mean:10.5f} {spread:10.5f} {true:10.5f}")
        check(name, float(mean), true, 0.02 * max(abs(true), 0.02) + (0.01 if "px" in name else 0.0))

    # The first and the last frame have no estimate of their own: their neighbours' stands in.
    steps = [motions[0], *motions, motions[-1]]
    chain = np.eye(3)
    for k in range(COUNT - 1):
        chain = step_matrix(*(0.5 * (steps[k] + steps[k + 1]))) @ chain
    last = frames[-1]
    back = resample(last, chain)
    seen = np.isfinite(back)
    before = float(np.sqrt(((last.astype(float) - frames[0])[seen] ** 2).mean()))
    after = float(np.sqrt(((back - frames[0])[seen] ** 2).mean()))
    true_chain = np.linalg.matrix_power(step_matrix(PAN[0], PAN[1], ZOOM, ROLL), COUNT - 1)
    corners = np.array([[-CENTRE[0], -CENTRE[1], 1], [CENTRE[0], -CENTRE[1], 1], [-CENTRE[0], CENTRE[1], 1], [CENTRE[0], CENTRE[1], 1]])
    drift = float(np.abs(corners @ (chain - true_chain).T).max())
    moved = float(np.abs(corners @ (true_chain - np.eye(3)).T).max())
    print(f"after {COUNT - 1} frames: corners have moved by {moved:.1f} px, put back to within {drift:.2f} px")
    print(f"last frame against the first: {before:.1f} grey levels rms before, {after:.1f} after (camera noise alone: {1.5 * 2**0.5:.1f})")
    check("drift of the corners, px", drift, 0.0, 0.6)

    def draw(figure):
        panels = figure.subplots(1, 3)
        plot.quiver(fields[COUNT // 2], axes=panels[0], frame=frames[COUNT // 2])
        plot.scalar_map(last.astype(float) - frames[0], axes=panels[1], limit=100, label="last - first, as seen", unit="grey levels")
        plot.scalar_map(back - frames[0], axes=panels[2], limit=100, label="last - first, corrected", unit="grey levels")

    save("camera_correction", draw, (15, 4.2))


if __name__ == "__main__":
    main()
