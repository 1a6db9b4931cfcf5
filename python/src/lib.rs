//! The Python binding: convert, detach from the interpreter, call, wrap.
#![allow(clippy::needless_pass_by_value, reason = "Python hands arguments over by value")]
#![allow(clippy::too_many_arguments, reason = "keyword options of Python functions")]
#![allow(clippy::type_complexity, reason = "what __reduce__ must return")]

mod arrays;
mod colour_arrays;
mod command;
mod dirichlet_mixture;
mod errors;
mod estimate;
mod field;
mod filters;
mod flow_filter;
mod frame_list;
mod frames;
mod gauss_markov;
mod image;
mod interrupt;
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
mod region;
mod samples;
mod scenes;
mod segment;
mod stereo;
mod stereo_track;
mod target_scenes;
mod track;

use pyo3::prelude::*;

/// Name and purpose of every heuristic that `JACOFLOW_WITHOUT` can switch off, for `benchmarks/ablation`.
#[cfg(feature = "ablation")]
#[pyfunction]
pub fn heuristics() -> Vec<(&'static str, &'static str)> {
    jacoflow::ablation::HEURISTICS.to_vec()
}

/// The compiled part of jacoflow. Import `jacoflow` instead.
#[pymodule(gil_used = false)]
mod _jacoflow {
    #[cfg(feature = "ablation")]
    #[pymodule_export]
    use super::heuristics;
    #[cfg(feature = "reference")]
    #[pymodule_export]
    use super::reference_track::{gradient_flow, kernels, mean_flow, tracker};
    #[pymodule_export]
    use super::{
        command::run_command_line,
        dirichlet_mixture::{mixture_dirichlet_densities, mixture_dirichlet_fit},
        errors::{FormatError, JacoflowError, MissingDependencyError, NotObservableError, NumericalError},
        estimate::{FlowEstimator, estimate, flow, restore_estimator},
        field::{FlowField, Measurement, quantities, restore_field, restore_measurement, status_names},
        filters::{
            ExtendedKalmanFilter, GaussianFilter, KalmanFilter, MerweScaledSigmaPoints, ParticleFilter,
            UnscentedKalmanFilter, resample, restore_extended, restore_kalman, restore_particle, restore_unscented,
        },
        flow_filter::{FlowFilter, restore_filter},
        frames::{PyFrameSource, open_frames, read_one_image, source_kind, write_frames},
        gauss_markov::PyGaussMarkovFilter,
        image::{luminance, quantise, smooth},
        io::{read_float_map, read_flow, write_float_map, write_flow},
        mixture::{mixture_densities, mixture_fit, mixture_partial_fit},
        motion3d::{
            motion3d_bound, motion3d_contact_map, motion3d_essential, motion3d_estimate, motion3d_estimate_field,
            motion3d_field_points, motion3d_focus, motion3d_lateral, motion3d_lateral_bound, motion3d_predict,
        },
        observability::{classify, observability},
        particle_track::{PyParticleStep, PyParticleTracker, restore_step, restore_tracker, write_tables},
        points::{corners, point_flow},
        scenes::{Scene, Sensor, scene_carriers, scene_names, scene_parameters},
        segment::{segment_felzenszwalb, segment_region_means},
        stereo::{edge_disparity, edge_pixels, estimate_row_offset, read_disparity, write_disparity},
        stereo_track::{PyStereoTracker, PyTrackGraph, check_camera, restore_stereo_tracker},
        target_scenes::{TargetScene, target_scene_names},
        track::{PyGradientTracker, detect, restore_gradient_tracker},
    };

    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "Python's name of the attribute")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
