//! The structure tensor against a general eigenvalue solver.

use jacoflow::image::StructureTensor;

#[test]
fn eigenvalues_and_steps_are_those_of_the_matrix() {
    let tensor = StructureTensor { xx: 3.0, xy: -1.2, yy: 0.9 };
    let matrix = nalgebra::Matrix2::new(3.0, -1.2, -1.2, 0.9);
    let eigenvalues: nalgebra::Vector2<f64> = matrix.symmetric_eigenvalues();
    assert!((tensor.smaller_eigenvalue() - eigenvalues.min()).abs() < 1e-14);
    assert!((tensor.larger_eigenvalue() - eigenvalues.max()).abs() < 1e-14);
    let step = tensor.solve([0.7, -2.0]);
    let right = matrix * nalgebra::Vector2::from(step);
    assert!((right[0] - 0.7).abs() < 1e-14 && (right[1] + 2.0).abs() < 1e-14);
    assert!(!StructureTensor { xx: 1.0, xy: 1.0, yy: 1.0 }.solve([1.0, 0.0])[0].is_finite());
}
