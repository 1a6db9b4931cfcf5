//! Graph segmentation of images.

mod graph;
