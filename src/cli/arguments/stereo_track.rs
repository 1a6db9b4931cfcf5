//! How the stereo tracker works, and what it draws.

use super::{LayoutArguments, SearchArguments, track::numbers};
use crate::error::{Error, Result};
use crate::parallel::Threads;
use crate::pipeline::{Numbering, PairTimes};
use crate::track::stereo::{StereoCamera, StereoMode, StereoTrackerOptions};
use clap::Args;
use std::path::PathBuf;

/// Options of the stereo tracker. Those that are not given keep the tracker's own default.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "With --method stereo")]
pub struct StereoTrackerArguments {
    #[command(flatten)]
    pub layout: LayoutArguments,
    #[command(flatten)]
    pub matches: SearchArguments,
    /// Components of the mixture [default: 16, paper 12]
    #[arg(long, value_name = "N")]
    pub n_components: Option<usize>,
    /// Cells along y and x over the picture and layers of disparity [default: 60,80 and a layer for each
    /// disparity]
    #[arg(long, value_name = "ROWS,COLUMNS[,LAYERS]", value_parser = parse_grid)]
    pub grid: Option<CellGrid>,
    /// How far templates and depths are searched, cells and disparities [default: 8]
    #[arg(long, value_name = "CELLS")]
    pub search: Option<usize>,
    /// Focal length, px, distance of the cameras, in any unit, and disparity at infinity, px: for depths and
    /// velocities in space
    #[arg(long, value_name = "FOCAL,BASELINE[,INFINITY]", allow_hyphen_values = true, value_parser = parse_cameras)]
    pub cameras: Option<StereoCamera>,
    /// When every pair of the input was recorded, where frames are missing or come unevenly: a file with a
    /// time in each line, s, further columns being ignored. Motion is then px for an ordinary (the median)
    /// step
    #[arg(long, value_name = "FILE")]
    pub times: Option<PathBuf>,
    /// Draw disparities over every left view, blue far to red near: a folder for stereo_000000.png, ..., or a
    /// sequence *.y4m
    #[arg(long, value_name = "FOLDER|Y4M")]
    pub disparity_overlay: Option<PathBuf>,
    /// Draw the graph of all clusters over time: a .png file
    #[arg(long, value_name = "FILE")]
    pub graph: Option<PathBuf>,
}

impl StereoTrackerArguments {
    /// Whether any was given.
    pub fn given(&self) -> Option<&'static str> {
        // Every field is named, so that a new option cannot be left out.
        let Self { layout, matches, n_components, grid, search, cameras, times, disparity_overlay, graph } = self;
        let own = [
            n_components.map(|_| "n_components"),
            grid.map(|_| "grid"),
            search.map(|_| "search"),
            cameras.map(|_| "cameras"),
            times.as_ref().map(|_| "times"),
            disparity_overlay.as_ref().map(|_| "disparity_overlay"),
            graph.as_ref().map(|_| "graph"),
        ];
        layout.given().or(matches.given()).or(own.into_iter().find_map(|given| given))
    }

    /// The options of the stereo tracker; layers of disparity as wide as the range.
    pub fn options(
        &self,
        mode: StereoMode,
        random_state: Option<u64>,
        threads: Threads,
    ) -> Result<StereoTrackerOptions> {
        let mut options = StereoTrackerOptions::new(mode);
        if let Some((least, greatest)) = self.matches.disparity_range {
            options = options.with_disparities([least, greatest]);
        }
        if let Some((least, greatest)) = self.matches.row_range {
            options.row_range = [least, greatest];
        }
        options.row_offset = self.matches.row_offset;
        options.n_components = self.n_components.unwrap_or(options.n_components);
        if let Some(CellGrid { rows, columns, layers }) = self.grid {
            options.grid.rows = rows;
            options.grid.columns = columns;
            options.grid.layers = layers.unwrap_or(options.grid.layers);
        }
        options.search = self.search.unwrap_or(options.search);
        options.random_state = random_state.unwrap_or(options.random_state);
        options.camera = self.cameras;
        options.threads = threads;
        options.check()?;
        Ok(options)
    }
}

impl StereoTrackerArguments {
    /// When the pairs were recorded, if given.
    pub fn times(&self, numbering: Numbering) -> Result<Option<PairTimes>> {
        let Some(path) = &self.times else { return Ok(None) };
        let text = std::fs::read_to_string(path).map_err(|source| Error::io(path, source))?;
        // Only the end may be blank: a missing time must not move the later ones to other pairs.
        let lines = text.trim_end().lines().enumerate().filter(|(_, line)| !line.starts_with('#'));
        let read = |(number, line): (usize, &str)| {
            let first = line.split(|c: char| c.is_whitespace() || c == ',').find(|word| !word.is_empty());
            first.and_then(|word| word.parse().ok()).ok_or_else(|| {
                Error::format(path, format!("line {}: expected a time in seconds, got {line:?}", number + 1))
            })
        };
        let times: Vec<f64> = lines.map(read).collect::<Result<_>>()?;
        PairTimes::new(&times, numbering).map(Some)
    }
}

/// Cells over the picture, and layers where they are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellGrid {
    pub rows: usize,
    pub columns: usize,
    pub layers: Option<usize>,
}

fn parse_grid(text: &str) -> std::result::Result<CellGrid, String> {
    let sides: std::result::Result<Vec<usize>, _> = text.split(',').map(|side| side.trim().parse()).collect();
    match sides.as_deref() {
        Ok(&[rows, columns]) => Ok(CellGrid { rows, columns, layers: None }),
        Ok(&[rows, columns, layers]) => Ok(CellGrid { rows, columns, layers: Some(layers) }),
        _ => Err("expected ROWS,COLUMNS or ROWS,COLUMNS,LAYERS, whole numbers".into()),
    }
}

fn parse_cameras(text: &str) -> std::result::Result<StereoCamera, String> {
    let given = numbers(text).or_else(|| numbers(text).map(|[focal, baseline]: [f64; 2]| [focal, baseline, 0.0]));
    let [focal, baseline, d_infinity] = given.ok_or("expected FOCAL,BASELINE or FOCAL,BASELINE,INFINITY")?;
    let camera = StereoCamera { focal, baseline, d_infinity };
    camera.check().map_err(|problem| problem.to_string())?;
    Ok(camera)
}
