//! Published values, degenerate scenes and promises.

mod by_name;
mod confidence;
mod contradicted;
mod degenerate;
mod dense;
mod displaced;
mod estimators;
mod movers;
mod narrow;
mod outliers;
mod patches;
mod published;
pub(super) mod scenes;
mod sideways;
mod silent;
mod statuses;
mod strays;
mod together;
