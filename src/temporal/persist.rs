//! Saving and resuming.
