//! The bar on the terminal, and the question whether to stop.

use super::interrupt::{Watch, start_work};
use crate::error::Result;
use crate::parallel::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Duration;

/// Draws a bar on standard error when that is a terminal; fails after Ctrl-C.
#[derive(Debug)]
pub struct Bar<'a> {
    watch: &'a Watch,
    bar: ProgressBar,
}

impl<'a> Bar<'a> {
    /// A bar for work called `name`, which starts; hidden when `quiet` or not on a terminal.
    pub fn new(watch: &'a Watch, name: &'static str, quiet: bool) -> Self {
        start_work();
        let shown = !quiet && std::io::stderr().is_terminal();
        let bar = if shown {
            ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(10)).with_message(name)
        } else {
            ProgressBar::hidden()
        };
        if shown {
            bar.enable_steady_tick(Duration::from_millis(200));
            bar.set_style(style("{msg} {spinner} {pos} frames, {per_sec}, {elapsed}"));
        }
        Self { watch, bar }
    }
}

/// The templates are constants; should one not parse, the plain bar does.
fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

impl Progress for Bar<'_> {
    fn step(&self, done: usize, total: usize) -> Result<()> {
        if total > 0 && self.bar.length().is_none() {
            self.bar.set_length(total as u64);
            self.bar.set_style(style("{msg} [{bar:30}] {pos}/{len} frames, {per_sec}, {eta} left"));
        }
        self.bar.set_position(done as u64);
        self.watch.check()
    }
}

impl Drop for Bar<'_> {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
