//! Graph segmentation of images.

mod segment;
