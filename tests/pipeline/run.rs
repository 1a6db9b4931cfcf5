//! The loop over frames.

use jacoflow::error::{Error, Result};
use jacoflow::io::{FrameSource, MemorySource};
use jacoflow::parallel::{Progress, Silent};
use jacoflow::pipeline::{Collect, Ending, FieldSink, Numbering, Output, Pipeline, Sink, Stage, Step};
use jacoflow::types::{AnyFrame, FieldLayout, FlowField, Frame, Interval, SamplingGrid, Status, Units};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// Gives a field of the frame's mean for every frame from the second on.
struct Means(usize);

impl Stage<f32> for Means {
    fn frames_needed(&self) -> usize {
        2
    }
    fn push(&mut self, frame: AnyFrame, _time: Option<f64>) -> Result<Option<Output<f32>>> {
        self.0 += 1;
        let frame = Arc::new(frame.to_real::<f32>());
        let layout = FieldLayout {
            frame_size: frame.size(),
            sites: SamplingGrid::default(),
            model: "translational".into(),
            parameters: vec!["u".into(), "v".into()],
            units: Units::default(),
            interval: Interval::Instant,
            frame_index: self.0 - 1,
            correlation_length: 0.0,
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

impl Sink<Step<'_, f32>> for Ended {
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
    let numbering = Numbering { start: 10, step: 3, rate: Some(30.0), ..Numbering::default() };
    let mut pipeline =
        Pipeline::new(Box::new(Means(0))).with_numbering(numbering).with_sinks([Box::new(kept) as Box<FieldSink<f32>>]);
    let frames = (1..=4).map(|v| AnyFrame::U8(Frame::filled(2, 2, v))).collect();
    pipeline.run(Box::new(MemorySource::new(frames).unwrap()), &Silent).unwrap();
    let fields = fields.lock().unwrap();
    assert_eq!(fields.iter().map(|f| f.layout.frame_index).collect::<Vec<_>>(), [13, 16, 19]);
    assert_eq!(fields.iter().map(|f| f.motion[0]).collect::<Vec<_>>(), [2.0_f32, 3.0, 4.0]);
    let summary = pipeline.summary();
    assert_eq!((summary.frames, summary.fields, summary.valid_share()), (4, 3, 0.25));
    assert_eq!((numbering.period(), numbering.time(30)), (Some(0.1), Some(1.0)));
}

#[test]
fn times_of_the_source_replace_those_of_the_rate() {
    let own = Numbering { step: 2, rate: Some(10.0), ..Numbering::default() };
    assert_eq!((own.time_of(4, Some(0.7)), own.time_of(4, None)), (Some(0.7), Some(0.4)));
    let given = Numbering { has_own_times: false, ..own };
    assert_eq!(given.time_of(4, Some(0.7)), Some(0.4));
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
        let mut pipeline =
            Pipeline::new(Box::new(Means(0))).with_sinks([Box::new(sink.clone()) as Box<FieldSink<f32>>]);
        let result = pipeline.run(source(sizes), &StopAfter(stop));
        let told = result.err().map_or(String::new(), |error| error.to_string());
        assert!(told.contains(message) && told.is_empty() == message.is_empty(), "{told}");
        assert_eq!(*sink.0.lock().unwrap(), [ending]);
        assert_eq!(sink.1.load(Ordering::SeqCst), accepted);
    }
}
