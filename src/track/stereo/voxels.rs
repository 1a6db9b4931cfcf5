//! Edge pixels with a disparity, counted in a grid of voxels.

use super::options::VoxelGrid;
use crate::types::Frame;

/// Mark of a voxel that nothing is in.
const EMPTY: u32 = u32::MAX;
/// Largest change of a disparity by refinement, px: half a pixel between candidates, one by Lucas-Kanade.
const MAX_REFINEMENT: f64 = 1.5;

/// Edge pixels of the left view with their disparities: points `(x, y, d)`.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct EdgePoints {
    /// Columns x, px, N of them.
    pub columns: Vec<u32>,
    /// Rows y, px, N of them.
    pub rows: Vec<u32>,
    /// Disparities, px, finite, N of them.
    pub disparities: Vec<f32>,
}

impl EdgePoints {
    /// Every finite value of a disparity map (H, W), row by row.
    pub fn from_map(disparity: &Frame<f32>) -> Self {
        let mut points = Self::default();
        for y in 0..disparity.height() {
            for (x, &d) in disparity.row(y).iter().enumerate().filter(|(_, d)| d.is_finite()) {
                points.columns.push(x as u32);
                points.rows.push(y as u32);
                points.disparities.push(d);
            }
        }
        points
    }

    /// Those whose disparity is in one of the grid's layers, and how many others there were.
    pub(super) fn within(self, lattice: &Lattice) -> (Self, usize) {
        let all = self.len();
        let held: Vec<bool> = self.disparities.iter().map(|&d| lattice.holds(f64::from(d))).collect();
        if held.iter().all(|held| *held) {
            return (self, 0);
        }
        let kept =
            |values: Vec<u32>| values.into_iter().zip(&held).filter(|(_, held)| **held).map(|(v, _)| v).collect();
        let disparities = self.disparities.into_iter().zip(&held).filter(|(_, held)| **held).map(|(d, _)| d).collect();
        let points = Self { columns: kept(self.columns), rows: kept(self.rows), disparities };
        let left_out = all - points.len();
        (points, left_out)
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.disparities.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.disparities.is_empty()
    }

    /// Point `i` as `(x, y, d)`, px.
    pub fn at(&self, i: usize) -> [f64; 3] {
        [f64::from(self.columns[i]), f64::from(self.rows[i]), f64::from(self.disparities[i])]
    }
}

/// The grid laid over frames of one size.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Lattice {
    pub grid: VoxelGrid,
    /// Size of the frames `(width, height)`, px.
    pub size: (usize, usize),
}

impl Lattice {
    /// Size of a cell along x, y (px) and d (disparity).
    pub fn cell(&self) -> [f64; 3] {
        [self.size.0 as f64 / self.grid.columns as f64, self.size.1 as f64 / self.grid.rows as f64, 1.0]
    }

    /// Column of cells of each column of pixels: `floor(80 x / W)`.
    pub fn cell_columns(&self) -> Vec<u16> {
        (0..self.size.0).map(|x| (x * self.grid.columns / self.size.0) as u16).collect()
    }

    /// Row of cells of each row of pixels: `floor(60 y / H)`.
    pub fn cell_rows(&self) -> Vec<u16> {
        (0..self.size.1).map(|y| (y * self.grid.rows / self.size.1) as u16).collect()
    }

    /// Whether a disparity is in one of the layers: as far beyond the first and the last one as fractions of
    /// a pixel may lead from a whole disparity that was looked for.
    pub fn holds(&self, disparity: f64) -> bool {
        let from_first = disparity - f64::from(self.grid.first_disparity);
        (-MAX_REFINEMENT..=self.grid.layers as f64 + MAX_REFINEMENT).contains(&from_first)
    }

    /// Layer of a disparity: `round(d)` less the first, the ends taken in.
    pub fn layer(&self, disparity: f64) -> u16 {
        (disparity.round() - f64::from(self.grid.first_disparity)).clamp(0.0, self.grid.layers as f64 - 1.0) as u16
    }

    /// Place in the dense grid of a voxel.
    pub fn index(&self, [x, y, z]: [u16; 3]) -> usize {
        (usize::from(z) * self.grid.rows + usize::from(y)) * self.grid.columns + usize::from(x)
    }

    /// The voxel at real coordinates in px and disparity; `None` outside the grid.
    pub fn voxel_at(&self, [x, y, d]: [f64; 3]) -> Option<[u16; 3]> {
        let (width, height) = (self.size.0 as f64, self.size.1 as f64);
        // Pixels reach half a pixel to each side of their centre.
        let (x, y) = (x + 0.5, y + 0.5);
        let inside = (0.0..width).contains(&x) && (0.0..height).contains(&y);
        let z = d.round() - f64::from(self.grid.first_disparity);
        if !inside || !(0.0..=self.grid.layers as f64).contains(&z) {
            return None;
        }
        let [cx, cy, _] = self.cell();
        let last = [self.grid.columns - 1, self.grid.rows - 1, self.grid.layers - 1];
        let at = [x / cx, y / cy, z];
        Some(std::array::from_fn(|i| (at[i] as usize).min(last[i]) as u16))
    }

    /// Cells along x, y and disparity in which an edge pixel at real coordinates would be counted; along x
    /// and y also outside of the picture.
    pub fn cell_at(&self, [x, y, d]: [f64; 3]) -> [f64; 3] {
        let [cx, cy, _] = self.cell();
        [(x.round() / cx).floor(), (y.round() / cy).floor(), f64::from(self.layer(d))]
    }

    /// A voxel moved by whole cells; `None` outside the grid.
    pub fn shifted(&self, voxel: [u16; 3], by: [i32; 3]) -> Option<[u16; 3]> {
        let size = [self.grid.columns, self.grid.rows, self.grid.layers];
        let mut out = [0; 3];
        for i in 0..3 {
            let at = i32::from(voxel[i]) + by[i];
            if at < 0 || at >= size[i] as i32 {
                return None;
            }
            out[i] = at as u16;
        }
        Some(out)
    }

    /// From coordinates in cells (voxel centres at whole numbers) to px and disparity.
    pub fn pixels_of(&self, at: [f64; 3]) -> [f64; 3] {
        let [cx, cy, _] = self.cell();
        [(at[0] + 0.5) * cx - 0.5, (at[1] + 0.5) * cy - 0.5, at[2] + f64::from(self.grid.first_disparity)]
    }

    /// From px and disparity to coordinates in cells, the other way round.
    pub fn cells_of(&self, at: [f64; 3]) -> [f64; 3] {
        let [cx, cy, _] = self.cell();
        [(at[0] + 0.5) / cx - 0.5, (at[1] + 0.5) / cy - 0.5, at[2] - f64::from(self.grid.first_disparity)]
    }

    /// Voxels of the dense grid.
    pub fn volume(&self) -> usize {
        self.grid.columns * self.grid.rows * self.grid.layers
    }
}

/// The voxels that are not empty, with how many points are in each.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Voxels {
    pub lattice: Lattice,
    /// `(ix, iy, iz)` of each, in the order in which the points meet them.
    pub cells: Vec<[u16; 3]>,
    /// Mean depth of the points in each, layers from the first one's middle.
    pub depths: Vec<f64>,
    /// Points in each: its frequency.
    pub counts: Vec<u32>,
    /// The voxel of each point.
    pub of_point: Vec<u32>,
}

impl Voxels {
    /// Counts the points.
    pub fn count(points: &EdgePoints, lattice: Lattice) -> Self {
        let (columns, rows) = (lattice.cell_columns(), lattice.cell_rows());
        let mut dense = vec![EMPTY; lattice.volume()];
        let of_point = Vec::with_capacity(points.len());
        let mut out = Self { lattice, cells: vec![], depths: vec![], counts: vec![], of_point };
        for i in 0..points.len() {
            let cell = [
                columns[points.columns[i] as usize],
                rows[points.rows[i] as usize],
                lattice.layer(f64::from(points.disparities[i])),
            ];
            let slot = &mut dense[lattice.index(cell)];
            if *slot == EMPTY {
                *slot = out.cells.len() as u32;
                out.cells.push(cell);
                out.depths.push(0.0);
                out.counts.push(0);
            }
            out.depths[*slot as usize] += lattice.cells_of(points.at(i))[2];
            out.counts[*slot as usize] += 1;
            out.of_point.push(*slot);
        }
        out.depths.iter_mut().zip(&out.counts).for_each(|(depth, &count)| *depth /= f64::from(count));
        out
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Centres in cells, row-major (N, 3), as the mixture takes them.
    pub fn centres(&self) -> Vec<f64> {
        self.cells.iter().flatten().map(|&i| f64::from(i)).collect()
    }

    /// Where voxel `n` is, cells: its centre along x and y, the mean of its points in depth.
    pub fn place(&self, n: usize) -> [f64; 3] {
        let [x, y, _] = self.cells[n];
        if !crate::ablation::keeps("stereo.mean_depths") {
            return self.cells[n].map(f64::from);
        }
        [f64::from(x), f64::from(y), self.depths[n]]
    }

    /// Places in cells, row-major (N, 3). Depths are means: whole layers would make components as thin as a
    /// layer, and those of flat objects would not explain their own noise.
    pub fn places(&self) -> Vec<f64> {
        (0..self.cells.len()).flat_map(|n| self.place(n)).collect()
    }

    /// Frequencies as weights.
    pub fn weights(&self) -> Vec<f64> {
        self.counts.iter().map(|&n| f64::from(n)).collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The default grid over 640 x 480.
    pub fn lattice() -> Lattice {
        Lattice { grid: VoxelGrid::default(), size: (640, 480) }
    }

    #[test]
    fn points_fall_into_the_voxels_of_the_definition() {
        let points = EdgePoints {
            columns: vec![0, 7, 8, 639],
            rows: vec![0, 7, 8, 479],
            disparities: vec![-40.0, -40.3, -39.4, 24.0],
        };
        let voxels = Voxels::count(&points, lattice());
        assert_eq!(voxels.cells, [[0, 0, 0], [1, 1, 1], [79, 59, 63]]);
        for i in 0..points.len() {
            let cell = voxels.cells[voxels.of_point[i] as usize];
            assert_eq!(lattice().cell_at(points.at(i)), cell.map(f64::from));
        }
        let place = voxels.place(0);
        assert!(place[..2] == [0.0, 0.0] && (place[2] + 0.15).abs() < 1e-6);
        assert_eq!(voxels.places()[6..], [79.0, 59.0, 64.0]);
        assert_eq!((voxels.counts, voxels.of_point), (vec![2, 1, 1], vec![0, 0, 1, 2]));
    }

    #[test]
    fn what_no_layer_holds_is_left_out_and_counted() {
        let points = |disparities: &[f32]| EdgePoints {
            columns: (1..=disparities.len() as u32).collect(),
            rows: vec![2; disparities.len()],
            disparities: disparities.to_vec(),
        };
        // The last of 64 layers from -40 holds 24 too; refined, what was found there may be 1.5 px farther.
        let (kept, left_out) = points(&[-41.6, -41.5, 0.0, 25.4, 25.6, 90.0]).within(&lattice());
        assert_eq!((kept.disparities, kept.columns, kept.rows), (vec![-41.5, 0.0, 25.4], vec![2, 3, 4], vec![2; 3]));
        assert_eq!(left_out, 3);
        assert_eq!(points(&[-40.0, 24.0]).within(&lattice()), (points(&[-40.0, 24.0]), 0));
    }
}
