//! Which pixels have equations at all.

use crate::flow::site::MaskCounts;
use crate::image::all_finite;
use crate::jet::Reach;
use crate::math::Real;
use crate::simd::SimdReal;
use crate::types::{Frame, Mask, Status};

/// Usable pixels of a set of frames.
///
/// A pixel is usable when its jet's neighbourhood lies in the frame and depends on no sample that is masked
/// out or not finite; smoothing widens the dependence by its radius.
#[derive(Debug)]
pub(super) struct Support {
    size: (usize, usize),
    reach: Reach,
    /// Damaged pixels, where there are any.
    damage: Option<Frame<Status>>,
}

impl Support {
    /// Examines every sample of every frame. `spread`: radius of a smoothing to come, px.
    pub fn new<T: SimdReal>(frames: &[&Frame<T>], mask: Option<&Mask>, reach: Reach, spread: usize) -> Self {
        let size = frames[0].size();
        let finite = frames.iter().all(|f| all_finite(f));
        let masked = mask.filter(|m| m.data().iter().any(|used| !used));
        if finite && masked.is_none() {
            return Self { size, reach, damage: None };
        }
        let [left, right, up, down] = [reach.left, reach.right, reach.up, reach.down].map(|side| side + spread);
        let wide = Reach { left, right, up, down };
        let is_finite = |x: usize, y: usize| frames.iter().all(|f| f.get(x, y).finite());
        let broken = (!finite).then(|| MaskCounts::new(&Frame::from_fn(size.0, size.1, is_finite)));
        let masked = masked.map(MaskCounts::new);
        let damage = Frame::from_fn(size.0, size.1, |x, y| {
            if masked.as_ref().is_some_and(|counts| counts.touches((x, y), wide)) {
                Status::Masked
            } else if broken.as_ref().is_some_and(|counts| counts.touches((x, y), wide)) {
                Status::NonFinite
            } else {
                Status::Ok
            }
        });
        Self { size, reach, damage: Some(damage) }
    }

    /// No pixel is damaged: the usable pixels are a rectangle.
    pub fn is_whole(&self) -> bool {
        self.damage.is_none()
    }

    /// Why pixel `(x, y)` has no equations of its own; `Ok` where it has.
    pub fn status(&self, x: usize, y: usize) -> Status {
        if self.reach.fits((x, y), self.size) {
            self.damage.as_ref().map_or(Status::Ok, |d| d.get(x, y))
        } else {
            Status::Border
        }
    }

    /// Why a pixel with equations of its own has too few neighbours with theirs.
    pub fn lack(&self, x: usize, y: usize, radius: usize) -> Status {
        let Some(damage) = &self.damage else { return Status::Border };
        let (w, h) = self.size;
        let rows = y.saturating_sub(radius)..(y + radius + 1).min(h);
        let columns = x.saturating_sub(radius)..(x + radius + 1).min(w);
        let any = |s: Status| rows.clone().any(|y| damage.row(y)[columns.clone()].contains(&s));
        if any(Status::Masked) {
            Status::Masked
        } else if any(Status::NonFinite) {
            Status::NonFinite
        } else {
            Status::Border
        }
    }

    /// Columns and rows inside which a neighbourhood lies in the frame.
    pub fn inside(&self) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        self.reach.inside(self.size)
    }

    /// Writes 1 for usable and 0 for other pixels of row `y` from column `first` on; both may lie outside the
    /// frame.
    pub fn weights<T: Real>(&self, first: isize, y: isize, out: &mut [T]) {
        out.fill(T::default());
        let (columns, rows) = self.inside();
        let Some(y) = usize::try_from(y).ok().filter(|y| rows.contains(y)) else { return };
        let from = (columns.start as isize - first).clamp(0, out.len() as isize) as usize;
        let to = (columns.end as isize - first).clamp(from as isize, out.len() as isize) as usize;
        out[from..to].fill(T::from_f64(1.0));
        if let Some(damage) = &self.damage {
            let row = damage.row(y);
            for (i, weight) in out.iter_mut().enumerate().take(to).skip(from) {
                if row[(first + i as isize) as usize] != Status::Ok {
                    *weight = T::default();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_spreads_by_the_reach_and_names_its_cause() {
        let reach = Reach { left: 1, right: 1, up: 1, down: 1 };
        let mut frame = Frame::filled(9, 8, 1.0f32);
        let whole = Support::new(&[&frame], None, reach, 0);
        assert!(whole.is_whole() && whole.status(0, 3) == Status::Border && whole.status(1, 1) == Status::Ok);
        frame.data_mut()[4 * 9 + 4] = f32::INFINITY;
        let mut mask = Frame::filled(9, 8, true);
        mask.data_mut()[2 * 9 + 7] = false;
        let support = Support::new(&[&frame], Some(&mask), reach, 0);
        for y in 1..7usize {
            for x in 1..8usize {
                let want = if x.abs_diff(7) <= 1 && y.abs_diff(2) <= 1 {
                    Status::Masked
                } else if x.abs_diff(4) <= 1 && y.abs_diff(4) <= 1 {
                    Status::NonFinite
                } else {
                    Status::Ok
                };
                assert_eq!(support.status(x, y), want, "{x} {y}");
            }
        }
        let mut row = [7.0f32; 12];
        support.weights(-2, 4, &mut row);
        assert_eq!(row, [0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
        support.weights(-2, -1, &mut row);
        assert_eq!(row, [0.0; 12]);
        assert_eq!(Support::new(&[&frame], None, reach, 1).status(2, 2), Status::NonFinite);
    }
}
