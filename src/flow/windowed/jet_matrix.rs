//! The matrix of the equations as a function of the jet: `P(jet) m`, linear in both.

use crate::simd::Lanes;

/// The rows of `P(jet)`: for each unknown its column, only the first `ROWS` (1, 3 or 6) rows of it.
#[inline(always)]
pub(super) fn columns<V: Lanes, const ROWS: usize>(jet: &[V; 6]) -> [[V; 6]; 6] {
    let [_, x, y, xx, xy, yy] = *jet;
    let o = V::zero();
    match ROWS {
        1 => [[x, o, o, o, o, o], [y, o, o, o, o, o], [o; 6], [o; 6], [o; 6], [o; 6]],
        3 => [
            [x, xx, xy, o, o, o],
            [y, xy, yy, o, o, o],
            [o, x, o, o, o, o],
            [o, y, o, o, o, o],
            [o, o, x, o, o, o],
            [o, o, y, o, o, o],
        ],
        _ => [
            [x, xx, xy, o, o, o],
            [y, xy, yy, o, o, o],
            [o, x, o, xx + xx, xy, o],
            [o, y, o, xy + xy, yy, o],
            [o, o, x, o, xx, xy + xy],
            [o, o, y, o, xy, yy + yy],
        ],
    }
}

/// `basis[j][a][k]`: how component j of the jet enters column a, row k of P.
pub(super) fn basis(rows: usize) -> [[[f64; 6]; 6]; 6] {
    std::array::from_fn(|j| {
        let mut jet = [0.0; 6];
        jet[j] = 1.0;
        match rows {
            1 => columns::<f64, 1>(&jet),
            3 => columns::<f64, 3>(&jet),
            _ => columns::<f64, 6>(&jet),
        }
    })
}
