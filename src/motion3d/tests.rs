//! Published values, degenerate scenes and promises.

mod confidence;
mod degenerate;
mod dense;
mod displaced;
mod estimators;
mod narrow;
mod outliers;
mod patches;
mod published;
pub(super) mod scenes;
mod silent;
mod together;
