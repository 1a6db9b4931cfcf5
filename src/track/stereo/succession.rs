//! Renumbers components so that each keeps the object that most of it moves with.
//!
//! Two components may share a flat object, a large one and a few pixels at its rim. Both explain it, the
//! sharper one wins; if that is the small one, it takes the object over.

use super::overlap::Row;

/// New number of each component: that of the component of the last step with which it shares most voxels, if
/// mutual and with an arc of at least `least`. The others keep their numbers if free, or get a remaining one.
///
/// `forward` and `backward`: overlaps of the components of both steps; `sizes`: their voxels. Shares alone do
/// not suffice: all of a few pixels, and all of a large object, go into the component that takes them over.
pub(super) fn successors(forward: &[Row], backward: &[Row], sizes: [&[usize]; 2], least: f64) -> Vec<usize> {
    let count = backward.len();
    if forward.len() != count {
        return (0..count).collect();
    }
    let arc = |from: usize, to: usize| forward[from][to] + backward[to][from];
    let [before, after] = sizes;
    let score =
        |from: usize, to: usize| forward[from][to] * before[from] as f64 + backward[to][from] * after[to] as f64;
    // Of equals a component's own.
    let strongest = |own: usize, score: &dyn Fn(usize) -> f64| {
        (0..count).fold(own, |best, other| if score(other) > score(best) { other } else { best })
    };
    let mut names = vec![None; count];
    let mut taken = vec![false; count];
    for from in 0..count {
        let to = strongest(from, &|to| score(from, to));
        if strongest(to, &|other| score(other, to)) == from && arc(from, to) >= least {
            names[to] = Some(from);
            taken[from] = true;
        }
    }
    for (k, name) in names.iter_mut().enumerate().filter(|(_, name)| name.is_none()) {
        if !taken[k] {
            *name = Some(k);
            taken[k] = true;
        }
    }
    let mut free = (0..count).filter(|k| !taken[*k]).collect::<Vec<_>>().into_iter();
    names.into_iter().map(|name| name.or_else(|| free.next()).expect("as many names as components")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Overlaps in both directions of three components, from the shares of each that meet each.
    fn named(shares: [[f64; 3]; 3]) -> Vec<usize> {
        let rows: Vec<Row> = shares.iter().map(|row| row.to_vec()).collect();
        let columns: Vec<Row> = (0..3).map(|j| shares.iter().map(|row| row[j]).collect()).collect();
        successors(&rows, &columns, [&[50; 3]; 2], 0.4)
    }

    #[test]
    fn all_of_a_few_pixels_counts_less_than_most_of_many() {
        // 1, of 20 voxels, takes over 0, of 300: all of its own and most of the other's are in it.
        let (forward, backward) = ([vec![0.05, 0.65], vec![0.0, 0.95]], [vec![1.0, 0.0], vec![0.25, 0.2]]);
        assert_eq!(successors(&forward, &backward, [&[300, 20], &[5, 320]], 0.4), [1, 0]);
        // Nothing of the sort where it lies in the other and stays what it is.
        let (forward, backward) = ([vec![0.8, 0.05], vec![0.3, 0.6]], [vec![0.8, 0.02], vec![0.3, 0.6]]);
        assert_eq!(successors(&forward, &backward, [&[300, 20], &[300, 20]], 0.4), [0, 1]);
    }

    #[test]
    fn who_takes_over_most_of_a_component_is_it() {
        assert_eq!(named([[0.9, 0.1, 0.0], [0.1, 0.8, 0.0], [0.0, 0.0, 1.0]]), [0, 1, 2]);
        // 1 takes over 0, which is left with what was 1's.
        assert_eq!(named([[0.1, 0.9, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 1.0]]), [1, 0, 2]);
        // In a ring.
        assert_eq!(named([[0.0, 0.9, 0.0], [0.0, 0.0, 0.8], [0.7, 0.0, 0.0]]), [2, 0, 1]);
    }
}
