//! The names of the heuristics, for `benchmarks/ablation`.

use pyo3::prelude::*;

/// Name and purpose of every heuristic that `JACOFLOW_WITHOUT` can switch off.
#[pyfunction]
pub fn heuristics() -> Vec<(&'static str, &'static str)> {
    jacoflow::ablation::HEURISTICS.to_vec()
}
