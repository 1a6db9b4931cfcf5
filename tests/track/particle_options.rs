//! Options of the particle tracker.

use jacoflow::track::particle::{Likelihoods, ParticleMode, ParticleOptions};

#[test]
fn options_out_of_range_are_named() {
    let defaults = ParticleOptions::default;
    for (name, options) in [
        ("n_particles", ParticleOptions { n_particles: 0, ..defaults() }),
        ("n_near", ParticleOptions { n_near: 7, ..defaults() }),
        ("scale", ParticleOptions { scale: Some(f64::NAN), ..defaults() }),
        ("ess_threshold", ParticleOptions { ess_threshold: 1.5, ..defaults() }),
        ("scale", ParticleOptions { segment_scale: -1.0, ..defaults() }),
    ] {
        let message = options.check().unwrap_err().to_string();
        assert!(message.starts_with(&format!("{name}: expected ")), "{message}");
    }
    assert!(defaults().check().is_ok());
}

#[test]
fn factors_have_names() {
    assert_eq!(
        Likelihoods::from_names(&["colour", "velocity", "tracks"]).unwrap(),
        Likelihoods::of(ParticleMode::Improved)
    );
    assert!(Likelihoods::from_names(&["color"]).unwrap_err().to_string().starts_with("likelihoods: "));
}
