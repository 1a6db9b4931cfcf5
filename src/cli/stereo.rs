//! `jacoflow stereo`: the disparity of two views' edge pixels, pair after pair.

use super::arguments::TellArguments;
use super::interrupt::Watch;
use super::progress::Bar;
use super::report::{Report, tell};
use crate::error::{Error, Result};
use crate::image::picture::{GreyRange, draw_disparity};
use crate::io::{Colour, DisparityFormat, DisparityMap, FrameSource, NumberedFiles, OpenOptions, open, write_picture};
use crate::parallel::{Progress, Threads};
use crate::pipeline::{check_target, is_folder};
use crate::stereo::{EdgeDisparity, EdgeDisparityOptions, Method, edge_disparity, estimate_row_offset};
use crate::track::GreyLevels;
use crate::types::{AnyFrame, Frame};
use clap::{Args, ValueEnum};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Where both views are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Layout {
    /// In two inputs
    Separate,
    /// In one frame, the left view in its left half
    SideBySide,
    /// In one frame, the left view in its upper half
    TopBottom,
}

/// How views are matched.
#[derive(Debug, Args)]
#[command(next_help_heading = "Method")]
pub struct MatchingArguments {
    /// How views are matched: sgm (gradients along chains of edge pixels, fractions of a px) or classes (directions in a window, whole px)
    #[arg(long, value_name = "NAME", default_value = "sgm")]
    pub method: String,
    /// Least and greatest disparity, px
    #[arg(long, value_name = "LEAST,GREATEST", default_value = "-40,24", allow_hyphen_values = true, value_parser = parse_range)]
    pub disparities: (i32, i32),
    /// Least and greatest row offset that are searched, rows
    #[arg(long, value_name = "LEAST,GREATEST", default_value = "-4,4", allow_hyphen_values = true, value_parser = parse_range)]
    pub rows: (i32, i32),
    /// How many rows lower the right view shows a point [default: estimated from the first pair (sgm), searched at every pixel (classes)]
    #[arg(long, value_name = "ROWS")]
    pub row_offset: Option<f64>,
    /// Whole disparities (sgm)
    #[arg(long)]
    pub whole: bool,
    /// Keep what matching from the right view does not confirm too (sgm)
    #[arg(long)]
    pub unchecked: bool,
    /// Least slope of an edge, grey levels/px
    #[arg(long, value_name = "SLOPE", default_value_t = 2.0)]
    pub threshold: f64,
}

/// Options of `stereo`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "Disparity is x_left - x_right in px, NaN where there is none; a point at (x, y) on the left is at (x - d, y + row offset) on the right.\n\
    npz holds disparity, score and row_offset; pfm disparity alone, infinite where there is none; kitti is a 16-bit PNG of 256 d, for 0 < d < 256.\n\
    Brightness is taken on the scale 0 to 255: 16-bit samples are divided by 257, floats that do not exceed 1.5 in the first view multiplied by 255.\n\n\
    Examples:\n  \
    jacoflow stereo left/ right/ -o out/ --format npz,pfm --picture pictures/\n  \
    jacoflow stereo l.png r.png -o d.pfm --disparities 0,63 --row-offset 0\n  \
    jacoflow stereo film.y4m --layout side-by-side -o out/ --method classes"
)]
pub struct StereoCommand {
    /// The left and the right view: folders, images, .y4m or .npy files; one of them that holds both with --layout
    #[arg(required = true, value_name = "VIEW", num_args = 1..=2, help_heading = "Input")]
    pub input: Vec<String>,
    /// Where both views are
    #[arg(long, value_enum, value_name = "HOW", default_value = "separate", help_heading = "Input")]
    pub layout: Layout,
    /// Convert colour to luminance (0.299 R + 0.587 G + 0.114 B); without it colour is refused
    #[arg(long, help_heading = "Input")]
    pub luminance: bool,
    /// Index of the first pair to use
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Input")]
    pub first: usize,
    /// Use at most this many pairs
    #[arg(long, value_name = "N", help_heading = "Input")]
    pub limit: Option<usize>,
    /// Use every N-th pair
    #[arg(long, value_name = "N", default_value = "1", help_heading = "Input", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub step: usize,
    #[command(flatten)]
    pub matching: MatchingArguments,
    /// A folder (for disparity_000000.npz, ...), or for one pair a .npz, .pfm or .png (kitti) file
    #[arg(long, short, value_name = "OUT", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Formats in a folder: npz (everything), pfm, kitti [default: npz]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', help_heading = "Output")]
    pub format: Vec<String>,
    /// Draw disparities in colour over every left view, blue far to red near: a folder for stereo_000000.png, ...
    #[arg(long, value_name = "FOLDER", help_heading = "Output")]
    pub picture: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Number of threads; the result does not depend on it [default: JACOFLOW_THREADS, else every processor]
    #[arg(long, value_name = "N", help_heading = "Computation", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub threads: Option<usize>,
    #[command(flatten)]
    pub tell: TellArguments,
}

/// What was done.
#[derive(Debug, Default)]
struct Done {
    pairs: usize,
    files: usize,
    /// Disparities, and those that a format could not hold.
    found: usize,
    lost: usize,
    row_offset: Option<f64>,
}

/// Both views, one pair after the other.
enum Views {
    Two([Box<dyn FrameSource>; 2]),
    One(Box<dyn FrameSource>, Layout),
}

impl StereoCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let options = self.options()?;
        let formats = self.formats()?;
        self.check_output(&formats)?;
        let mut views = self.views()?;
        let mut done = Done::default();
        let failure = {
            let bar = Bar::new(watch, "stereo", self.tell.quiet);
            self.run(&mut views, options, &formats, &bar, &mut done).err()
        };
        let interrupted = matches!(failure, Some(Error::Interrupted));
        if !self.tell.quiet && (failure.is_none() || interrupted) {
            tell(&done.in_words());
        }
        let summary = json!({
            "command": "stereo", "method": self.matching.method, "pairs": done.pairs, "files": done.files, "disparities": done.found,
            "not_held": done.lost, "row_offset": done.row_offset, "output": self.output, "picture": self.picture, "interrupted": interrupted,
        });
        Ok(Report { summary, failure })
    }

    /// How views are matched, checked.
    fn options(&self) -> Result<EdgeDisparityOptions> {
        let options = EdgeDisparityOptions {
            method: Method::parse(&self.matching.method)?,
            disparity_range: self.matching.disparities,
            row_range: self.matching.rows,
            row_offset: self.matching.row_offset,
            subpixel: !self.matching.whole,
            check: !self.matching.unchecked,
            threshold: self.matching.threshold,
            threads: Threads::new(self.threads)?,
            ..EdgeDisparityOptions::default()
        };
        options.check()?;
        Ok(options)
    }

    /// The formats to write: by the name of a file, or those listed for a folder.
    fn formats(&self) -> Result<Vec<DisparityFormat>> {
        let listed: Vec<_> = self.format.iter().map(|name| DisparityFormat::parse(name)).collect::<Result<_>>()?;
        let Some(output) = &self.output else {
            if self.picture.is_none() && !self.tell.json {
                return Err(Error::argument("output", "-o OUT, --picture FOLDER or --json", "none of them"));
            }
            return Ok(Vec::new());
        };
        if is_folder(output) {
            return Ok(if listed.is_empty() { vec![DisparityFormat::Npz] } else { listed });
        }
        match DisparityFormat::of(output) {
            Some(format) if listed.iter().all(|other| *other == format) => Ok(vec![format]),
            Some(_) => {
                Err(Error::argument("output", "a folder for other formats than the file's name says", output.display()))
            }
            None => Err(Error::argument("output", "a folder, or a .npz, .pfm or .png file", output.display())),
        }
    }

    /// Refuses what could only fail after work has been done.
    fn check_output(&self, formats: &[DisparityFormat]) -> Result<()> {
        for path in self.output.iter().chain(&self.picture) {
            if path.exists() && is_folder(path) && !path.is_dir() {
                return Err(Error::argument("output", "a folder", path.display()));
            }
            let occupied = path.read_dir().is_ok_and(|mut entries| entries.next().is_some());
            if is_folder(path) && occupied && !self.force {
                let wanted = "an empty or new folder (--force writes into it)";
                return Err(Error::argument("output", wanted, path.display()));
            }
        }
        match &self.output {
            Some(file) if !is_folder(file) && !formats.is_empty() => check_target(file, self.force),
            _ => Ok(()),
        }
    }

    /// Opens the input.
    fn views(&self) -> Result<Views> {
        let colour = if self.luminance { Colour::Luminance } else { Colour::Error };
        let mut options = OpenOptions::default();
        (options.colour, options.first, options.limit, options.step) = (colour, self.first, self.limit, self.step);
        match (&self.input[..], self.layout) {
            ([left, right], Layout::Separate) => Ok(Views::Two([open(left, &options)?, open(right, &options)?])),
            ([both], Layout::SideBySide | Layout::TopBottom) => Ok(Views::One(open(both, &options)?, self.layout)),
            (input, Layout::Separate) => Err(Error::argument("input", "two views, or --layout for one", input.len())),
            (input, _) => Err(Error::argument("input", "one input that holds both views", input.len())),
        }
    }

    /// Matches every pair and writes what was asked for.
    fn run(
        &self,
        views: &mut Views,
        mut options: EdgeDisparityOptions,
        formats: &[DisparityFormat],
        bar: &Bar<'_>,
        done: &mut Done,
    ) -> Result<()> {
        let total = views.len_hint();
        if let Some(file) = self.output.as_deref().filter(|path| total > 1 && !is_folder(path)) {
            return Err(Error::argument("output", format!("a folder for {total} pairs"), file.display()));
        }
        let mut scale = None;
        loop {
            bar.step(done.pairs, total)?;
            let Some([left, right]) = views.next()? else { break };
            let (levels, range) = *scale.get_or_insert_with(|| (GreyLevels::decide(&left), GreyRange::of(&left)));
            let pair = [&left, &right].map(|view| levels.convert(view).map(|&value| value as f32));
            if options.method == Method::SemiGlobal && options.row_offset.is_none() {
                options.row_offset = Some(estimate_row_offset(&pair[0], &pair[1], &options)?);
            }
            let found = edge_disparity(&pair[0], &pair[1], &options)?;
            let index = self.first + done.pairs * self.step;
            if let Some(folder) = &self.picture {
                let mut picture = range.picture(&left);
                let (least, greatest) = options.disparity_range;
                draw_disparity(&mut picture, &found.disparity, (f64::from(least), f64::from(greatest)));
                write_picture(NumberedFiles::create(folder, "stereo", "png")?.path(index), &picture)?;
                done.files += 1;
            }
            done.found += found.rows.len();
            done.row_offset.get_or_insert(found.row_offset);
            self.write(&found, index, formats, done)?;
            done.pairs += 1;
        }
        if done.pairs == 0 {
            return Err(Error::argument("input", "at least one pair of views", "none"));
        }
        Ok(())
    }

    /// Writes the disparities of one pair.
    fn write(&self, found: &EdgeDisparity, index: usize, formats: &[DisparityFormat], done: &mut Done) -> Result<()> {
        let Some(output) = &self.output else { return Ok(()) };
        if !is_folder(output) && done.pairs > 0 {
            return Err(Error::argument("output", "a folder for several pairs", output.display()));
        }
        let mut score = found.disparity.clone();
        for ((&row, &column), &value) in found.rows.iter().zip(&found.columns).zip(&found.scores) {
            score.row_mut(row as usize)[column as usize] = value;
        }
        let (disparity, row_offset) = (found.disparity.clone(), Some(found.row_offset));
        let map = DisparityMap { disparity, score: Some(score), row_offset };
        for format in formats {
            let path = if is_folder(output) {
                NumberedFiles::create(output, "disparity", format.extension())?.path(index)
            } else {
                output.clone()
            };
            done.lost += format.write(Path::new(&path), &map)?;
            done.files += 1;
        }
        Ok(())
    }
}

impl Done {
    /// The summary for people.
    fn in_words(&self) -> String {
        let per_pair = self.found / self.pairs.max(1);
        let mut words = format!("{} pairs, {per_pair} disparities each, {} files", self.pairs, self.files);
        if let Some(rows) = self.row_offset {
            words += &format!(", row offset {rows:.2}");
        }
        if self.lost > 0 {
            words += &format!("; {} disparities do not fit the kitti format (above 0 and below 256 px)", self.lost);
        }
        words
    }
}

impl Views {
    /// How many pairs are left, 0 where that is unknown.
    fn len_hint(&self) -> usize {
        match self {
            Self::Two([left, _]) => left.len_hint(),
            Self::One(both, _) => both.len_hint(),
        }
        .unwrap_or(0)
    }

    /// The next pair; none after the last.
    fn next(&mut self) -> Result<Option<[AnyFrame; 2]>> {
        match self {
            Self::Two([left, right]) => match (left.next_frame()?, right.next_frame()?) {
                (Some(left), Some(right)) => Ok(Some([left, right])),
                (None, None) => Ok(None),
                (ended, _) => {
                    let got = if ended.is_none() { "fewer left than right" } else { "fewer right than left" };
                    Err(Error::argument("input", "as many left views as right ones", got))
                }
            },
            Self::One(both, layout) => both.next_frame()?.map(|frame| halves(&frame, *layout)).transpose(),
        }
    }
}

/// Both views of a frame that holds them.
fn halves(frame: &AnyFrame, layout: Layout) -> Result<[AnyFrame; 2]> {
    match frame {
        AnyFrame::U8(frame) => Ok(cut(frame, layout)?.map(AnyFrame::U8)),
        AnyFrame::U16(frame) => Ok(cut(frame, layout)?.map(AnyFrame::U16)),
        AnyFrame::F32(frame) => Ok(cut(frame, layout)?.map(AnyFrame::F32)),
        AnyFrame::F64(frame) => Ok(cut(frame, layout)?.map(AnyFrame::F64)),
    }
}

/// The left or upper half, and the other one.
fn cut<T: Copy>(frame: &Frame<T>, layout: Layout) -> Result<[Frame<T>; 2]> {
    let (width, height) = frame.size();
    let beside = layout == Layout::SideBySide;
    let divided = if beside { width } else { height };
    if !divided.is_multiple_of(2) {
        return Err(Error::argument(
            "layout",
            "frames of an even width (side-by-side) or height (top-bottom)",
            divided,
        ));
    }
    let (w, h) = if beside { (width / 2, height) } else { (width, height / 2) };
    let (dx, dy) = if beside { (w, 0) } else { (0, h) };
    Ok([0, 1].map(|half| Frame::from_fn(w, h, |x, y| frame.get(x + half * dx, y + half * dy))))
}

fn parse_range(text: &str) -> std::result::Result<(i32, i32), String> {
    let ends = text.split_once(',').and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
    ends.filter(|(least, greatest)| least <= greatest)
        .ok_or_else(|| "expected LEAST,GREATEST, two whole numbers".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_two_whole_numbers_in_order() {
        assert_eq!(parse_range("-40, 24"), Ok((-40, 24)));
        assert!(parse_range("3,2").is_err() && parse_range("3").is_err() && parse_range("1.5,2").is_err());
    }

    #[test]
    fn frames_are_cut_in_halves() {
        let frame = Frame::from_fn(4, 2, |x, y| 10 * y + x);
        let [left, right] = cut(&frame, Layout::SideBySide).unwrap();
        assert_eq!((left.data(), right.data()), (&[0, 1, 10, 11][..], &[2, 3, 12, 13][..]));
        let [upper, lower] = cut(&frame, Layout::TopBottom).unwrap();
        assert_eq!((upper.data(), lower.data()), (&[0, 1, 2, 3][..], &[10, 11, 12, 13][..]));
        assert!(cut(&Frame::filled(3, 2, 0), Layout::SideBySide).unwrap_err().to_string().starts_with("layout: "));
    }
}
