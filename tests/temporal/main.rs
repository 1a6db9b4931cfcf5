//! Flow over time: the flow filter, and estimates of steady motion fused.

// Printed on purpose: the figures reached are part of the answer.
#![allow(clippy::print_stdout)]

mod dynamics;
mod filter_forms;
mod flow_filter;
mod fusion;
mod recursive;
