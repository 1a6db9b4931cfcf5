//! Points of fields whose flow is known.

use super::empty_field;
use super::motion3d::{FieldOptions, field_points};
use jacoflow::types::{FlowField, Rect, Status};

fn field() -> FlowField<f32> {
    let mut field = empty_field::<f32>((60, 40), 1, 5.0);
    field.motion.fill(0.5);
    // Of u and v alone, which are independent.
    let (size, covariance) = (field.len(), field.covariance.as_mut().unwrap());
    covariance.fill(0.25);
    covariance[size..2 * size].fill(0.0);
    field
}

#[test]
fn points_are_as_far_apart_as_errors_go_together() {
    let mut field = field();
    let points = field_points(&field, &FieldOptions::default()).unwrap();
    assert_eq!((points.spacing, points.points.len()), (10.0, 24));
    assert_eq!((points.points[0], points.points[1], points.flow[3]), ([5.0, 5.0], [15.0, 5.0], [0.5, 0.5]));
    let few = FieldOptions { max_points: Some(7), ..FieldOptions::default() };
    assert_eq!(field_points(&field, &few).unwrap().points.len(), 6);
    let dense = FieldOptions { spacing: Some(5.0), ..FieldOptions::default() };
    let covariance = field_points(&field, &dense).unwrap().covariances[0];
    assert!((covariance / 0.25 - 4.0 * std::f64::consts::PI).abs() < 1e-12, "{covariance}");
    assert!((points.covariances[0] / 0.25 - std::f64::consts::PI).abs() < 1e-12, "{}", points.covariances[0]);
    assert_eq!(field_points(&field, &dense).unwrap().points_per_independent_sample, covariance / 0.25);
    assert_eq!((points.points_per_independent_sample, points.correlation_length), (points.covariances[0] / 0.25, 5.0));
    let denser = FieldOptions { spacing: Some(1.0), ..FieldOptions::default() };
    assert_eq!(field_points(&field, &denser).unwrap().spacing, 5.0);
    let far = FieldOptions { spacing: Some(20.0), ..FieldOptions::default() };
    let far = field_points(&field, &far).unwrap();
    assert_eq!((far.points_per_independent_sample, &far.covariances[..4]), (1.0, &[0.25, 0.0, 0.0, 0.25][..]));
    field.status[5 * 60 + 5] = Status::Inconsistent;
    assert_eq!(field_points(&field, &FieldOptions::default()).unwrap().points[0], [15.0, 5.0]);
}

#[test]
fn a_region_has_its_own_grid_and_its_own_most() {
    let field = field();
    let region = Some(Rect { x: 10, y: 5, width: 40, height: 30 });
    let inside = |options: FieldOptions| field_points(&field, &options).unwrap();
    let found = inside(FieldOptions { region, ..FieldOptions::default() });
    assert!(found.points.len() >= 30 && found.spacing < 10.0, "{} {}", found.points.len(), found.spacing);
    assert!(found.covariances[0] > 0.25);
    // As many as are wanted in the region, regardless of the rest of the field.
    let few = inside(FieldOptions { region, max_points: Some(12), ..FieldOptions::default() });
    assert!((9..=12).contains(&few.points.len()), "{}", few.points.len());
    let rest = inside(FieldOptions { excluded: region, ..FieldOptions::default() });
    assert_eq!((rest.points.len(), rest.flow.len(), rest.covariances.len()), (12, 12, 48));
    assert!(rest.points.iter().all(|[x, y]| !(10.0..50.0).contains(x) || !(5.0..35.0).contains(y)));
    // A given spacing stays.
    let given = inside(FieldOptions { region, spacing: Some(10.0), ..FieldOptions::default() });
    assert_eq!((given.spacing, given.points.len()), (10.0, 12));
}

#[test]
fn fields_without_a_covariance_are_refused() {
    let bare = FlowField { covariance: None, ..field() };
    assert!(field_points(&bare, &FieldOptions::default()).unwrap_err().to_string().starts_with("field: "));
    let wrong = FieldOptions { spacing: Some(0.0), ..FieldOptions::default() };
    assert!(field_points(&field(), &wrong).unwrap_err().to_string().starts_with("spacing: "));
}
