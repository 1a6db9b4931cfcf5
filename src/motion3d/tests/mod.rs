//! Published values, degenerate scenes and promises.

mod confidence;
mod correlated_noise;
mod degenerate;
mod dense_points;
mod estimators;
mod finite_rotation;
mod lateral;
mod maximum_likelihood;
mod moving_objects;
mod narrow_fields;
mod noisy_depths;
mod outlier_posterior;
mod outliers;
mod patches;
mod published;
mod rotation_prior;
pub(crate) mod scenes;
mod statuses;
