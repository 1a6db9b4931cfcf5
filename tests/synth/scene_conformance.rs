//! Shared checks for scenes with smooth brightness.

use jacoflow::synth::Scene;

/// `I_t + u I_x + v I_y` by central differences must vanish beside the size of its terms; frames must
/// equal the brightness function.
pub fn check(scene: &dyn Scene, tolerance: f64) {
    let (origin, (width, height)) = (scene.origin(), scene.size());
    let h = 1e-3;
    let mut checked = 0;
    for i in 0..60 {
        let (x, y) = (origin.0 + (i * 37 % width) as f64 + 0.3, origin.1 + (i * 23 % height) as f64 + 0.2);
        let t = 0.4 * f64::from((i % 7) as u8);
        let Some(m) = scene.motion(x, y, t) else { continue };
        let i_x = (scene.brightness(x + h, y, t) - scene.brightness(x - h, y, t)) / (2.0 * h);
        let i_y = (scene.brightness(x, y + h, t) - scene.brightness(x, y - h, t)) / (2.0 * h);
        let i_t = (scene.brightness(x, y, t + h) - scene.brightness(x, y, t - h)) / (2.0 * h);
        let residual = i_t + m.u * i_x + m.v * i_y;
        assert!(residual.abs() < tolerance, "({x}, {y}), t = {t}: {residual}, I_t = {i_t}");
        let (dx, dy) = scene.displacement(x, y, t, 1.5).expect("a carried scene knows its paths");
        if scene.motion(x + dx, y + dy, t + 1.5).is_some() {
            let change = scene.brightness(x + dx, y + dy, t + 1.5) - scene.brightness(x, y, t);
            assert!(change.abs() < 1e-6, "({x}, {y}), t = {t}: {change}");
        }
        checked += 1;
    }
    assert!(checked > 20, "only {checked} points had a truth");
    let frame = scene.frame(2.0);
    for (column, row) in [(0, 0), (width - 1, 0), (width / 2, height / 3), (width - 1, height - 1)] {
        let want = scene.brightness(origin.0 + column as f64, origin.1 + row as f64, 2.0);
        assert_eq!(frame.get(column, row), want);
    }
}
