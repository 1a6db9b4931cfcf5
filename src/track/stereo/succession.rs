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
