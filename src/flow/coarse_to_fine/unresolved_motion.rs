//! Unresolved motion: what single sites move by beyond the flow, shown by the residuals that it explains.
//!
//! The flow averages over windows. Beside motion boundaries, on small or curved objects and where light
//! changes, sites have motions of their own, which leave residuals. So does noise. With a site's residual
//! energy `e`, its information `P` and the right side `b` that the windows leave, the motion `P^-1 b` of the
//! site's own explains `b^T P^-1 b` of the energy. Of white noise, weak or strong, that is a fixed share; of
//! residuals of other motions it is more. Where the share, averaged over neighbouring nodes, exceeds the
//! usual one, the sums `e` and `P` of a node are taken for those of motions of the covariance
//! `e (P + e I)^-1`, which the covariance of the flow includes. With `e` beside `P` no variance exceeds
//! 1 px^2, beyond which residuals say nothing of the size of a motion.
//!
//! Noise that is white in one part of a frame and coloured in the other may be taken for motion: the usual
//! share is one for the frame.

use super::data_term::MEANS;
use super::nodes::{NodeSums, Square, binomial_mean};
use super::planes::{LEFT, Planes};
use crate::math::quantile;
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};

/// Share of the energy of white noise that motions of the sites' own explain, measured behind the windows of
/// the data term: the least usual share.
const SHARE_OF_NOISE: f64 = 0.14;
/// Usual share over the lower quartile of the frame's nodes, as of white noise.
const USUAL_OVER_QUARTILE: f64 = 1.25;
/// Multiples of the usual share below which nothing and from which on all energy is taken for motion.
const CHANCE: f64 = 1.4;
const CERTAINTY: f64 = 2.4;
/// Information that is added in any direction, over that of the site: texture of one direction only.
const MIN_INFORMATION: f64 = 1e-3;
/// Information, over the mean of the frame, below which rounding decides.
const NEGLIGIBLE_INFORMATION: f64 = 1e-6;
/// Variance of slopes over that of the flow, px^-2: of motions that differ over some 11 px.
pub(super) const SLOPE_SHARE: f64 = 1.0 / 128.0;

/// Energy of each site that a motion of its own explains, from its means of a data term.
pub(super) fn explained_energy<T: SimdReal>(simd: Level, data: &Planes<T>, out: &mut Planes<T>) {
    out.reshape(data.width, data.height, 1);
    let len = out.row_len();
    for_each_band(out.data_mut(), len, |_, rows, out| {
        for (y, out) in rows.zip(out.chunks_exact_mut(len)) {
            let sites = std::array::from_fn(|k| data.line(k, y));
            dispatch(simd, Explain { sites, out: &mut out[LEFT..][..data.width] });
        }
    });
}

struct Explain<'a, T> {
    /// `P_uu, P_uv, P_vv`, right sides and energy of a row.
    sites: [&'a [T]; MEANS],
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Explain<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let n = self.out.len();
        let [a, b, c, u, v, _] = self.sites.map(|line| &line[..n]);
        // Without `V`: the compiler uses lanes here.
        for x in 0..n {
            let added = T::from_f64(MIN_INFORMATION) * (a[x] + c[x]);
            let (a, b, c) = (a[x] + added, b[x], c[x] + added);
            let determinant = a * c - b * b;
            let explained = (c * u[x] - b * v[x]) * u[x] + (a * v[x] - b * u[x]) * v[x];
            self.out[x] = if determinant > T::from_f64(0.0) { explained / determinant } else { T::from_f64(0.0) };
        }
    }
}

/// Variances `xx, xy, yy` of unresolved motion, px^2, at every node: from the `sums` around them and those of
/// the energies that the sites' own motions explain.
pub(super) fn unresolved_motion(sums: &[NodeSums], explained: &[[f64; 1]], size: (usize, usize)) -> Vec<Square> {
    let mut energies: Vec<[f64; 2]> =
        sums.iter().zip(explained).map(|(sum, [explained])| [*explained, sum[5]]).collect();
    binomial_mean(&mut energies, size);
    let share = |[explained, energy]: &[f64; 2]| (*energy > 0.0).then(|| explained / energy);
    let quartile = quantile(&mut energies.iter().filter_map(share).collect::<Vec<f64>>(), 0.25).unwrap_or(0.0);
    let usual = SHARE_OF_NOISE.max(USUAL_OVER_QUARTILE * quartile);
    let information = sums.iter().map(|sum| sum[0] + sum[2]).sum::<f64>() / sums.len() as f64;
    let negligible = NEGLIGIBLE_INFORMATION * information;
    let motion = |(&[a, b, c, _, _, energy], energies): (&NodeSums, &[f64; 2])| {
        let of_motion = ((share(energies).unwrap_or(0.0) / usual - CHANCE) / (CERTAINTY - CHANCE)).clamp(0.0, 1.0);
        let (a, c) = (a + energy + negligible, c + energy + negligible);
        let factor = of_motion * energy / (a * c - b * b);
        if factor.is_finite() { [factor * c, -factor * b, factor * a] } else { [0.0; 3] }
    };
    sums.iter().zip(&energies).map(motion).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (9, 9);

    /// Nodes of an energy, with the share of it that the sites' own motions explain.
    fn nodes(energy: f64, share: f64) -> (Vec<NodeSums>, Vec<[f64; 1]>) {
        let count = SIZE.0 * SIZE.1;
        (vec![[8.0, 3.0, 20.0, 0.0, 0.0, energy]; count], vec![[share * energy]; count])
    }

    #[test]
    fn noise_of_any_size_is_not_taken_for_motion() {
        let (mut sums, mut explained) = nodes(0.1, SHARE_OF_NOISE);
        for n in 0..SIZE.0 * SIZE.1 / 2 {
            (sums[n][5], explained[n]) = (900.0, [900.0 * SHARE_OF_NOISE]);
        }
        assert!(unresolved_motion(&sums, &explained, SIZE).iter().all(|variances| *variances == [0.0; 3]));
    }

    #[test]
    fn energy_that_own_motions_explain_is_that_of_their_variance() {
        let (mut sums, mut explained) = nodes(0.1, SHARE_OF_NOISE);
        let node = SIZE.0 * 4 + 4;
        for n in [node - SIZE.0, node, node + SIZE.0].into_iter().flat_map(|n| n - 1..=n + 1) {
            (sums[n][5], explained[n]) = (2.0, [2.0 * 0.9]);
        }
        let found = unresolved_motion(&sums, &explained, SIZE);
        let [xx, xy, yy] = found[node];
        // The inverse of `P + e I` times its determinant.
        let (a, b, c) = (8.0 + 2.0, 3.0, 20.0 + 2.0);
        let want = [c, -b, a].map(|entry| 2.0 * entry / (a * c - b * b));
        assert!([xx, xy, yy].iter().zip(want).all(|(found, want)| (found - want).abs() < 1e-5), "{found:?}");
        assert!((0..9).all(|n| found[n] == [0.0; 3]));
    }

    #[test]
    fn variances_are_bounded_and_blank_frames_have_none() {
        let (mut sums, explained) = nodes(4.0, 1.0);
        for sum in &mut sums[..9] {
            sum[..3].fill(0.0);
        }
        let found = unresolved_motion(&sums, &explained, SIZE);
        assert!(found.iter().all(|[xx, _, yy]| (0.0..=1.0).contains(xx) && (0.0..=1.0).contains(yy)), "{found:?}");
        let blank = unresolved_motion(&vec![[0.0; MEANS]; 81], &vec![[0.0]; 81], SIZE);
        assert!(blank.iter().all(|variances| *variances == [0.0; 3]));
    }

    #[test]
    fn a_site_explains_what_its_information_sees() {
        let mut data = Planes::<f64>::new(40, 1, MEANS);
        // Information in both directions, in one and in none; the right sides are those of a motion.
        let (sites, [u, v]) = ([[4.0, 1.0, 9.0], [4.0, -6.0, 9.0], [0.0; 3]], [0.3, -0.2]);
        for (x, [a, b, c]) in sites.into_iter().enumerate() {
            for (k, value) in [a, b, c, a * u + b * v, b * u + c * v].into_iter().enumerate() {
                data.line_mut(k, 0)[x] = value;
            }
        }
        let mut out = Planes::default();
        explained_energy(Level::SCALAR, &data, &mut out);
        let found = out.line(0, 0);
        for (x, [a, b, c]) in sites.into_iter().enumerate() {
            let energy = (a * u + 2.0 * b * v) * u + c * v * v;
            assert!((found[x] - energy).abs() <= 5e-3 * energy, "{x}: {}, {energy}", found[x]);
        }
        assert!(found[sites.len()..].iter().all(|energy| *energy == 0.0));
    }
}
