//! Where in the frame estimates are wanted.

use crate::error::{Error, Result};
use crate::types::{Rect, SamplingGrid};
use clap::Args;
use std::path::{Path, PathBuf};

/// Region, grid, points and mask.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Where")]
pub struct GridArguments {
    /// Only this rectangle of pixels
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT", value_parser = parse_rect)]
    pub region: Option<Rect>,
    /// One estimate every N pixels in both directions
    #[arg(long, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub stride: Option<usize>,
    /// Only these pixels: `X,Y`, or a CSV file with columns x and y; may be repeated
    #[arg(long, value_name = "X,Y|FILE", allow_hyphen_values = true, conflicts_with_all = ["region", "stride"])]
    pub points: Vec<String>,
    /// Use only pixels that are not black in this image of the frames' size
    #[arg(long, value_name = "IMAGE")]
    pub mask: Option<PathBuf>,
}

impl GridArguments {
    /// Files that these arguments read.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let is_file = |word: &&String| parse_point(word).is_none() && !looks_like_a_point(word);
        self.points.iter().filter(is_file).map(Path::new).chain(self.mask.as_deref())
    }

    /// The sites these arguments ask for.
    pub fn sampling_grid(&self) -> Result<SamplingGrid> {
        if self.points.is_empty() {
            return Ok(SamplingGrid::Grid { region: self.region, stride: self.stride.unwrap_or(1) });
        }
        let mut points = Vec::new();
        for word in &self.points {
            match parse_point(word) {
                Some(point) => points.push(point),
                None if looks_like_a_point(word) => {
                    return Err(Error::argument("points", "whole pixels X,Y of at least 0, or a CSV file", word));
                }
                None => read_points(Path::new(word), &mut points)?,
            }
        }
        Ok(SamplingGrid::Points(points))
    }
}

fn parse_rect(text: &str) -> std::result::Result<Rect, String> {
    let numbers: Vec<usize> = text.split(',').map_while(|word| word.trim().parse().ok()).collect();
    match numbers[..] {
        [x, y, width, height] if text.split(',').count() == 4 && width > 0 && height > 0 => {
            Ok(Rect { x, y, width, height })
        }
        _ => Err("expected X,Y,WIDTH,HEIGHT in whole pixels with a positive width and height".into()),
    }
}

fn parse_point(text: &str) -> Option<(usize, usize)> {
    let (x, y) = text.split_once(',')?;
    Some((x.trim().parse().ok()?, y.trim().parse().ok()?))
}

/// Numbers only: meant as a point even if it is not a good one.
fn looks_like_a_point(text: &str) -> bool {
    text.split(',').all(|word| word.trim().parse::<f64>().is_ok())
}

/// Reads rows `x,y` (further columns are ignored); a first row that is not numeric names the columns.
fn read_points(path: &Path, into: &mut Vec<(usize, usize)>) -> Result<()> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::io(path, source))?;
    let mut columns = (0, 1);
    let before = into.len();
    // Spreadsheets begin text with a byte order mark.
    let text = text.trim_start_matches('\u{feff}').as_bytes();
    let rows = csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(text);
    for row in rows.into_records() {
        let cells = row.map_err(|error| Error::format(path, error.to_string()))?;
        // Spaces alone: the reader passes over empty lines.
        if cells.iter().eq([""]) {
            continue;
        }
        let point = || Some((cells.get(columns.0)?.parse().ok()?, cells.get(columns.1)?.parse().ok()?));
        match point() {
            Some(point) => into.push(point),
            None if into.len() == before && cells.iter().any(|cell| cell.parse::<f64>().is_err()) => {
                let place = |name: &str| cells.iter().position(|cell| cell.eq_ignore_ascii_case(name));
                columns = place("x")
                    .zip(place("y"))
                    .ok_or_else(|| Error::format(path, "expected the columns x and y, or rows of two pixel numbers"))?;
            }
            None => {
                let (line, got) = (cells.position().map_or(0, csv::Position::line), cells.iter().collect::<Vec<_>>());
                let message = format!("line {line}: expected whole pixels x,y of at least 0, got {:?}", got.join(","));
                return Err(Error::format(path, message));
            }
        }
    }
    if into.len() == before {
        return Err(Error::format(path, "expected at least one point x,y"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_come_from_words_and_from_files() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("points.csv");
        std::fs::write(&file, "name,y,x\na,2,1\n\nb,4,3\n").unwrap();
        let arguments = GridArguments {
            region: None,
            stride: None,
            points: vec!["7,8".into(), file.to_string_lossy().into()],
            mask: None,
        };
        assert_eq!(arguments.sampling_grid().unwrap(), SamplingGrid::Points(vec![(7, 8), (1, 2), (3, 4)]));
        std::fs::write(&file, "\u{feff}x,y\r\n1,2\r\n3,4\r\n").unwrap();
        assert_eq!(arguments.sampling_grid().unwrap(), SamplingGrid::Points(vec![(7, 8), (1, 2), (3, 4)]));
        // As R writes tables.
        std::fs::write(&file, "\"\",\"y\",\"x\"\n\"1\",2,1\n\"2\",\"4\",\"3\"\n").unwrap();
        assert_eq!(arguments.sampling_grid().unwrap(), SamplingGrid::Points(vec![(7, 8), (1, 2), (3, 4)]));
        std::fs::write(&file, "1,2\n3,-4\n").unwrap();
        assert!(arguments.sampling_grid().unwrap_err().to_string().contains("line 2"));
        let negative = GridArguments { points: vec!["-1,2".into()], ..arguments };
        assert!(negative.sampling_grid().unwrap_err().to_string().contains("points"));
    }
}
