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
