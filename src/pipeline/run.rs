//! The loop over frames.

use super::prefetch::Prefetch;
use super::sink::{Ending, Sink, Step};
use super::stage::Stage;
use crate::error::{Error, Result};
use crate::image::Preprocess;
use crate::io::FrameSource;
use crate::parallel::{Progress, Threads};
use crate::simd::SimdReal;
use crate::types::Status;
use std::sync::Arc;
use std::time::Instant;

/// Which frames of the input the pushed ones are: frame `k` of the run is frame `first + k * step` of the input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbering {
    /// Index of the first frame.
    pub first: usize,
    /// Distance between used frames.
    pub step: usize,
    /// Frames per second of the input (before `step`).
    pub rate: Option<f64>,
}

impl Default for Numbering {
    fn default() -> Self {
        Self { first: 0, step: 1, rate: None }
    }
}

impl Numbering {
    /// Index in the input of the `k`-th pushed frame.
    pub fn index(&self, k: usize) -> usize {
        self.first + k * self.step
    }
    /// Seconds between pushed frames.
    pub fn period(&self) -> Option<f64> {
        self.rate.map(|rate| self.step as f64 / rate)
    }
    /// Time of input frame `index`, seconds from input frame 0.
    pub fn time(&self, index: usize) -> Option<f64> {
        self.rate.map(|rate| index as f64 / rate)
    }
}

/// What a run did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Summary {
    /// Frames read.
    pub frames: usize,
    /// Fields estimated and taken by every sink.
    pub fields: usize,
    /// Sites with a valid estimate.
    pub valid: u64,
    /// Sites in all.
    pub sites: u64,
    /// Restarts of a filter's pixel.
    pub repairs: usize,
    /// Files written.
    pub files: usize,
    /// Wall-clock seconds.
    pub seconds: f64,
}

impl Summary {
    /// Valid sites over all sites, 0 to 1 (0 without any site).
    pub fn valid_share(&self) -> f64 {
        if self.sites == 0 { 0.0 } else { self.valid as f64 / self.sites as f64 }
    }
}

/// A run: frames in, fields out.
pub struct Pipeline<T> {
    preprocess: Preprocess,
    threads: Threads,
    numbering: Numbering,
    stage: Box<dyn Stage<T>>,
    sinks: Vec<Box<dyn Sink<T>>>,
    summary: Summary,
}

impl<T: SimdReal> Pipeline<T> {
    /// A pipeline around `stage`, without preparation and without sinks.
    pub fn new(stage: Box<dyn Stage<T>>) -> Self {
        Self {
            preprocess: Preprocess::default(),
            threads: Threads::default(),
            numbering: Numbering::default(),
            stage,
            sinks: Vec::new(),
            summary: Summary::default(),
        }
    }

    /// What is done to each frame first (in this order: quantise, smooth).
    pub fn with_preprocess(mut self, preprocess: Preprocess) -> Self {
        self.preprocess = preprocess;
        self
    }
    /// Threads of the preparation.
    pub fn with_threads(mut self, threads: Threads) -> Self {
        self.threads = threads;
        self
    }
    /// Which frames of the input come.
    pub fn with_numbering(mut self, numbering: Numbering) -> Self {
        self.numbering = numbering;
        self
    }
    /// One more receiver of the results.
    pub fn with_sink(mut self, sink: Box<dyn Sink<T>>) -> Self {
        self.sinks.push(sink);
        self
    }

    /// What was done so far; valid after a failed or interrupted run too.
    pub fn summary(&self) -> Summary {
        self.summary
    }
    /// The stage, for its state after the run.
    pub fn stage(&self) -> &dyn Stage<T> {
        &*self.stage
    }

    /// Works through `source` and ends every sink, however the run ends.
    ///
    /// `progress` is told the number of frames read, at least once a frame and while waiting for one; its error stops the run, and what is
    /// complete then stays.
    ///
    /// # Errors
    /// Those of the source, the stage, the sinks and `progress`; [`Error::Argument`] when there are too few frames or one
    /// differs in size.
    pub fn run(&mut self, source: Box<dyn FrameSource>, progress: &dyn Progress) -> Result<()> {
        let start = Instant::now();
        let worked = self.work(source, progress);
        let ending = if worked.is_ok() { Ending::Complete } else { Ending::Partial };
        // Every sink is ended even when an earlier one fails; the first error is the one that is told.
        let mut result = worked;
        for sink in &mut self.sinks {
            result = result.and(sink.finish(ending));
        }
        self.summary.files = self.sinks.iter().map(|sink| sink.files().0).sum();
        self.summary.repairs = self.stage.repairs();
        self.summary.seconds = start.elapsed().as_secs_f64();
        result
    }

    fn work(&mut self, source: Box<dyn FrameSource>, progress: &dyn Progress) -> Result<()> {
        let total = source.len_hint().unwrap_or(0);
        let frames = Prefetch::start(source)?;
        let mut size = None;
        loop {
            let done = self.summary.frames;
            progress.step(done, total)?;
            let Some(frame) = frames.next(|| progress.step(done, total))? else { break };
            check_size(&mut size, frame.size(), self.numbering.index(done))?;
            self.summary.frames += 1;
            let frame = self.threads.install(|| self.preprocess.apply(frame.to_real::<T>()));
            self.push(Arc::new(frame))?;
        }
        progress.step(self.summary.frames, total)?;
        let needed = self.stage.frames_needed();
        if self.summary.frames < needed {
            let wanted = format!("at least {needed} frames for this method");
            return Err(Error::argument("frames", wanted, self.summary.frames));
        }
        Ok(())
    }

    fn push(&mut self, frame: Arc<crate::types::Frame<T>>) -> Result<()> {
        let Some((mut field, frame)) = self.stage.push(frame)? else { return Ok(()) };
        field.layout.frame_index = self.numbering.index(field.layout.frame_index);
        let time = self.numbering.time(field.layout.frame_index);
        let step = Step { field: &field, frame: &frame, time };
        for sink in &mut self.sinks {
            sink.accept(&step)?;
        }
        self.summary.fields += 1;
        self.summary.sites += field.len() as u64;
        self.summary.valid += field.status.iter().filter(|status| Status::is_valid(**status)).count() as u64;
        Ok(())
    }
}

/// The first frame sets the size; every other one must have it.
fn check_size(first: &mut Option<(usize, usize)>, size: (usize, usize), index: usize) -> Result<()> {
    let (width, height) = *first.get_or_insert(size);
    if size == (width, height) {
        return Ok(());
    }
    let got = format!("{} x {} in frame {index}", size.0, size.1);
    Err(Error::argument("frames", format!("one size, {width} x {height} as in the first frame"), got))
}

#[cfg(test)]
mod tests {
    use super::super::sink::Collect;
    use super::super::stage::Output;
    use super::*;
    use crate::io::MemorySource;
    use crate::parallel::Silent;
    use crate::types::{AnyFrame, FieldLayout, FlowField, Frame, Sites};
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Gives a field of the frame's mean for every frame from the second on.
    struct Means(usize);

    impl Stage<f32> for Means {
        fn frames_needed(&self) -> usize {
            2
        }
        fn push(&mut self, frame: Arc<Frame<f32>>) -> Result<Option<Output<f32>>> {
            self.0 += 1;
            let layout = FieldLayout {
                frame_size: frame.size(),
                sites: Sites::default(),
                model: "translational".into(),
                parameters: vec!["u".into(), "v".into()],
                frame_period: None,
                pixel_pitch: (1.0, 1.0),
                frame_index: self.0 - 1,
            };
            let mut field = FlowField::empty(layout, false)?;
            field.status[0] = Status::Ok;
            field.motion[0] = frame.data().iter().sum::<f32>() / frame.data().len() as f32;
            Ok((self.0 > 1).then_some((field, frame)))
        }
    }

    /// Stops once so many frames are read.
    struct StopAfter(usize);

    impl Progress for StopAfter {
        fn step(&self, done: usize, _total: usize) -> Result<()> {
            if done >= self.0 { Err(Error::Interrupted) } else { Ok(()) }
        }
    }

    /// Notes how it was ended.
    #[derive(Clone, Default)]
    struct Ended(Arc<Mutex<Vec<Ending>>>, Arc<AtomicUsize>);

    impl Sink<f32> for Ended {
        fn accept(&mut self, _step: &Step<'_, f32>) -> Result<()> {
            self.1.fetch_add(1, Ordering::SeqCst);
            Ok(())
        }
        fn finish(&mut self, ending: Ending) -> Result<()> {
            self.0.lock().unwrap().push(ending);
            Ok(())
        }
    }

    fn source(sizes: &[usize]) -> Box<dyn FrameSource> {
        struct Frames(std::vec::IntoIter<usize>, u8);
        impl FrameSource for Frames {
            fn next_frame(&mut self) -> Result<Option<AnyFrame>> {
                self.1 += 1;
                Ok(self.0.next().map(|size| AnyFrame::U8(Frame::filled(size, 2, self.1))))
            }
            fn describe(&self) -> String {
                "frames".into()
            }
        }
        Box::new(Frames(Vec::from(sizes).into_iter(), 0))
    }

    #[test]
    fn fields_are_numbered_as_the_input_and_counted() {
        let kept = Collect::default();
        let fields = kept.handle();
        let numbering = Numbering { first: 10, step: 3, rate: Some(30.0) };
        let mut pipeline = Pipeline::new(Box::new(Means(0))).with_numbering(numbering).with_sink(Box::new(kept));
        let frames = (1..=4).map(|v| AnyFrame::U8(Frame::filled(2, 2, v))).collect();
        pipeline.run(Box::new(MemorySource::new(frames).unwrap()), &Silent).unwrap();
        let fields = fields.lock().unwrap();
        assert_eq!(fields.iter().map(|f| f.layout.frame_index).collect::<Vec<_>>(), [13, 16, 19]);
        assert_eq!(fields.iter().map(|f| f.motion[0]).collect::<Vec<_>>(), [2.0, 3.0, 4.0]);
        let summary = pipeline.summary();
        assert_eq!((summary.frames, summary.fields, summary.valid_share()), (4, 3, 0.25));
        assert_eq!((numbering.period(), numbering.time(30)), (Some(0.1), Some(1.0)));
    }

    #[test]
    fn sinks_learn_how_a_run_ended() {
        let cases: [(&[usize], usize, &str, Ending, usize); 4] = [
            (&[2, 2, 2], 99, "", Ending::Complete, 2),
            (&[2, 2, 2], 2, "interrupted", Ending::Partial, 1),
            (&[2, 2, 3], 99, "3 x 2 in frame 2", Ending::Partial, 1),
            (&[2], 99, "at least 2 frames", Ending::Partial, 0),
        ];
        for (sizes, stop, message, ending, accepted) in cases {
            let sink = Ended::default();
            let mut pipeline = Pipeline::new(Box::new(Means(0))).with_sink(Box::new(sink.clone()));
            let result = pipeline.run(source(sizes), &StopAfter(stop));
            let told = result.err().map_or(String::new(), |error| error.to_string());
            assert!(told.contains(message) && told.is_empty() == message.is_empty(), "{told}");
            assert_eq!(*sink.0.lock().unwrap(), [ending]);
            assert_eq!(sink.1.load(Ordering::SeqCst), accepted);
        }
    }
}
