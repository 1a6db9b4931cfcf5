//! Small dense matrices as row-major slices.

use nalgebra::{DMatrix, SymmetricEigen};

/// `out = a b` with `a` of `rows x inner` and `b` of `inner x columns`.
pub fn multiply(a: &[f64], b: &[f64], inner: usize, out: &mut [f64]) {
    let columns = b.len() / inner;
    for (a, out) in a.chunks_exact(inner).zip(out.chunks_exact_mut(columns)) {
        out.fill(0.0);
        for (&a, b) in a.iter().zip(b.chunks_exact(columns)) {
            for (out, &b) in out.iter_mut().zip(b) {
                *out += a * b;
            }
        }
    }
}

/// `out = a b^T` with `a` of `rows x inner` and `b` of `columns x inner`.
pub fn multiply_transposed(a: &[f64], b: &[f64], inner: usize, out: &mut [f64]) {
    let columns = b.len() / inner;
    for (a, out) in a.chunks_exact(inner).zip(out.chunks_exact_mut(columns)) {
        for (out, b) in out.iter_mut().zip(b.chunks_exact(inner)) {
            *out = a.iter().zip(b).map(|(&a, &b)| a * b).sum();
        }
    }
}

/// Adds `a a^T` to a symmetric matrix, with `a` of rows of `inner` values.
pub fn add_gram(a: &[f64], inner: usize, out: &mut [f64]) {
    let rows = a.len() / inner;
    for (i, first) in a.chunks_exact(inner).enumerate() {
        for (j, second) in a.chunks_exact(inner).enumerate().take(i + 1) {
            let product: f64 = first.iter().zip(second).map(|(a, b)| a * b).sum();
            out[i * rows + j] += product;
            if i != j {
                out[j * rows + i] += product;
            }
        }
    }
}

/// Replaces a square matrix by its symmetric part.
pub fn symmetrise(a: &mut [f64], n: usize) {
    for i in 0..n {
        for j in 0..i {
            let mean = 0.5 * (a[i * n + j] + a[j * n + i]);
            a[i * n + j] = mean;
            a[j * n + i] = mean;
        }
    }
}

/// The lower Cholesky factor of `a` (only its lower triangle is read); false where a pivot is not positive.
pub fn cholesky(a: &[f64], n: usize, l: &mut [f64]) -> bool {
    l.fill(0.0);
    for j in 0..n {
        let row: f64 = l[j * n..j * n + j].iter().map(|v| v * v).sum();
        let pivot = a[j * n + j] - row;
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let root = pivot.sqrt();
        l[j * n + j] = root;
        for i in j + 1..n {
            let dot: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
            l[i * n + j] = (a[i * n + j] - dot) / root;
        }
    }
    true
}

/// The Cholesky factor of `a`, which is first mended if it must be: symmetrised, and its eigenvalues lifted
/// to 1e-12 of the largest. Returns whether it was mended; `None` when it cannot be (NaN, infinity, no
/// positive eigenvalue).
pub fn factor(a: &mut [f64], n: usize, l: &mut [f64]) -> Option<bool> {
    if cholesky(a, n, l) {
        return Some(false);
    }
    if a.iter().any(|v| !v.is_finite()) {
        return None;
    }
    symmetrise(a, n);
    let eigen = SymmetricEigen::new(DMatrix::from_row_slice(n, n, a));
    let largest = eigen.eigenvalues.max();
    if largest <= 0.0 {
        return None;
    }
    // Lifting by rounding errors alone may leave a pivot at zero: raise the floor until the factor exists.
    for floor in [1e-12, 1e-10, 1e-8] {
        let lifted = eigen.eigenvalues.map(|v| v.max(floor * largest));
        let mended = &eigen.eigenvectors * DMatrix::from_diagonal(&lifted) * eigen.eigenvectors.transpose();
        a.copy_from_slice(mended.transpose().as_slice());
        symmetrise(a, n);
        if cholesky(a, n, l) {
            return Some(true);
        }
    }
    None
}

/// How far below zero an eigenvalue may lie, relative to the largest one's size, to be rounding.
const ROUNDING: f64 = 1e-9;

/// What is wrong with a covariance, in words: entries that are not finite, no symmetry, or an eigenvalue
/// below zero by more than rounding. `None`: nothing.
pub fn covariance_fault(a: &[f64], n: usize) -> Option<String> {
    if let Some(value) = a.iter().find(|v| !v.is_finite()) {
        return Some(format!("one with the entry {value}"));
    }
    let largest = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    for i in 0..n {
        for j in 0..i {
            let (lower, upper) = (a[i * n + j], a[j * n + i]);
            if (lower - upper).abs() > ROUNDING * largest {
                return Some(format!("one with {upper} at ({j}, {i}) and {lower} at ({i}, {j})"));
            }
        }
    }
    let least = negative_eigenvalue(a, n)?;
    Some(format!("one with the eigenvalue {least}"))
}

/// How small a pivot may be relative to its diagonal entry before it is rounding, per dimension.
pub const PIVOT_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// The lower root of a covariance, `a = l l^T` to rounding, singular ones included: a component without
/// variance has a column of zeros, and a pivot lost to rounding is raised to the size of rounding. An
/// indefinite matrix is repaired first. Returns whether it was; `None` when an entry is not finite.
pub fn covariance_root(a: &mut [f64], n: usize, l: &mut [f64]) -> Option<bool> {
    if cholesky(a, n, l) {
        return Some(false);
    }
    if a.iter().any(|v| !v.is_finite()) {
        return None;
    }
    if singular_cholesky(a, n, l) {
        return Some(false);
    }
    // Eigenvalues are raised in units in which every variance is one, so that small components count. A
    // negative variance is of the size of its error: its sign is changed.
    let scale: Vec<f64> = (0..n).map(|k| a[k * n + k].abs().sqrt()).collect();
    symmetrise(a, n);
    let used: Vec<usize> = (0..n).filter(|&k| scale[k] > 0.0).collect();
    let m = used.len();
    let correlation =
        DMatrix::from_fn(
            m,
            m,
            |i, j| {
                if i == j { 1.0 } else { a[used[i] * n + used[j]] / scale[used[i]] / scale[used[j]] }
            },
        );
    let eigen = SymmetricEigen::new(correlation);
    for floor in [1e-12, 1e-10, 1e-8] {
        let raised = eigen.eigenvalues.map(|v| v.max(floor));
        let repaired = &eigen.eigenvectors * DMatrix::from_diagonal(&raised) * eigen.eigenvectors.transpose();
        a.fill(0.0);
        for (i, &row) in used.iter().enumerate() {
            for (j, &column) in used.iter().enumerate() {
                a[row * n + column] = repaired[(i, j)] * scale[row] * scale[column];
            }
        }
        symmetrise(a, n);
        if singular_cholesky(a, n, l) {
            return Some(true);
        }
    }
    None
}

/// As [`cholesky`], for matrices that are singular to rounding.
fn singular_cholesky(a: &[f64], n: usize, l: &mut [f64]) -> bool {
    l.fill(0.0);
    let rounding = PIVOT_ROUNDING * n as f64;
    for j in 0..n {
        let variance = a[j * n + j];
        if variance == 0.0 {
            // The row to the left is zero where a is positive semi-definite, and so is the column below.
            if (0..n).any(|i| a[j * n + i] != 0.0 || a[i * n + j] != 0.0) {
                return false;
            }
            continue;
        }
        let row: f64 = l[j * n..j * n + j].iter().map(|v| v * v).sum();
        let pivot = variance - row;
        // Also where the variance itself is negative.
        if pivot.is_nan() || pivot < -rounding * variance {
            return false;
        }
        let root = pivot.max(rounding * variance).sqrt();
        l[j * n + j] = root;
        for i in j + 1..n {
            let dot: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
            l[i * n + j] = (a[i * n + j] - dot) / root;
        }
    }
    true
}

/// The least eigenvalue of a symmetric matrix where it is negative by more than rounding.
fn negative_eigenvalue(a: &[f64], n: usize) -> Option<f64> {
    // With its diagonal raised by what rounding may take, a matrix has a factor (cheaper than eigenvalues).
    let mut raised = a.to_vec();
    let diagonal = || (0..n).map(|k| k * (n + 1));
    let shift = 0.5 * ROUNDING * diagonal().fold(0.0f64, |m, k| m.max(a[k]));
    diagonal().for_each(|k| raised[k] += shift);
    if cholesky(&raised, n, &mut vec![0.0; n * n]) {
        return None;
    }
    let values = SymmetricEigen::new(DMatrix::from_row_slice(n, n, a)).eigenvalues;
    let largest = values.amax();
    Some(values.min()).filter(|least| *least < -ROUNDING * largest)
}

/// Replaces a square matrix `a` by the lower triangular `l` with `l l^T = a a^T` and a diagonal that is not
/// negative (A. S. Householder's reflections, from the right).
///
/// Each row's error is rounding of that row's length, also where terms of `a a^T` cancel.
pub fn lower_triangle(a: &mut [f64], n: usize) {
    for j in 0..n {
        let (row, below) = a[j * n..].split_at_mut(n);
        let row = &mut row[j..];
        let norm = row.iter().map(|v| v * v).sum::<f64>().sqrt();
        if norm == 0.0 {
            continue;
        }
        let scale = 1.0 / (norm * (norm + row[0].abs()));
        let to = if row[0] > 0.0 { -norm } else { norm };
        row[0] -= to;
        for other in below.chunks_exact_mut(n).map(|other| &mut other[j..]) {
            let part = scale * row.iter().zip(&*other).map(|(v, other)| v * other).sum::<f64>();
            other.iter_mut().zip(&*row).for_each(|(other, v)| *other -= part * v);
            if to < 0.0 {
                other[0] = -other[0];
            }
        }
        row.fill(0.0);
        row[0] = norm;
    }
}

/// Solves `l l^T x = b` in place; a component without a pivot, which has no variance, becomes zero.
pub fn solve(l: &[f64], n: usize, b: &mut [f64]) {
    forward(l, n, b);
    backward(l, n, b);
}

/// Solves `l^T x = b` in place, with zeros as in [`solve`].
pub fn backward(l: &[f64], n: usize, b: &mut [f64]) {
    for i in (0..n).rev() {
        let dot: f64 = (i + 1..n).map(|k| l[k * n + i] * b[k]).sum();
        b[i] = divide(b[i] - dot, l[i * n + i]);
    }
}

fn divide(value: f64, pivot: f64) -> f64 {
    if pivot == 0.0 { 0.0 } else { value / pivot }
}

/// Solves `l x = b` in place, with zeros as in [`solve`].
pub fn forward(l: &[f64], n: usize, b: &mut [f64]) {
    for i in 0..n {
        let dot: f64 = (0..i).map(|k| l[i * n + k] * b[k]).sum();
        b[i] = divide(b[i] - dot, l[i * n + i]);
    }
}
