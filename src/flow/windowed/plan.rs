//! Which plane holds which product of a pixel's equations, and where its moments are.
//!
//! `u`, `v` are transported (multiplied by x and y), so products of their columns need six moments, those
//! with a column of the Jacobian three, those within the Jacobian one.

/// The planes of 6 columns, or of 2 with row 1 alone, which sees the Jacobian by transport only. Rows 2 and 3
/// have the columns of the derivatives along x and along y one each, so that their products are the same.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    pub columns: usize,
    /// Products of the flow with the Jacobian: 8, of which the equations have 6 different ones.
    mixed: usize,
    /// Products within the Jacobian: 10, 3 different ones beside zeros for rows 1 to 3, or none.
    inner: usize,
}

/// Planes of the larger plan.
pub(super) const MAX_PLANES: usize = Plan::of_rows(12).planes();
/// Products within the flow.
const FLOW: usize = 3;

impl Plan {
    /// For the equations of 1, 3, 6 or 12 rows a pixel.
    #[inline(always)]
    pub const fn of_rows(rows: usize) -> Self {
        match rows {
            1 => Self { columns: 2, mixed: 0, inner: 0 },
            3 => Self { columns: 6, mixed: 6, inner: 3 },
            _ => Self { columns: 6, mixed: 6, inner: 10 },
        }
    }
    /// For outer products of 2 or 6 columns.
    #[inline(always)]
    pub const fn outer(columns: usize) -> Self {
        if columns == 2 { Self::of_rows(1) } else { Self { columns, mixed: 8, inner: 10 } }
    }
    /// Plane of the product of columns `i <= j`; `None` where it is zero.
    #[inline(always)]
    pub const fn place(self, i: usize, j: usize) -> Option<usize> {
        if j < 2 {
            Some(i + j)
        } else if i < 2 {
            Some(FLOW + (self.mixed - 4) * i + j - 2)
        } else if self.inner == 10 {
            Some(FLOW + self.mixed + (i - 2) * (9 - i) / 2 + j - 2)
        } else if i / 2 == j / 2 {
            Some(FLOW + self.mixed + i % 2 + j % 2)
        } else {
            None
        }
    }
    /// Planes of products of two columns.
    #[inline(always)]
    pub const fn normal(self) -> usize {
        FLOW + self.mixed + self.inner
    }
    /// Plane of column `i` times the right-hand side.
    #[inline(always)]
    pub const fn right(self, i: usize) -> usize {
        self.normal() + i
    }
    /// Plane of the squared right-hand side.
    #[inline(always)]
    pub const fn energy(self) -> usize {
        self.right(self.columns)
    }
    /// Plane of the usable pixels.
    #[inline(always)]
    pub const fn weight(self) -> usize {
        self.energy() + 1
    }
    /// Plane of the squared brightness, which comes last.
    #[inline(always)]
    pub const fn brightness(self) -> usize {
        self.energy() + 2
    }
    /// All planes.
    #[inline(always)]
    pub const fn planes(self) -> usize {
        self.brightness() + 1
    }
    /// Highest power of an offset that plane `p` is weighted with.
    #[inline(always)]
    pub const fn order(self, p: usize) -> usize {
        let normal = self.normal();
        if p < FLOW {
            2
        } else if p >= normal {
            (p < normal + 2) as usize
        } else {
            (p < FLOW + self.mixed) as usize
        }
    }
    /// Where the moments of plane `p` begin in a list of all moments.
    #[inline(always)]
    pub const fn base(self, p: usize) -> usize {
        let (mut base, mut q) = (0, 0);
        while q < p {
            base += moments(self.order(q));
            q += 1;
        }
        base
    }
}

/// Number of moments up to a power: 1; 1, x, y; 1, x, y, x^2, x y, y^2.
#[inline(always)]
pub(super) const fn moments(order: usize) -> usize {
    (order + 1) * (order + 2) / 2
}
