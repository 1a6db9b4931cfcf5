//! Flow filtered in time: the dense filter of WO2010/098160, (44)-(55), one small Kalman filter a pixel.
//!
//! [`recursive`] fuses the estimates of [`flow`](crate::flow) over time.
//!
//! [`dynamics`] is the dynamical system itself, for one pixel; [`FlowFilter`] runs it for every site of a
//! frame, many pixels at once.

pub mod dynamics;
mod flow_filter;
mod kernel;
mod measurement;
mod options;
mod pass;
mod persist;
pub mod recursive;
mod store;

pub use flow_filter::FlowFilter;
pub use options::{FilterForm, FlowFilterOptions, SquareRoot, Transition};
pub use persist::SavedFilter;
pub use recursive::{RecursiveFusion, RecursiveOptions};
