//! Layers sliding over each other.

use super::motion_conformance as conformance;
use jacoflow::synth::motion::SinusoidalShear;

#[test]
fn velocity_jacobian_and_paths_agree() {
    conformance::check(&SinusoidalShear { speed: 1.5, wavelength: 48.0, phase: 7.0 }, 1e-6);
}
