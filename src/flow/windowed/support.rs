//! Which pixels have equations at all.

use crate::flow::site::MaskCounts;
use crate::image::all_finite;
use crate::jet::Reach;
use crate::math::Real;
use crate::simd::SimdReal;
use crate::types::{Frame, Mask, Status};

/// Why each pixel of a set of frames has no equations of its own; `Ok` where it has.
///
/// A pixel is usable when its jet's neighbourhood lies in the frame and depends on no sample that is masked
/// out or not finite; smoothing widens the dependence by its radius.
#[derive(Debug)]
pub(super) struct Support {
    status: Frame<Status>,
}

impl Support {
    /// Examines every sample of every frame. `spread`: radius of a smoothing to come, px.
    pub fn new<T: SimdReal>(frames: &[&Frame<T>], mask: Option<&Mask>, reach: Reach, spread: usize) -> Self {
        let size = frames[0].size();
        let is_finite = |x: usize, y: usize| frames.iter().all(|f| f.get(x, y).finite());
        let broken = !frames.iter().all(|f| all_finite(f));
        let broken = broken.then(|| MaskCounts::new(&Frame::from_fn(size.0, size.1, is_finite)));
        let masked = mask.filter(|m| m.data().iter().any(|used| !used)).map(MaskCounts::new);
        let [left, right, up, down] = [reach.left, reach.right, reach.up, reach.down].map(|side| side + spread);
        let wide = Reach { left, right, up, down };
        let status = Frame::from_fn(size.0, size.1, |x, y| {
            let touches = |counts: &Option<MaskCounts>| counts.as_ref().is_some_and(|c| c.touches((x, y), wide));
            if !reach.fits((x, y), size) {
                Status::Border
            } else if touches(&masked) {
                Status::Masked
            } else if touches(&broken) {
                Status::NonFinite
            } else {
                Status::Ok
            }
        });
        Self { status }
    }

    /// Status of a pixel.
    pub fn status(&self, x: usize, y: usize) -> Status {
        self.status.get(x, y)
    }

    /// Why a pixel with equations of its own has too few neighbours with theirs.
    pub fn lack(&self, x: usize, y: usize, radius: usize) -> Status {
        let (w, h) = self.status.size();
        let columns = x.saturating_sub(radius)..(x + radius + 1).min(w);
        let has = |s: &Status| {
            let mut rows = y.saturating_sub(radius)..(y + radius + 1).min(h);
            rows.any(|y| self.status.row(y)[columns.clone()].contains(s))
        };
        [Status::Masked, Status::NonFinite].into_iter().find(has).unwrap_or(Status::Border)
    }

    /// Writes 1 for usable and 0 for other pixels of row `y` from column `first` on; both may lie outside the
    /// frame.
    pub fn weights<T: Real>(&self, first: isize, y: isize, out: &mut [T]) {
        let row = usize::try_from(y).ok().filter(|y| *y < self.status.height()).map_or(&[][..], |y| self.status.row(y));
        for (weight, x) in out.iter_mut().zip(first..) {
            let status = usize::try_from(x).ok().and_then(|x| row.get(x));
            *weight = T::from_f64(f64::from(status == Some(&Status::Ok)));
        }
    }
}
