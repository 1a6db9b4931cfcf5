//! From source to sink: frames, pairs and colour frames through estimators and trackers to files.

mod output;
mod particle;
mod run;
mod sink_table;
mod stereo;
mod stereo_times;
mod track;
mod track_overlay;
