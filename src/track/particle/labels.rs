//! Which target a corner track belongs to.

use super::corners::Track;
use super::geometry::{CentredBox, distance, holds};
use crate::math::median;

/// A label is kept, and gained, inside the target's box enlarged by this.
const KEEP: f64 = 1.3;
/// A track gains a label only above this probability of not being background.
const MIN_FOREGROUND: f64 = 0.7;
/// Below this probability of not being background a track is doubtful.
const DOUBTFUL: f64 = 0.3;
/// Greatest difference between a track's motion and its target's when it gains a label, px/frame at 480 rows.
const GAIN_DIFFERENCE: f64 = 3.6;
/// A motion differs from another by more than this, px/frame at 480 rows.
const DIFFERENT: f64 = 2.4;
/// A motion agrees with another up to this, px/frame at 480 rows.
const ALIKE: f64 = 1.2;
/// If more than this share would lose its label at once, the target itself has changed its motion.
const MAX_LOSS: f64 = 0.6;

/// What the labels need of a target.
#[derive(Debug, Clone, Copy)]
pub(super) struct Labelled {
    pub id: u64,
    /// Its box: predicted before the frame, estimated after it.
    pub bounds: CentredBox,
    /// Its velocity relative to the background, px/frame.
    pub velocity: [f64; 2],
    /// Whether it is hidden.
    pub is_hidden: bool,
    /// Whether its colours are unlike those it usually has.
    pub is_unlike: bool,
}

/// Withdraws labels that contradict the new motion.
pub(super) fn review(tracks: &mut [Track], targets: &[Labelled], scale: f64) {
    for own in targets {
        let mine: Vec<usize> = (0..tracks.len()).filter(|&j| tracks[j].owner == Some(own.id)).collect();
        let inside_other =
            |track: &Track| targets.iter().any(|l| l.id != own.id && holds(l.bounds, track.position, 1.0, 0.0));
        let jumps = |track: &Track| crate::ablation::keeps("particle.jumping_tracks") && has_jumped(track, scale);
        let leaving: Vec<usize> = mine.iter().copied().filter(|&j| jumps(&tracks[j])).collect();
        if !crate::ablation::keeps("particle.mass_loss") || leaving.len() as f64 <= MAX_LOSS * mine.len() as f64 {
            for j in leaving {
                tracks[j].owner = None;
            }
        }
        let left: Vec<usize> = mine.into_iter().filter(|&j| tracks[j].owner.is_some()).collect();
        let Some(middle) = median_residual(&left.iter().map(|&j| &tracks[j]).collect::<Vec<_>>()) else { continue };
        for j in left {
            let track = &tracks[j];
            let doubtful = track.foreground < DOUBTFUL;
            let deviates = track.residual.is_none_or(|r| distance(r, middle) > ALIKE * scale);
            if crate::ablation::keeps("particle.doubtful_tracks") && deviates && (doubtful || inside_other(track))
                || crate::ablation::keeps("particle.unlike_tracks") && own.is_unlike && doubtful
            {
                tracks[j].owner = None;
            }
        }
    }
}

/// Whether a track's motion differs from its own in the frame before.
fn has_jumped(track: &Track, scale: f64) -> bool {
    match (track.residual, track.last_residual) {
        (Some(now), Some(last)) => distance(now, last) > DIFFERENT * scale,
        _ => false,
    }
}

/// Middle motion of some tracks relative to the background, px/frame.
pub(super) fn median_residual(tracks: &[&Track]) -> Option<[f64; 2]> {
    let along = |i: usize| median(&mut tracks.iter().filter_map(|track| Some(track.residual?[i])).collect::<Vec<_>>());
    Some([along(0)?, along(1)?])
}

/// Gives and takes labels after a frame, by the estimated boxes.
pub(super) fn assign(tracks: &mut [Track], targets: &[Labelled], scale: f64) {
    for track in tracks {
        if let Some(owner) = track.owner {
            let stays = targets.iter().any(|own| own.id == owner && holds(own.bounds, track.position, KEEP, 0.0));
            if stays {
                continue;
            }
            track.owner = None;
        }
        let mut around = targets.iter().filter(|target| holds(target.bounds, track.position, KEEP, 0.0));
        let (Some(own), None, Some(residual)) =
            (around.next(), around.next().filter(|_| crate::ablation::keeps("particle.single_box")), track.residual)
        else {
            continue;
        };
        let fits = holds(own.bounds, track.position, 1.0, 0.0)
            && track.foreground > MIN_FOREGROUND
            && distance(residual, own.velocity) < GAIN_DIFFERENCE * scale;
        if fits && !own.is_hidden {
            track.owner = Some(own.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(position: [f64; 2], residual: [f64; 2], foreground: f64, owner: Option<u64>) -> Track {
        let residual = Some(residual);
        Track { id: 0, position, flow: [0.0; 2], residual, last_residual: residual, foreground, owner }
    }

    fn target(id: u64, x: f64, velocity: [f64; 2]) -> Labelled {
        Labelled { id, bounds: [x, 50.0, 20.0, 40.0], velocity, is_hidden: false, is_unlike: false }
    }

    #[test]
    fn labels_are_gained_inside_one_box_only() {
        let targets = [target(1, 50.0, [2.0, 0.0]), target(2, 73.0, [-2.0, 0.0])];
        let mut tracks = [
            track([45.0, 50.0], [2.0, 0.0], 0.9, None),
            track([61.5, 50.0], [2.0, 0.0], 0.9, None),
            track([45.0, 50.0], [2.0, 0.0], 0.5, None),
            track([45.0, 50.0], [-3.0, 0.0], 0.9, None),
            track([62.0, 50.0], [2.0, 0.0], 0.1, Some(1)),
            track([90.0, 50.0], [2.0, 0.0], 0.1, Some(1)),
        ];
        assign(&mut tracks, &targets, 1.0);
        assert_eq!(tracks.map(|track| track.owner), [Some(1), None, None, None, Some(1), None]);
        let hidden = [Labelled { is_hidden: true, ..targets[0] }];
        let mut tracks = [track([45.0, 50.0], [2.0, 0.0], 0.9, None)];
        assign(&mut tracks, &hidden, 1.0);
        assert_eq!(tracks[0].owner, None);
    }
}
