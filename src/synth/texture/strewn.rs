//! Points strewn at random over the whole plane (a Poisson process), found again cell by cell.

/// One number for each cell of the plane, for the random stream of that cell.
pub(crate) fn cell_index(column: i64, row: i64) -> u64 {
    u64::from(column as u32) | u64::from(row as u32) << 32
}

/// Number of points in a cell that holds one on average, from a uniform number in [0, 1).
pub(crate) fn poisson_of_mean_one(uniform: f64) -> u64 {
    let (mut count, mut term) = (0, (-1.0f64).exp());
    let mut sum = term;
    while uniform > sum && count < 16 {
        count += 1;
        term /= count as f64;
        sum += term;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_poisson() {
        let counts: Vec<u64> = (0..100_000).map(|i| poisson_of_mean_one((f64::from(i) + 0.5) / 1e5)).collect();
        let mean = counts.iter().sum::<u64>() as f64 / 1e5;
        let empty = counts.iter().filter(|&&c| c == 0).count() as f64 / 1e5;
        assert!((mean - 1.0).abs() < 1e-3 && (empty - (-1.0f64).exp()).abs() < 1e-4);
    }

    #[test]
    fn neighbouring_cells_differ_on_both_sides_of_zero() {
        let indices = [(0, 0), (-1, 0), (0, -1), (1, 0), (-1, -1)].map(|(c, r)| cell_index(c, r));
        for (i, a) in indices.iter().enumerate() {
            assert!(indices[i + 1..].iter().all(|b| a != b));
        }
    }
}
