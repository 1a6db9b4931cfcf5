//! The data term against its oracle.

mod oracle;

use super::*;
use oracle::{Case, REST};

impl Case {
    fn check<T: SimdReal>(&self, tolerance: f64) {
        let (want, mut want_residuals) = self.oracle();
        want_residuals.sort_by(f64::total_cmp);
        // Relative to the largest moment of the same products: a single one may cancel.
        let family = |k: usize| match k {
            0..18 => k / 6 * 6..k / 6 * 6 + 6,
            18..24 => 18..24,
            REST.. => REST..REST + 2,
            _ => k..k + 1,
        };
        for level in Level::available() {
            let (got, means, residuals) = self.run::<T>(level, 1);
            assert_eq!((got.width, got.height, got.count), (self.size.0.div_ceil(2), self.size.1.div_ceil(2), COUNT));
            let places = [normal(0, 0), normal(0, 1), normal(1, 1), REST, REST + 1, ERROR];
            assert_eq!(means.count, places.len());
            let of_means = places.into_iter().enumerate().map(|(k, plane)| (&means, k, plane));
            for (got, k, plane) in (0..COUNT).map(|k| (&got, k, k)).chain(of_means) {
                let most = want[family(plane)].iter().flatten().fold(1e-3f64, |m, v| m.max(v.abs()));
                for (i, want) in want[plane].iter().enumerate() {
                    let got = got.at(k, i % got.width, i / got.width).to_f64();
                    let close = (got - want).abs() <= tolerance * most;
                    assert!(close, "{level:?} {:?} plane {plane} site {i}: {got} {want}", self.size);
                }
            }
            let mut residuals: Vec<f64> = residuals.iter().map(|r| r.to_f64()).collect();
            residuals.sort_by(f64::total_cmp);
            assert_eq!(residuals.len(), want_residuals.len(), "{level:?} {:?}", self.size);
            for (got, want) in residuals.iter().zip(&want_residuals) {
                assert!((got - want).abs() <= 300.0 * tolerance, "{level:?}: {got} {want}");
            }
        }
    }

    fn check_both(&self) {
        self.check::<f64>(1e-12);
        self.check::<f32>(2e-5);
    }
}

#[test]
fn pairs_and_triples_of_any_size_are_the_formulas() {
    for size in [(37, 29), (38, 30), (8, 8), (3, 3), (5, 64)] {
        for views in [2, 3] {
            Case::new(size, views, 1.3).check_both();
        }
    }
}

#[test]
fn positions_outside_and_hidden_pixels_weigh_nothing() {
    let mut case = Case::new((41, 34), 3, 9.0);
    case.check_both();
    case.masks[0] = Some(Mask::from_fn(41, 34, |x, y| (x / 5 + y / 7) % 3 != 0));
    case.check_both();
    case.masks[2] = Some(Mask::from_fn(41, 34, |x, y| x + y > 20));
    case.check_both();
    let (planes, _) = case.oracle();
    let share = planes[VALID].iter().sum::<f64>() / planes[VALID].len() as f64;
    assert!(share > 0.05 && share < 0.5, "the case is no case: {share}");
}

#[test]
fn tiles_and_bands_leave_no_seams() {
    // Two tiles of columns, two bands of rows.
    let mut case = Case::new((670, 111), 2, 1.1);
    // Single precision rounds a position by 3e-5 px beyond column 512, and the waves rise by some ten parts
    // of themselves a px.
    case.check::<f32>(2e-4);
    case.options.sigma = 3.4;
    case.check::<f64>(1e-12);
}
