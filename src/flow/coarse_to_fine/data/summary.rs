//! What later stages need of the data term: its 26 planes are most of an estimate's memory.

use super::moments::{ERROR, VALID, normal};
use crate::flow::coarse_to_fine::grid::Planes;
use crate::flow::coarse_to_fine::memory::Space;
use crate::simd::SimdReal;

/// Plane of the window's mean of `P_uu`, grey^2/px^2.
pub(in super::super) const UU: usize = 0;
/// That of `P_uv`.
pub(in super::super) const UV: usize = 1;
/// That of `P_vv`.
pub(in super::super) const VV: usize = 2;
/// That of the residual energy, grey^2.
pub(in super::super) const ENERGY: usize = 3;
/// Share of the window that is usable.
pub(in super::super) const SEEN: usize = 4;
/// Number of planes.
pub(in super::super) const SUMMARY: usize = 5;

/// The summary of a data term.
pub(in super::super) fn summary<T: SimdReal>(space: &Space<T>, data: &Planes<T>) -> Planes<T> {
    let mut out = space.planes(data.width, data.height, SUMMARY);
    let planes = [(UU, normal(0, 0)), (UV, normal(0, 1)), (VV, normal(1, 1)), (ENERGY, ERROR), (SEEN, VALID)];
    for (y, (to, from)) in (0..data.height).flat_map(|y| planes.map(|pair| (y, pair))) {
        out.line_mut(to, y).copy_from_slice(data.line(from, y));
    }
    out
}
