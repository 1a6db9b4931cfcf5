//! Classical methods, for comparison only. They give `(u, v)` and no Jacobian.

mod horn_schunck;
mod lucas_kanade;
mod pair;

pub(super) use horn_schunck::HornSchunck;
pub use horn_schunck::{HornSchunckOptions, Smoothness};
pub(super) use lucas_kanade::LucasKanade;
pub use lucas_kanade::{LucasKanadeOptions, Window};
pub use pair::Differences;
