//! Switches heuristics off, one at a time, so that a table can show what each of them buys.
//!
//! A heuristic is a rule that the specification's equations do not contain: a repair of a start, an
//! exception, a second search, a threshold, a filler of gaps. Each has a line in [`HEURISTICS`] and one call
//! of [`keeps`] where it acts. Without the feature `ablation` every call is the constant `true`; with it the
//! environment variable `JACOFLOW_WITHOUT` lists the names that are off. `benchmarks/ablation` prints the
//! table.

/// The heuristics of all systems: name (`system.rule`) and what the rule is for.
pub const HEURISTICS: &[(&str, &str)] = &[
    ("motion3d.single_noise", "of few points one motion in larger noise is compared with a selection"),
    ("motion3d.second_motion", "the rejected points are searched for a motion of their own"),
    ("motion3d.many_outliers", "among many outliers candidates are refined with outlier posteriors"),
    ("motion3d.outlier_mixture", "the last step weighs points by their outlier posterior"),
    ("motion3d.larger_noise", "noise of the inliers that exceeds the given one inflates the covariance"),
    ("motion3d.residual_structure", "structured residuals are explained by two motions"),
    ("motion3d.hidden_object", "a motion of all points but one region is reported beside one of all"),
    ("motion3d.leverage", "few points that decide alone are reported as few_points"),
    ("motion3d.region_by_chance", "directions that residuals alone exclude are compared by depths and scores"),
    ("motion3d.sampled_start", "where the motion found does not explain the flow, that of minimal samples is tried"),
    ("motion3d.basins", "starts from a few steps on a few points"),
    ("flow.brightness_change", "gain and offset between frames are measured and removed"),
    ("flow.weighted_median", "beside motion boundaries a weighted median of the flow is tried"),
    ("flow.sufficient_median", "a median that explains half of the residual is taken without a gain"),
    ("flow.last_two_frames", "beside motion boundaries three frames take the motion of the last two"),
    ("flow.variational_refinement", "the flow of pixels moves where that explains the frames better than windows do"),
    ("flow.refinement_error", "what the refinement moves the flow by widens its covariance"),
    ("flow.boundary_error", "jumps of the motion nearby widen the covariance"),
    ("flow.detail_bias", "motion that the finest detail of the frames contradicts over wide windows is moved"),
    ("flow.detail_scatter", "differences with and without the finest detail widen the covariance"),
    ("flow.step", "the flow moves by what smoothed frames leave of it in narrow windows beyond chance"),
    ("flow.unrelated_frames", "frames that differ as independent noise does are contradicted everywhere"),
    ("flow.step_scatter", "steps where the finest detail disagrees are shorter"),
    ("flow.step_side", "narrow frames take no step"),
    ("flow.wide_remainder", "chance is compared in wide surroundings, too, before what is left widens the covariance"),
    ("flow.coarse_constraints", "coarser levels determine the motion where their own data do"),
    ("flow.nearby_level_errors", "errors of coarse levels are those of the sites around, not of the frame"),
    ("flow.unresolved_motion", "motions of single sites that residuals show widen the covariance"),
    ("flow.remainder", "what the frames leave of the flow in narrow windows widens its covariance"),
    ("flow.continuation", "the motion of sites without data is reflected at the nearest ones with data"),
    ("flow.block_matches", "blocks are searched for on a coarse level"),
    ("flow.coarse_peak_locking", "peak locking is removed on every level before its motion is carried down"),
    ("flow.robust_peak_locking", "patches that scatter have little weight in peak locking"),
    ("edges.contrast", "gain between the cameras is estimated and taken out"),
    ("edges.refused_cost", "matches of a high cost are refused"),
    ("edges.watched_rows", "a known row offset is estimated again where a pair contradicts it"),
    ("edges.second_pass", "the row offset is estimated twice"),
    ("edges.believed_rows", "a row offset is kept only if the views agree with it"),
    ("stereo.exposure_levels", "a large change of exposure is read off the deciles of brightness"),
    ("stereo.exposure_motion", "exposure from pixels whose motion is known, then motion again"),
    ("stereo.own_pixels", "the middle is of pixels that show the own surface"),
    ("stereo.second_way", "Lucas-Kanade by two ways through the levels"),
    ("stereo.beside_start", "Lucas-Kanade from the motion of the component beside"),
    ("stereo.successors", "components are renamed by mutual overlap"),
    ("stereo.join_pieces", "pieces of a surface are joined after a cold start"),
    ("stereo.part", "components that hold several objects are parted after a cold start"),
    ("stereo.outlier_voxels", "voxels that nothing explains are not fitted"),
    ("stereo.reseed", "components without pixels are seeded in what is not explained"),
    ("stereo.another_scene", "a cold start where most pixels are not explained"),
    ("stereo.left_over", "a component of leftovers keeps its track"),
    ("stereo.repeated", "a repeated frame is recognised"),
    ("stereo.coast", "a steady track coasts through a jump"),
    ("stereo.sure_jump", "a jump is believed where it is well supported"),
    ("stereo.trusted_velocity", "the velocity follows measurements by their support"),
    ("stereo.larger_parts", "a mostly covered track passes to a larger part"),
    ("stereo.covered_position", "the position of a mostly covered track is extrapolated"),
    ("stereo.covered_extent", "what reappears of a partly covered object extends its component"),
    ("stereo.covered_tolerance", "a partly covered object may be farther off"),
    ("stereo.assumed_motion", "overlaps of what was not measured by the last motion or none"),
    ("stereo.widened", "carried components are widened by half a voxel"),
    ("stereo.approaching", "parts of what comes nearer differ in depth motion"),
    ("stereo.mean_depths", "voxels are at the mean depth of their points"),
    ("stereo.thin_blobs", "outlier blobs that are spread thinly get no seed"),
    ("particle.camera", "particles move with the background's affine motion"),
    ("particle.labels", "tracks remember their target"),
    ("particle.hidden", "hidden targets are recognised"),
    ("particle.contrast", "colours of the surroundings count less"),
    ("particle.values", "pixels without hue have bins of value"),
    ("particle.aspect", "width and height change together"),
    ("particle.quick_start", "half of the first particles take the motion of tracks"),
    ("particle.recovery", "a hidden target takes over a group of tracks"),
    ("particle.near_particles", "more particles while another target is near"),
    ("particle.touching_boxes", "targets whose boxes touch are near"),
    ("particle.clear_place", "a target that becomes hidden returns to where it was last clear"),
    ("particle.recovery_twin", "no recovery where two hidden targets overlap"),
    ("particle.recovery_other", "a group that fits another target is not taken over"),
    ("particle.background_penalty", "background tracks in the box count against a moving target"),
    ("particle.shared_tracks", "tracks in another box are shared by their motion"),
    ("particle.full_tracks", "many own tracks weigh no more than twenty"),
    ("particle.jumping_tracks", "a track that jumps loses its label"),
    ("particle.doubtful_tracks", "a deviating, doubtful track loses its label"),
    ("particle.unlike_tracks", "doubtful tracks lose their label while colours are unlike"),
    ("particle.mass_loss", "labels stay where most would be lost at once"),
    ("particle.visible_share", "boxes that leave the picture are less similar"),
    ("particle.hidden_noise", "hidden targets have less noise at first"),
    ("particle.returning", "tracks that move with a hidden target make it seen again"),
    ("particle.cut", "a cut hides all targets and clears labels"),
    ("particle.single_box", "a track gains a label inside one box only"),
    ("particle.covered", "a target half covered by another may be hidden"),
    ("gradient.adapting", "the support adapts up to 20 frames to a box that holds much background"),
    ("gradient.begun_cover", "an edge that begins to cover a large target has no vote"),
    ("gradient.beside", "behind the rim of the box the first frame is believed"),
    ("gradient.blank_frame", "a frame without the scene is passed over before anything was measured"),
    ("gradient.continue_template", "the template goes on outside the support"),
    ("gradient.damped", "acceleration is damped when the target becomes occluded"),
    ("gradient.detect_camera", "the scene is aligned while nothing has moved yet"),
    ("gradient.detect_ends", "what an even target covers and uncovers is one object"),
    ("gradient.dilated_mask", "points beside those without a vote have none"),
    ("gradient.emerging", "a target that was hidden in part from the start is located by the part that was seen"),
    ("gradient.explained", "what neither layer explains does not change the support"),
    ("gradient.first_extent", "the sides of the first box are kept up to a fifth"),
    ("gradient.held_back", "a large target may be held back by an edge that covers it"),
    ("gradient.hold_angle", "an angle that a frame does not determine is held"),
    ("gradient.hold_at_border", "a target that left the picture waits at its border"),
    ("gradient.known_if_large", "a large target may be occluded in its first frames"),
    ("gradient.lasting_cover", "what stays hidden for long is taken from the mean visibility"),
    ("gradient.light_gain", "a robust ratio of brightness is taken out"),
    ("gradient.light_offset", "a jump of the brightness level is taken out"),
    ("gradient.look_alike", "a similar object that touches the target has no vote"),
    ("gradient.look_alike_cooldown", "a similar object still disturbs in the next frames"),
    ("gradient.look_alike_stiff", "size and angle change less beside a similar object"),
    ("gradient.minimum_contrast", "a target fainter than the noise is not measured"),
    ("gradient.nearby_motion", "the motion of the scene around the target where it differs"),
    ("gradient.occlusion", "a target that something known covers is aligned by the rest"),
    ("gradient.opposite", "what frames leave open of the support is as at the opposite point"),
    ("gradient.oriented_box", "the box that hides the scene turns with the target"),
    ("gradient.outline_variance", "the covariance holds the error of the learned outline"),
    ("gradient.recall", "a target that vanishes goes on from its last good state"),
    ("gradient.reshaped", "an affine map where the outline changes otherwise"),
    ("gradient.resized", "another size of a target that was occluded for long"),
    ("gradient.restart_filter", "the filter starts again where a jump was found"),
    ("gradient.returning_size", "a target that comes out of cover is no smaller than it was"),
    ("gradient.returning_variance", "the covariance holds what may still be hidden"),
    ("gradient.round", "round targets do not determine their angle"),
    ("gradient.search", "a target that is not seen is searched for all around"),
    ("gradient.start_doubt", "the covariance holds the doubt about the first box"),
    ("gradient.start_drift", "in the first frames a target found off the displacement of what changed is found there"),
    ("gradient.start_occluder", "an object in front of half the first box is found"),
    ("gradient.start_refitted", "a first box that does not fit what moves is replaced"),
    ("gradient.sudden_background", "sudden changes of the background are learned slowly"),
    ("gradient.unsettled", "the covariance holds the motion of an outline that is still learned"),
    ("gradient.wild_frame", "a frame that differs from all before is passed over"),
    ("gradient.with_camera", "the target may move with the camera"),
    ("measure.uncertain_sites", "sites far less certain than the others of a region do not follow any motion"),
    ("measure.common_residual", "what residuals have in common over parts of a region widens its covariance"),
    ("measure.jacobian_change", "what Jacobians would change in the motion of a region widens its covariance"),
    ("measure.contradicted", "a motion has more sites than those whose estimates the frames contradict"),
    ("measure.scatter", "sites of one motion may differ beyond their covariances"),
    ("windowed.noise_dominated", "the covariance is inflated along directions that only noise determines"),
];

/// Whether the heuristic `name` acts.
#[cfg(not(feature = "ablation"))]
#[inline(always)]
pub const fn keeps(_name: &str) -> bool {
    true
}

/// Whether the heuristic `name` acts: not if `JACOFLOW_WITHOUT` lists it.
///
/// # Panics
///
/// If `name` or a listed name is not in [`HEURISTICS`].
#[cfg(feature = "ablation")]
pub fn keeps(name: &str) -> bool {
    static WITHOUT: std::sync::OnceLock<Vec<String>> = std::sync::OnceLock::new();
    let is_known = |name: &str| HEURISTICS.iter().any(|(known, _)| *known == name);
    let without = WITHOUT.get_or_init(|| {
        let listed = std::env::var("JACOFLOW_WITHOUT").unwrap_or_default();
        let names: Vec<String> = listed.split(',').filter(|name| !name.is_empty()).map(String::from).collect();
        for name in &names {
            assert!(is_known(name), "JACOFLOW_WITHOUT: expected names of HEURISTICS, got {name}");
        }
        names
    });
    debug_assert!(is_known(name), "{name}: a heuristic without a line in HEURISTICS");
    !without.iter().any(|off| off == name)
}
