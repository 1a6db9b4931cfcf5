//! Four rows of four neighbours for every lane, summed down their columns.
//!
//! Hardware gathers take as long as one load a value. A patch row is contiguous: here it is one load, and the
//! four lanes' sums are transposed at the end. Where the lanes' patches are adjacent, a row of all is one
//! load.
//!
//! # Safety
//! As in the parent module: these functions are reached only through lane types, which exist only on
//! processors that have their instructions. Every patch is checked to lie inside the plane before it is read.

#[allow(clippy::wildcard_imports)]
use core::arch::x86_64::*;

/// Where a patch begins, checked: all sixteen values lie inside a plane of `len` values.
#[inline(always)]
fn start(len: usize, stride: usize, column: i32, row: i32) -> usize {
    let start = (row as usize).wrapping_mul(stride).wrapping_add(column as usize);
    let reach = stride.saturating_mul(3).saturating_add(4);
    assert!(reach <= len && start <= len - reach, "a patch lies inside its plane");
    start
}

/// One patch of singles, summed down.
///
/// # Safety
/// The processor must have FMA, and `start` must come from [`start`] for this plane and stride.
#[inline(always)]
unsafe fn single(plane: &[f32], stride: usize, start: usize, weights: [f32; 4]) -> __m128 {
    // SAFETY: the caller got `start` from the function of that name for this plane.
    unsafe {
        let first = plane.as_ptr().add(start);
        let sum = _mm_mul_ps(_mm_loadu_ps(first), _mm_set1_ps(weights[0]));
        let sum = _mm_fmadd_ps(_mm_loadu_ps(first.add(stride)), _mm_set1_ps(weights[1]), sum);
        let sum = _mm_fmadd_ps(_mm_loadu_ps(first.add(2 * stride)), _mm_set1_ps(weights[2]), sum);
        _mm_fmadd_ps(_mm_loadu_ps(first.add(3 * stride)), _mm_set1_ps(weights[3]), sum)
    }
}

/// One patch of doubles, summed down.
///
/// # Safety
/// The processor must have AVX and FMA, and `start` must come from [`start`] for this plane and stride.
#[inline(always)]
unsafe fn double(plane: &[f64], stride: usize, start: usize, weights: [f64; 4]) -> __m256d {
    // SAFETY: the caller got `start` from the function of that name for this plane.
    unsafe {
        let first = plane.as_ptr().add(start);
        let sum = _mm256_mul_pd(_mm256_loadu_pd(first), _mm256_set1_pd(weights[0]));
        let sum = _mm256_fmadd_pd(_mm256_loadu_pd(first.add(stride)), _mm256_set1_pd(weights[1]), sum);
        let sum = _mm256_fmadd_pd(_mm256_loadu_pd(first.add(2 * stride)), _mm256_set1_pd(weights[2]), sum);
        _mm256_fmadd_pd(_mm256_loadu_pd(first.add(3 * stride)), _mm256_set1_pd(weights[3]), sum)
    }
}

/// The sum of lane `l`'s patch; `columns`, `rows` and `weights` are arrays with a value a lane.
macro_rules! patch {
    ($one:ident, $plane:ident, $stride:ident, $columns:ident, $rows:ident, $weights:ident, $l:expr) => {{
        let start = start($plane.len(), $stride, $columns[$l], $rows[$l]);
        $one($plane, $stride, start, [$weights[0][$l], $weights[1][$l], $weights[2][$l], $weights[3][$l]])
    }};
}

/// Whether every patch begins one column right of the one before, as along a row that moves together.
#[inline(always)]
fn are_adjacent<const LANES: usize>(columns: &[i32; LANES], rows: &[i32; LANES]) -> bool {
    let apart = |l: usize| columns[l].wrapping_sub(columns[0]).wrapping_sub(l as i32) | (rows[l] ^ rows[0]);
    (0..LANES).fold(0, |so_far, l| so_far | apart(l)) == 0
}

/// The sums of adjacent patches, which share their rows: one load for all lanes.
macro_rules! adjacent {
    ($load:ident, $mul:ident, $fmadd:ident, $plane:ident, $stride:ident, $columns:ident, $rows:ident, $weights:ident) => {{
        // Where the first and the last lie inside the plane, so do those between.
        start($plane.len(), $stride, $columns[$columns.len() - 1], $rows[0]);
        let first = $plane.as_ptr().add(start($plane.len(), $stride, $columns[0], $rows[0]));
        let mut sums = $weights;
        for k in 0..4 {
            let sum = $mul($load(first.add(k)), $weights[0]);
            let sum = $fmadd($load(first.add($stride + k)), $weights[1], sum);
            let sum = $fmadd($load(first.add(2 * $stride + k)), $weights[2], sum);
            sums[k] = $fmadd($load(first.add(3 * $stride + k)), $weights[3], sum);
        }
        sums
    }};
}

/// The four column sums of the patch of each of eight singles; panics where a patch leaves the plane.
///
/// # Safety
/// The processor must have AVX2 and FMA.
#[inline(always)]
pub(super) unsafe fn f32x8(
    plane: &[f32],
    stride: usize,
    column: __m256,
    row: __m256,
    weights: [__m256; 4],
) -> [__m256; 4] {
    let (mut columns, mut rows, mut down) = ([0i32; 8], [0i32; 8], [[0f32; 8]; 4]);
    // SAFETY: see the module's note; every store fills an array of its size.
    unsafe {
        _mm256_storeu_si256(columns.as_mut_ptr().cast(), _mm256_cvttps_epi32(column));
        _mm256_storeu_si256(rows.as_mut_ptr().cast(), _mm256_cvttps_epi32(row));
        if are_adjacent(&columns, &rows) {
            return adjacent!(_mm256_loadu_ps, _mm256_mul_ps, _mm256_fmadd_ps, plane, stride, columns, rows, weights);
        }
        for j in 0..4 {
            _mm256_storeu_ps(down[j].as_mut_ptr(), weights[j]);
        }
        let mut sums = [_mm256_setzero_ps(); 4];
        for l in 0..4 {
            let low = patch!(single, plane, stride, columns, rows, down, l);
            let high = patch!(single, plane, stride, columns, rows, down, l + 4);
            sums[l] = _mm256_set_m128(high, low);
        }
        let (a, b) = (_mm256_unpacklo_ps(sums[0], sums[1]), _mm256_unpacklo_ps(sums[2], sums[3]));
        let (c, d) = (_mm256_unpackhi_ps(sums[0], sums[1]), _mm256_unpackhi_ps(sums[2], sums[3]));
        [
            _mm256_shuffle_ps::<0x44>(a, b),
            _mm256_shuffle_ps::<0xEE>(a, b),
            _mm256_shuffle_ps::<0x44>(c, d),
            _mm256_shuffle_ps::<0xEE>(c, d),
        ]
    }
}

/// The four column sums of the patch of each of sixteen singles; panics where a patch leaves the plane.
///
/// # Safety
/// The processor must have AVX-512 F and DQ, and FMA.
#[inline(always)]
pub(super) unsafe fn f32x16(
    plane: &[f32],
    stride: usize,
    column: __m512,
    row: __m512,
    weights: [__m512; 4],
) -> [__m512; 4] {
    let (mut columns, mut rows, mut down) = ([0i32; 16], [0i32; 16], [[0f32; 16]; 4]);
    // SAFETY: see the module's note; every store fills an array of its size.
    unsafe {
        _mm512_storeu_si512(columns.as_mut_ptr().cast(), _mm512_cvttps_epi32(column));
        _mm512_storeu_si512(rows.as_mut_ptr().cast(), _mm512_cvttps_epi32(row));
        if are_adjacent(&columns, &rows) {
            return adjacent!(_mm512_loadu_ps, _mm512_mul_ps, _mm512_fmadd_ps, plane, stride, columns, rows, weights);
        }
        for j in 0..4 {
            _mm512_storeu_ps(down[j].as_mut_ptr(), weights[j]);
        }
        let mut sums = [_mm512_setzero_ps(); 4];
        for l in 0..4 {
            let sum = _mm512_castps128_ps512(patch!(single, plane, stride, columns, rows, down, l));
            let sum = _mm512_insertf32x4::<1>(sum, patch!(single, plane, stride, columns, rows, down, l + 4));
            let sum = _mm512_insertf32x4::<2>(sum, patch!(single, plane, stride, columns, rows, down, l + 8));
            sums[l] = _mm512_insertf32x4::<3>(sum, patch!(single, plane, stride, columns, rows, down, l + 12));
        }
        let (a, b) = (_mm512_unpacklo_ps(sums[0], sums[1]), _mm512_unpacklo_ps(sums[2], sums[3]));
        let (c, d) = (_mm512_unpackhi_ps(sums[0], sums[1]), _mm512_unpackhi_ps(sums[2], sums[3]));
        [
            _mm512_shuffle_ps::<0x44>(a, b),
            _mm512_shuffle_ps::<0xEE>(a, b),
            _mm512_shuffle_ps::<0x44>(c, d),
            _mm512_shuffle_ps::<0xEE>(c, d),
        ]
    }
}

/// Rows to columns.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
unsafe fn transpose(sums: [__m256d; 4]) -> [__m256d; 4] {
    // SAFETY: see the module's note.
    unsafe {
        let (a, b) = (_mm256_unpacklo_pd(sums[0], sums[1]), _mm256_unpackhi_pd(sums[0], sums[1]));
        let (c, d) = (_mm256_unpacklo_pd(sums[2], sums[3]), _mm256_unpackhi_pd(sums[2], sums[3]));
        [
            _mm256_permute2f128_pd::<0x20>(a, c),
            _mm256_permute2f128_pd::<0x20>(b, d),
            _mm256_permute2f128_pd::<0x31>(a, c),
            _mm256_permute2f128_pd::<0x31>(b, d),
        ]
    }
}

/// The four column sums of the patch of each of four doubles; panics where a patch leaves the plane.
///
/// # Safety
/// The processor must have AVX2 and FMA.
#[inline(always)]
pub(super) unsafe fn f64x4(
    plane: &[f64],
    stride: usize,
    column: __m256d,
    row: __m256d,
    weights: [__m256d; 4],
) -> [__m256d; 4] {
    let (mut columns, mut rows, mut down) = ([0i32; 4], [0i32; 4], [[0f64; 4]; 4]);
    // SAFETY: see the module's note; every store fills an array of its size.
    unsafe {
        _mm_storeu_si128(columns.as_mut_ptr().cast(), _mm256_cvttpd_epi32(column));
        _mm_storeu_si128(rows.as_mut_ptr().cast(), _mm256_cvttpd_epi32(row));
        if are_adjacent(&columns, &rows) {
            return adjacent!(_mm256_loadu_pd, _mm256_mul_pd, _mm256_fmadd_pd, plane, stride, columns, rows, weights);
        }
        for j in 0..4 {
            _mm256_storeu_pd(down[j].as_mut_ptr(), weights[j]);
        }
        let mut sums = [_mm256_setzero_pd(); 4];
        for l in 0..4 {
            sums[l] = patch!(double, plane, stride, columns, rows, down, l);
        }
        transpose(sums)
    }
}

/// The four column sums of the patch of each of eight doubles; panics where a patch leaves the plane.
///
/// # Safety
/// The processor must have AVX-512 F, AVX2 and FMA.
#[inline(always)]
pub(super) unsafe fn f64x8(
    plane: &[f64],
    stride: usize,
    column: __m512d,
    row: __m512d,
    weights: [__m512d; 4],
) -> [__m512d; 4] {
    let (mut columns, mut rows, mut down) = ([0i32; 8], [0i32; 8], [[0f64; 8]; 4]);
    // SAFETY: see the module's note; every store fills an array of its size.
    unsafe {
        _mm256_storeu_si256(columns.as_mut_ptr().cast(), _mm512_cvttpd_epi32(column));
        _mm256_storeu_si256(rows.as_mut_ptr().cast(), _mm512_cvttpd_epi32(row));
        if are_adjacent(&columns, &rows) {
            return adjacent!(_mm512_loadu_pd, _mm512_mul_pd, _mm512_fmadd_pd, plane, stride, columns, rows, weights);
        }
        for j in 0..4 {
            _mm512_storeu_pd(down[j].as_mut_ptr(), weights[j]);
        }
        let (mut low, mut high) = ([_mm256_setzero_pd(); 4], [_mm256_setzero_pd(); 4]);
        for l in 0..4 {
            low[l] = patch!(double, plane, stride, columns, rows, down, l);
            high[l] = patch!(double, plane, stride, columns, rows, down, l + 4);
        }
        let (low, high) = (transpose(low), transpose(high));
        let mut sums = [_mm512_setzero_pd(); 4];
        for k in 0..4 {
            sums[k] = _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(low[k]), high[k]);
        }
        sums
    }
}
