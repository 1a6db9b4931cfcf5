//! `jacoflow stereo`: the disparity of two views' edge pixels, pair after pair.

use super::arguments::{LayoutArguments, MessageArguments, SearchArguments, SelectionArguments, ThreadArguments};
use super::interrupt::Watch;
use super::paths::CommandPaths;
use super::progress::Bar;
use super::report::{Report, print_message};
use crate::error::{Error, Result};
use crate::image::{Preprocess, picture::GreyRange, picture::draw_disparity};
use crate::io::{DisparityFormat, DisparityMap, NumberedFiles, write_picture};
use crate::parallel::Threads;
use crate::pipeline::{GreyPair, GreyPairs, Numbering, check_target, is_folder};
use crate::stereo::{EdgeDisparity, EdgeDisparityOptions, Method, SequenceRows};
use clap::Args;
use serde_json::json;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// How views are matched.
#[derive(Debug, Args)]
#[command(next_help_heading = "Method")]
pub struct MatchingArguments {
    /// How views are matched: sgm (gradients along chains of edge pixels, fractions of a px) or classes
    /// (directions in a window, whole px)
    #[arg(long, value_name = "NAME", default_value = "sgm")]
    pub method: String,
    #[command(flatten)]
    pub search: SearchArguments,
    /// Whole disparities (sgm)
    #[arg(long)]
    pub no_subpixel: bool,
    /// Keep what matching from the right view does not confirm too (sgm)
    #[arg(long)]
    pub no_left_right_check: bool,
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
    Brightness is taken on the scale 0 to 255: 16-bit samples are divided by 257, floats multiplied by 255 unless at least half of what is not dark (above 0.1) exceeds 1.5.\n\n\
    Examples:\n  \
    jacoflow stereo left/ right/ -o out/ --format npz,pfm --picture pictures/\n  \
    jacoflow stereo l.png r.png -o d.pfm --disparity-range 0,63 --row-offset 0\n  \
    jacoflow stereo video.y4m --layout side-by-side -o out/ --method classes"
)]
pub struct StereoCommand {
    /// The left and the right view: folders, images, videos, .y4m or .npy files; one of them that holds both
    /// with --layout
    #[arg(required = true, value_name = "VIEW", num_args = 1..=2, help_heading = "Input")]
    pub input: Vec<String>,
    #[command(flatten, next_help_heading = "Input")]
    pub layout: LayoutArguments,
    #[command(flatten)]
    pub selection: SelectionArguments,
    #[command(flatten)]
    pub matching: MatchingArguments,
    /// A folder (for disparity_000000.npz, ...), or for one pair a .npz, .pfm or .png (kitti) file
    #[arg(long, short, value_name = "OUT", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Formats in a folder: npz (everything), pfm, kitti [default: npz]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', help_heading = "Output")]
    pub format: Vec<String>,
    /// Draw disparities in colour over every left view, blue far to red near: a folder for stereo_000000.png,
    /// ...
    #[arg(long, value_name = "FOLDER", help_heading = "Output")]
    pub picture: Option<PathBuf>,
    /// Replace files that exist; when the run is complete, what an earlier run left in the folders for
    /// further pairs is removed, from the pair --start on
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    #[command(flatten)]
    pub threads: ThreadArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
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
    /// Pairs whose views agree with no row offset that was searched.
    rows_doubtful: usize,
}

impl StereoCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let options = self.options()?;
        let formats = self.formats()?;
        let _new_folders = self.paths(&formats).check(self.force)?;
        self.check_output(&formats)?;
        let (views, numbering) = self.layout.open(&self.input, &self.selection, None)?;
        let mut pairs = GreyPairs::start(views, Preprocess::default(), options.threads)?;
        let mut done = Done::default();
        let failure = {
            let bar = Bar::new(watch, "stereo", self.messages.quiet);
            self.run(&mut pairs, numbering, &options, &formats, &bar, &mut done).err()
        };
        let interrupted = matches!(failure, Some(Error::Interrupted));
        if !self.messages.quiet && (failure.is_none() || interrupted) {
            print_message(&done.in_words());
        }
        let summary = json!({
            "command": "stereo", "method": self.matching.method, "pairs": done.pairs, "files": done.files, "disparities": done.found,
            "not_held": done.lost, "row_offset": done.row_offset, "rows_doubtful": done.rows_doubtful, "output": self.output, "picture": self.picture, "interrupted": interrupted,
        });
        Ok(Report { summary, failure })
    }

    /// How views are matched, checked.
    fn options(&self) -> Result<EdgeDisparityOptions> {
        let (search, defaults) = (&self.matching.search, EdgeDisparityOptions::default());
        let options = EdgeDisparityOptions {
            method: Method::parse(&self.matching.method)?,
            disparity_range: search.disparity_range.unwrap_or(defaults.disparity_range),
            row_range: search.row_range.unwrap_or(defaults.row_range),
            row_offset: search.row_offset,
            subpixel: !self.matching.no_subpixel,
            left_right_check: !self.matching.no_left_right_check,
            threshold: self.matching.threshold,
            threads: Threads::new(self.threads.threads)?,
            ..defaults
        };
        options.check()?;
        Ok(options)
    }

    /// The formats to write: by the name of a file, or those listed for a folder.
    fn formats(&self) -> Result<Vec<DisparityFormat>> {
        let listed: Vec<_> = self.format.iter().map(|name| DisparityFormat::parse(name)).collect::<Result<_>>()?;
        let Some(output) = &self.output else {
            if self.picture.is_none() && !self.messages.json {
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

    /// What the command reads and writes.
    fn paths(&self, formats: &[DisparityFormat]) -> CommandPaths {
        let paths = CommandPaths::of_input(&self.input);
        let paths = match self.output.as_deref() {
            Some(folder) if is_folder(folder) => paths.writing_files("output", folder, [], Self::maps(folder, formats)),
            file => paths.writing("output", file),
        };
        paths.writing_numbered("picture", self.picture.as_deref(), "stereo", &["png"])
    }

    /// The files of disparities in a folder.
    fn maps(folder: &Path, formats: &[DisparityFormat]) -> Vec<NumberedFiles> {
        let files = |format: &DisparityFormat| NumberedFiles::named(folder, "disparity", format.extension());
        formats.iter().map(files).collect()
    }

    /// Removes what a longer run left in the folders for frames from the first of this one on.
    fn remove_stale(&self, formats: &[DisparityFormat], numbering: Numbering, pairs: usize) -> Result<()> {
        let folder = self.output.as_deref().filter(|output| is_folder(output));
        let mut files = folder.map_or_else(Vec::new, |folder| Self::maps(folder, formats));
        files.extend(self.picture.iter().map(|folder| NumberedFiles::named(folder, "stereo", "png")));
        let written: HashSet<usize> = (0..pairs).map(|pair| numbering.index(pair)).collect();
        let is_kept = |index: usize| index < numbering.start || written.contains(&index);
        files.iter().try_for_each(|names| names.clear_except(is_kept))
    }

    /// Refuses what could only fail after work has been done.
    fn check_output(&self, formats: &[DisparityFormat]) -> Result<()> {
        for (option, path) in [("output", &self.output), ("picture", &self.picture)] {
            let Some(path) = path else { continue };
            if path.exists() && is_folder(path) && !path.is_dir() {
                return Err(Error::argument(option, "a folder", path.display()));
            }
            let occupied = path.read_dir().is_ok_and(|mut entries| entries.next().is_some());
            if is_folder(path) && occupied && !self.force {
                let wanted = "an empty or new folder (--force writes into it)";
                return Err(Error::argument(option, wanted, path.display()));
            }
        }
        match &self.output {
            Some(file) if !is_folder(file) && !formats.is_empty() => check_target(file, self.force),
            _ => Ok(()),
        }
    }

    /// Matches every pair and writes the requested output.
    fn run(
        &self,
        pairs: &mut GreyPairs,
        numbering: Numbering,
        options: &EdgeDisparityOptions,
        formats: &[DisparityFormat],
        bar: &Bar<'_>,
        done: &mut Done,
    ) -> Result<()> {
        let total = pairs.total();
        if let Some(file) = self.output.as_deref().filter(|path| total > 1 && !is_folder(path)) {
            return Err(Error::argument("output", format!("a folder for {total} pairs"), file.display()));
        }
        let (mut shown, mut rows) = (None, SequenceRows::new(options.row_offset));
        while let Some(GreyPair { views: [left, _], grey: pair }) = pairs.next(done.pairs, bar)? {
            let range = *shown.get_or_insert_with(|| GreyRange::of(&left));
            let found = rows.match_next(&pair[0], &pair[1], options)?;
            let index = numbering.index(done.pairs);
            if let Some(folder) = &self.picture {
                let mut picture = range.picture(&left);
                let (least, greatest) = options.disparity_range;
                draw_disparity(&mut picture, &found.disparity, (f64::from(least), f64::from(greatest)));
                write_picture(NumberedFiles::create(folder, "stereo", "png")?.path(index), &picture)?;
                done.files += 1;
            }
            done.found += found.rows.len();
            done.rows_doubtful += usize::from(found.rows_doubtful);
            done.row_offset = match options.method {
                Method::SemiGlobal => rows.known(),
                Method::Classes => done.row_offset.or(Some(found.row_offset)),
            };
            self.write(&found, index, formats, done)?;
            done.pairs += 1;
        }
        if done.pairs == 0 {
            return Err(Error::argument("input", "at least one pair of views", "none"));
        }
        if self.force { self.remove_stale(formats, numbering, done.pairs) } else { Ok(()) }
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

/// What is said of so many pairs whose rows are to be doubted.
pub fn rows_doubted(pairs: usize) -> String {
    match pairs {
        0 => String::new(),
        _ => format!(
            "; the views of {pairs} pairs agree poorly with every row offset that was searched, and many of their disparities are wrong (--row-range MIN,MAX widens the search, --row-offset gives it)"
        ),
    }
}

impl Done {
    /// The summary for people.
    fn in_words(&self) -> String {
        let per_pair = self.found / self.pairs.max(1);
        let mut words = format!("{} pairs, {per_pair} disparities each, {} files", self.pairs, self.files);
        match self.row_offset {
            Some(rows) => words += &format!(", row offset {rows:.2}"),
            None if self.rows_doubtful > 0 => {}
            None => words += "; no pair shows enough to estimate the row offset (--row-offset gives it)",
        }
        words += &rows_doubted(self.rows_doubtful);
        if self.lost > 0 {
            words += &format!("; {} disparities do not fit the kitti format (above 0 and below 256 px)", self.lost);
        }
        words
    }
}
