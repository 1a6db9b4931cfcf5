//! When pairs of views were recorded, where that is not evenly.

use jacoflow::pipeline::{Numbering, PairTimes};

#[test]
fn steps_are_counted_in_ordinary_ones() {
    let every_other = Numbering { start: 1, step: 2, ..Numbering::default() };
    let times = PairTimes::new(&[5.0, 5.1, 5.2, 5.3, 5.4, 5.5, 5.9, 6.1], every_other).unwrap();
    // Used are those at 5.1, 5.3, 5.5 and 6.1.
    assert!((times.steps(5, 7).unwrap() - 3.0).abs() < 1e-9 && (times.steps(1, 3).unwrap() - 1.0).abs() < 1e-9);
    assert!((times.at(7).unwrap() - 1.1).abs() < 1e-9);
    assert!(times.at(8).unwrap_err().to_string().starts_with("times: expected a time for every pair, 9 or more"));
    for wrong in [&[0.0, 0.0][..], &[0.0, f64::NAN], &[1.0], &[]] {
        assert!(PairTimes::new(wrong, Numbering::default()).unwrap_err().to_string().starts_with("times: "));
    }
}
