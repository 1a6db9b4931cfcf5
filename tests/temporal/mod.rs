//! Flow over time: the flow filter, and estimates of steady motion fused.

mod dynamics;
mod filter_forms;
mod flow_filter;
mod fusion;
mod recursive;
