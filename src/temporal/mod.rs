//! Flow filtered in time.
//!
//! * [`FlowFilter`], the dense filter of WO2010/098160, (44)-(55): one small Kalman filter a pixel. A frame
//!   passes `measurement` (jets of the frame), `kernel` (prediction and update of many pixels at once) and
//!   `flow_filter` (the field); `store` holds the states, `persist` saves them; `smoother` joins two filters,
//!   one of which runs backwards. `any_filter` chooses the precision by the first frame.
//! * [`FlowStream`] estimates [`flow`](crate::flow) from frames that come one by one; [`recursive`] fuses its
//!   estimates over time.

mod any_filter;
mod any_stream;
mod flow_filter;
mod kernel;
mod measurement;
mod options;
mod persist;
pub mod recursive;
mod smoother;
mod store;
mod stream;

pub use any_filter::AnyFlowFilter;
pub use any_stream::{AnyFlowStream, Stream};
pub use flow_filter::FlowFilter;
pub use options::{FilterForm, FlowFilterOptions, SquareRoot, Transition};
pub use persist::SavedFilter;
pub use recursive::{RecursiveFusion, RecursiveOptions};
pub use stream::{FlowStream, StreamPlan};
