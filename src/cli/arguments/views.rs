//! Two views of each moment: where they are, and how they may differ.

use super::{SelectionArguments, parse_range};
use crate::error::Result;
use crate::io::{ViewLayout, ViewPairs};
use crate::pipeline::Numbering;
use clap::{Args, ValueEnum};

/// Where both views are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LayoutWord {
    /// In two inputs
    Separate,
    /// In one frame, the left view in its left half
    SideBySide,
    /// In one frame, the left view in its upper half
    TopBottom,
    /// Side by side, each squeezed to half its width; they are widened again
    HalfSideBySide,
    /// Top-bottom, each squeezed to half its height; they are stretched again
    HalfTopBottom,
}

/// How the input holds two views.
#[derive(Debug, Clone, Args)]
pub struct LayoutArguments {
    /// Where both views are, the left one first [default: separate, in two inputs]
    #[arg(long, value_enum, value_name = "HOW")]
    pub layout: Option<LayoutWord>,
    /// The right view comes first
    #[arg(long)]
    pub swap: bool,
}

impl LayoutArguments {
    /// Opens the pairs of views; also returns their numbering in the input.
    pub fn open(
        &self,
        input: &[String],
        selection: &SelectionArguments,
        rate: Option<f64>,
    ) -> Result<(ViewPairs, Numbering)> {
        let layout = match self.layout {
            None | Some(LayoutWord::Separate) => None,
            Some(LayoutWord::SideBySide) => Some(ViewLayout::SideBySide),
            Some(LayoutWord::TopBottom) => Some(ViewLayout::TopBottom),
            Some(LayoutWord::HalfSideBySide) => Some(ViewLayout::HalfSideBySide),
            Some(LayoutWord::HalfTopBottom) => Some(ViewLayout::HalfTopBottom),
        };
        let views = ViewPairs::open(input, layout, &selection.options())?.with_swapped(self.swap);
        let numbering = selection.numbering(rate, views.frame_rate());
        Ok((views, numbering))
    }

    /// Whether any was given.
    pub fn given(&self) -> Option<&'static str> {
        self.layout.map(|_| "layout").or(self.swap.then_some("swap"))
    }
}

/// Where matches are looked for.
#[derive(Debug, Clone, Args)]
pub struct SearchArguments {
    /// Minimum and maximum disparity, px [default: -40,24]
    #[arg(long, value_name = "MIN,MAX", allow_hyphen_values = true, value_parser = parse_range)]
    pub disparity_range: Option<(i32, i32)>,
    /// Minimum and maximum row offset that are searched, rows [default: -4,4]
    #[arg(long, value_name = "MIN,MAX", allow_hyphen_values = true, value_parser = parse_range)]
    pub row_range: Option<(i32, i32)>,
    /// How many rows lower the right view shows a point [default: estimated from the first pair that shows
    /// enough, and again where views contradict it (sgm), searched at every pixel (classes)]
    #[arg(long, value_name = "ROWS")]
    pub row_offset: Option<f64>,
}

impl SearchArguments {
    /// Whether any was given.
    pub fn given(&self) -> Option<&'static str> {
        let Self { disparity_range, row_range, row_offset } = self;
        let rows = row_range.map(|_| "row_range").or(row_offset.map(|_| "row_offset"));
        disparity_range.map(|_| "disparity_range").or(rows)
    }
}
