//! The Python binding: convert, detach from the interpreter, call, wrap.
#![allow(clippy::needless_pass_by_value, reason = "Python hands arguments over by value")]
#![allow(clippy::too_many_arguments, reason = "keyword options of Python functions")]
#![allow(clippy::type_complexity, reason = "what __reduce__ must return")]

#[cfg(feature = "ablation")]
mod ablation;
mod arrays;
mod colour_arrays;
mod command;
mod dirichlet_mixture;
mod errors;
mod estimate;
mod field;
mod filters;
mod flow_filter;
mod frames;
mod gauss_markov;
mod image;
mod io;
mod keywords;
mod mixture;
mod motion3d;
mod observability;
mod options;
mod particle_track;
mod points;
mod progress;
#[cfg(feature = "reference")]
mod reference_track;
mod scenes;
mod segment;
mod stereo;
mod stereo_track;
mod target_scenes;
mod track;

use pyo3::prelude::*;

/// The compiled part of jacoflow. Import `jacoflow` instead.
#[pymodule(gil_used = false)]
mod _jacoflow {
    #[cfg(feature = "ablation")]
    #[pymodule_export]
    use super::ablation::heuristics;
    #[pymodule_export]
    use super::command::run_command_line;
    #[pymodule_export]
    use super::dirichlet_mixture::{mixture_dirichlet_densities, mixture_dirichlet_fit};
    #[pymodule_export]
    use super::errors::{FormatError, JacoflowError, MissingDependencyError, NotObservableError, NumericalError};
    #[pymodule_export]
    use super::estimate::{FlowEstimator, estimate, restore_estimator};
    #[pymodule_export]
    use super::field::{FlowField, quantities, restore_field, status_names};
    #[pymodule_export]
    use super::filters::{
        ExtendedKalmanFilter, GaussianFilter, KalmanFilter, MerweScaledSigmaPoints, ParticleFilter,
        UnscentedKalmanFilter, resample, restore_extended, restore_kalman, restore_particle, restore_unscented,
    };

    #[pymodule_export]
    use super::flow_filter::{FlowFilter, restore_filter};
    #[pymodule_export]
    use super::frames::{FrameReader, open_frames, read_one_image, write_frames};
    #[pymodule_export]
    use super::gauss_markov::PyGaussMarkovFilter;
    #[pymodule_export]
    use super::image::{luminance, quantise, smooth};
    #[pymodule_export]
    use super::io::{read_float_map, read_flow, write_float_map, write_flow};
    #[pymodule_export]
    use super::mixture::{mixture_densities, mixture_fit, mixture_partial_fit};
    #[pymodule_export]
    use super::motion3d::{
        motion3d_bound, motion3d_contact_map, motion3d_essential, motion3d_estimate, motion3d_estimate_field,
        motion3d_field_points, motion3d_focus, motion3d_lateral, motion3d_lateral_bound, motion3d_predict,
    };
    #[pymodule_export]
    use super::observability::{classify, observability};
    #[pymodule_export]
    use super::particle_track::{PyParticleStep, PyParticleTracker, restore_step, restore_tracker, write_tables};
    #[pymodule_export]
    use super::points::{corners, point_flow};
    #[cfg(feature = "reference")]
    #[pymodule_export]
    use super::reference_track::{flow, kernels, mean_flow, tracker};
    #[pymodule_export]
    use super::scenes::{Scene, Sensor, scene_carriers, scene_names, scene_parameters};
    #[pymodule_export]
    use super::segment::{segment_felzenszwalb, segment_region_means};
    #[pymodule_export]
    use super::stereo::{edge_disparity, edge_pixels, estimate_row_offset, read_disparity, write_disparity};
    #[pymodule_export]
    use super::stereo_track::{PyStereoTracker, PyTrackGraph};
    #[pymodule_export]
    use super::target_scenes::{TargetScene, target_scene_names};
    #[pymodule_export]
    use super::track::{PyGradientTracker, detect};

    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "Python's name of the attribute")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
