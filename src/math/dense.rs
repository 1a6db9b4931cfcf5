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

/// Gives a covariance that lost its eigenvalues' sign in a step one that has it. `Some(true)`: it was mended;
/// `None`: nothing can be done.
pub fn mend(a: &mut [f64], n: usize) -> Option<bool> {
    if a.iter().any(|v| !v.is_finite()) {
        return None;
    }
    if negative_eigenvalue(a, n).is_none() {
        return Some(false);
    }
    factor(a, n, &mut vec![0.0; n * n])
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

/// Solves `l l^T x = b` in place.
pub fn solve(l: &[f64], n: usize, b: &mut [f64]) {
    forward(l, n, b);
    for i in (0..n).rev() {
        let dot: f64 = (i + 1..n).map(|k| l[k * n + i] * b[k]).sum();
        b[i] = (b[i] - dot) / l[i * n + i];
    }
}

/// Solves `l x = b` in place.
pub fn forward(l: &[f64], n: usize, b: &mut [f64]) {
    for i in 0..n {
        let dot: f64 = (0..i).map(|k| l[i * n + k] * b[k]).sum();
        b[i] = (b[i] - dot) / l[i * n + i];
    }
}
