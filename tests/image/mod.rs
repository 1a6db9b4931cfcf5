//! Borders, smoothing, corners, jets, grey levels, sampling, preprocessing and pictures.

mod border;
mod corners;
mod cubic;
mod fill;
mod gradient;
mod jet_planes;
mod jet_stencil;
mod jet_time;
mod luminance;
mod picture;
mod picture_chart;
mod picture_clusters;
mod picture_diverging;
mod picture_grey;
mod picture_overlay;
mod picture_quiver;
mod picture_wheel;
mod preprocess;
mod pyramid;
mod quantise;
mod sample;
mod smooth;
mod spline;
mod structure_tensor;
