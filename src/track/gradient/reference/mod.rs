//! The paper's own loop, for comparison with the layered tracker (feature `reference`).
//!
//! Source: M. Chiba and S. Ozawa, "A Tracking Algorithm for a Video Target Using Gradient-Based Method"
//! (IPSJ), equations (1) to (26).
//!
//! A frame passes: derivative masks (`kernels`), the gradient equation in windows (`equations`), local flow
//! and its mean over what moves (`local_flow`), the ends of what moves (`extent`), and the loop that filters
//! and steers the window (`local_loop`).

mod equations;
mod extent;
mod kernels;
mod local_flow;
mod local_loop;
mod options;

pub use kernels::{DerivativeKernels, KernelMask, derivative_kernels};
pub use local_flow::{LocalFlow, MeanFlow, local_flow};
pub(super) use local_loop::LocalLoop;
pub use local_loop::SearchWindow;
pub use options::LocalFlowOptions;
pub use options::{Control, Method, ReferenceOptions};
