//! What is given and what is estimated, in the order of the data.
//!
//! `input` (points, flow, noise, camera) and `options` hold what is given. `rows` writes a point's flow as
//! `f = nu G u + R w`, finite displacements too; `whitening` scales the rows to unit noise and `observations`
//! holds them as planes. `measurement` is one point or patch by itself. `motion` is what is estimated,
//! `result` what is returned.

pub(crate) mod input;
pub(crate) mod measurement;
pub(crate) mod motion;
pub(crate) mod observations;
pub(crate) mod options;
pub(crate) mod result;
pub(crate) mod rows;
pub(crate) mod whitening;
