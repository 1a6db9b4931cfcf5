//! The description that ImageJ writes into the first page: axes, time between frames, size of a pixel.

use super::recording::{Axis, Recording, Sizes};
use crate::io::planes::PixelSize;
use std::collections::HashMap;

/// What the description says; `None` when it is not ImageJ's. `resolution`: pixels per unit along x and y.
///
/// A stack that is no hyperstack has one axis. ImageJ always calls it slices; it is taken for time.
pub(super) fn parse(description: &str, resolution: Option<(f64, f64)>) -> Option<Recording> {
    if !description.starts_with("ImageJ=") {
        return None;
    }
    let values: HashMap<&str, &str> = description.lines().filter_map(|line| line.split_once('=')).collect();
    let size = |name: &str| values.get(name).and_then(|n| n.trim().parse().ok()).filter(|&n| n > 0).unwrap_or(1);
    let number = |name: &str| values.get(name).and_then(|n| n.trim().parse().ok()).filter(|&v: &f64| v > 0.0);
    let mut sizes = Sizes { channels: size("channels"), slices: size("slices"), times: size("frames") };
    let is_hyperstack = values.get("hyperstack").is_some_and(|word| word.trim() == "true");
    if !is_hyperstack && sizes.channels == 1 && sizes.times == 1 {
        sizes = Sizes { channels: 1, slices: 1, times: sizes.slices.max(size("images")) };
    }
    let mut recording = Recording::in_order(sizes, [Axis::Channel, Axis::Slice, Axis::Time])?;
    let interval = number("finterval").and_then(|interval| Some(interval * seconds(values.get("tunit").copied())?));
    recording.frame_rate = interval.map(|interval| 1.0 / interval).or(number("fps")).filter(|rate| rate.is_finite());
    let unit = values.get("unit").map_or("", |unit| unit.trim());
    let same_unit = values.get("yunit").is_none_or(|y| y.trim() == unit);
    recording.pixel_size = resolution.filter(|_| same_unit).and_then(|(x, y)| PixelSize::new((1.0 / x, 1.0 / y), unit));
    Some(recording)
}

/// Seconds in a unit of time; `None` for an unknown one.
fn seconds(unit: Option<&str>) -> Option<f64> {
    match unit.map_or("s", str::trim) {
        "" | "s" | "sec" | "second" | "seconds" => Some(1.0),
        "ms" | "msec" => Some(1e-3),
        "us" | "\u{b5}s" | "\\u00B5s" => Some(1e-6),
        "min" | "minute" | "minutes" => Some(60.0),
        "h" | "hr" | "hour" | "hours" => Some(3600.0),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hyperstack_has_its_axes_time_and_scale() {
        let text = "ImageJ=1.53c\nimages=24\nchannels=2\nslices=3\nframes=4\nhyperstack=true\nunit=\\u00B5m\nfinterval=250\ntunit=ms\n";
        let recording = parse(text, Some((4.0, 2.0))).unwrap();
        assert_eq!(recording.sizes, Sizes { channels: 2, slices: 3, times: 4 });
        assert_eq!(recording.planes[recording.place(1, 2, 3)].page, Some(1 + 2 * 2 + 6 * 3));
        assert_eq!(recording.frame_rate, Some(4.0));
        assert_eq!(recording.pixel_size, PixelSize::new((0.25, 0.5), "\u{b5}m"));
    }

    #[test]
    fn a_plain_stack_is_a_sequence() {
        for text in ["ImageJ=1.53c\nimages=5\nslices=5\nfps=7.0\n", "ImageJ=1.11a\nimages=5\nfps=7\n"] {
            let recording = parse(text, Some((72.0, 72.0))).unwrap();
            assert_eq!(recording.sizes, Sizes { channels: 1, slices: 1, times: 5 });
            assert_eq!((recording.frame_rate, recording.pixel_size), (Some(7.0), None));
        }
    }

    #[test]
    fn others_and_nonsense_are_not_taken() {
        assert_eq!(parse("frames=3", None), None);
        let huge = format!("ImageJ=1\nchannels={0}\nslices={0}\nframes={0}\nhyperstack=true", usize::MAX);
        assert_eq!(parse(&huge, None), None);
        let sizes = parse("ImageJ=1\nchannels=-2\nframes=x", None).unwrap().sizes;
        assert_eq!(sizes, Sizes { channels: 1, slices: 1, times: 1 });
    }
}
