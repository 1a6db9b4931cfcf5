//! Motion models by name.

use jacoflow::error::Error;
use jacoflow::flow::model::ModelKind;

#[test]
fn names_round_trip_and_neither_assumption_is_refused_with_its_reason() {
    for &model in ModelKind::ALL {
        assert_eq!(ModelKind::parse(model.name()).unwrap(), model);
        assert_eq!((model.parameters()[0].name, model.parameters()[1].name), ("u", "v"));
    }
    let refused = ModelKind::parse("affine_accelerating").unwrap_err();
    assert!(matches!(refused, Error::NotObservable(_)) && refused.to_string().contains("0071"));
    let unknown = ModelKind::parse("rigid").unwrap_err().to_string();
    assert!(unknown.starts_with("model") && unknown.contains("accelerating") && unknown.contains("rigid"));
}

#[test]
fn parameters_scale_with_the_pixel_pitch() {
    let scales: Vec<f64> = ModelKind::Affine.parameters().iter().map(|p| p.scale((2.0, 0.5))).collect();
    assert_eq!(scales, [2.0, 0.5, 1.0, 0.25, 4.0, 1.0]);
}
