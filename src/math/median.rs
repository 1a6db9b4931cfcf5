//! The middle one of some numbers.

/// Standard deviation of a normal distribution over the median of its absolute deviations.
pub(crate) const MAD_TO_STD: f64 = 1.4826;

/// The middle one, of an even number the upper of the two in the middle; `None` of none. The numbers are
/// reordered. NaN counts as greater than every number.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_one_is_found() {
        assert_eq!(median(&mut []), None);
        assert_eq!(median(&mut [4.0]), Some(4.0));
        assert_eq!(median(&mut [9.0, -1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [9.0, -1.0, 2.0, 3.0]), Some(3.0));
        assert_eq!(median(&mut [f64::NAN, 1.0, f64::INFINITY]), Some(f64::INFINITY));
    }
}
