//! Compressed video, decoded by an `ffmpeg` program on the `PATH`.

use super::{FrameSource, Kind, Y4mSource};
use crate::error::{Error, Result};
use crate::io::channels::{ChannelPolicy, Colour, ColourUse};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use tempfile::TempDir;

pub(super) const KIND: Kind = Kind {
    name: "ffmpeg",
    accepts: |spec| Path::new(spec).is_file(),
    signatures: &[],
    has_planes: false,
    members: super::no_members,
    open: |spec, options| Ok(Box::new(FfmpegSource::open_with("ffmpeg", spec, options.colour)?)),
    open_colour: |spec, options| Ok(Box::new(FfmpegSource::open_with("ffmpeg", spec, options.grey)?)),
};

/// "Every coded frame once": for `ffmpeg` 5.1 and later, and for earlier ones.
const EVERY_FRAME: [[&str; 2]; 2] = [["-fps_mode", "passthrough"], ["-vsync", "0"]];

/// Conversion to what [`Y4mSource`] takes colour for, from any matrix and depth of the file. Limited range,
/// since older programs say nothing of the range.
const COLOUR: &str = "scale=out_color_matrix=bt601:out_range=tv,format=yuv444p";

/// The formats of Y4M: a video in one of them stays as it is, others (RGB, palettes) take the nearest.
const GREY: &str = "format=gray|gray10le|gray12le|gray16le|yuv420p|yuv411p|yuv422p|yuv444p|yuvj420p|yuvj422p|yuvj444p|yuv420p10le|yuv422p10le|yuv444p10le|yuv420p12le|yuv422p12le|yuv444p12le|yuv420p16le|yuv422p16le|yuv444p16le";

/// Writes a line with the time of each frame, before the frame, into a file of the program's folder.
const TIMES: &str = "metadata=mode=add:key=jacoflow:value=1,metadata=mode=print:key=jacoflow:file=times:direct=1";

/// Name of that file.
const TIMES_FILE: &str = "times";

/// Frames of a video file. Grey ones are the luma plane as coded, 8 to 16 bit (see [`Y4mSource`]); colour
/// ones have 8 bit, converted by the program. Frames are turned as the file says for the display.
///
/// The program runs beside this process and is stopped when the source is dropped.
#[derive(Debug)]
pub struct FfmpegSource<P = Colour> {
    path: PathBuf,
    stream: Y4mSource<BufReader<ChildStdout>, P>,
    times: Times,
    running: Running,
}

/// The program, stopped on drop, the file that takes its messages, and its folder.
#[derive(Debug)]
struct Running {
    child: Child,
    messages: File,
    folder: TempDir,
}

/// Times of the frames, s, as the program writes them.
#[derive(Debug)]
struct Times {
    /// `None` where the program writes none.
    file: Option<File>,
    /// The beginning of a line whose end has not been written yet.
    rest: String,
    waiting: VecDeque<Option<f64>>,
    last: Option<f64>,
}

impl Times {
    fn of(folder: &Path) -> Self {
        let file = File::open(folder.join(TIMES_FILE)).ok();
        Self { file, rest: String::new(), waiting: VecDeque::new(), last: None }
    }

    /// Goes on by `count` frames.
    fn pass(&mut self, count: usize) {
        for _ in 0..count {
            if self.waiting.is_empty() {
                self.read();
            }
            self.last = self.waiting.pop_front().flatten();
        }
    }

    fn read(&mut self) {
        let Some(file) = &mut self.file else { return };
        let mut bytes = Vec::new();
        // A failure leaves frames without times, which is no reason to stop.
        let _ = file.take(1 << 20).read_to_end(&mut bytes);
        self.rest.push_str(&String::from_utf8_lossy(&bytes));
        let end = self.rest.rfind('\n').map_or(0, |at| at + 1);
        let lines: String = self.rest.drain(..end).collect();
        let times = lines.lines().filter(|line| line.starts_with("frame:"));
        self.waiting.extend(times.map(|line| line.split_once("pts_time:")?.1.trim().parse().ok()));
    }
}

impl FfmpegSource {
    /// Opens a video with the `ffmpeg` on the `PATH`, its luma as grey frames.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_with("ffmpeg", path, Colour::Luminance)
    }
}

impl<P: ChannelPolicy> FfmpegSource<P> {
    /// Opens a video with a program that understands the options of `ffmpeg`: grey frames with the policy
    /// [`Colour`], colour frames with [`Grey`](crate::io::Grey).
    ///
    /// # Errors
    /// [`Error::Missing`] when there is no such program; [`Error::Format`] with its own words when it cannot
    /// decode the file.
    pub fn open_with(program: impl AsRef<Path>, path: impl AsRef<Path>, policy: P) -> Result<Self> {
        let (program, path) = (program.as_ref(), path.as_ref());
        File::open(path).map_err(|e| Error::io(path, e))?;
        let conversion = if policy.colour_use() == ColourUse::Kept { COLOUR } else { GREY };
        let with_times = format!("{conversion},{TIMES}");
        let mut failure = None;
        // Older programs do not know "-fps_mode", or write no times as frames are decoded.
        let ways = [(EVERY_FRAME[0], &*with_times), (EVERY_FRAME[1], &*with_times), (EVERY_FRAME[1], conversion)];
        for (every_frame, filters) in ways {
            let mut running = Running::start(program, path, every_frame, filters)?;
            let Some(output) = running.child.stdout.take() else { break };
            match Y4mSource::new(path, BufReader::with_capacity(1 << 18, output)) {
                Ok(stream) => {
                    let (times, path) = (Times::of(running.folder.path()), path.to_path_buf());
                    return Ok(Self { path, stream: stream.with_policy(policy), times, running });
                }
                Err(error) => failure = Some(running.explain(path, error)),
            }
            let words = running.last_words();
            if !(words.contains("fps_mode") || words.contains("direct")) {
                break;
            }
        }
        Err(failure.unwrap_or_else(|| Error::format(path, "ffmpeg gave no output")))
    }
}

/// What to do with a video that ffmpeg does not decode.
const CONVERT: &str = "If another program shows it, save its frames there as a folder of PNG files";

/// The first line of what the program said, which names the cause; those after it say what failed in turn.
fn first_line(words: &str) -> &str {
    let line = words.lines().next().unwrap_or_default().trim_end_matches('.');
    // "[webp @ 0x55912c35f240] image data not found"
    line.split_once(" @ 0x").and_then(|(_, rest)| rest.split_once("] ")).map_or(line, |(_, cause)| cause)
}

impl Running {
    fn start(program: &Path, path: &Path, every_frame: [&str; 2], filters: &str) -> Result<Self> {
        let temporary = |e| Error::io(std::env::temp_dir(), e);
        let messages = tempfile::tempfile().map_err(temporary)?;
        let for_child = messages.try_clone().map_err(temporary)?;
        let folder = tempfile::tempdir().map_err(temporary)?;
        // A name that begins with a dash or holds a colon must not be taken for an option or a protocol.
        let mut input = std::ffi::OsString::from("file:");
        input.push(std::path::absolute(path).map_err(|e| Error::io(path, e))?);
        let child = Command::new(program)
            .current_dir(folder.path())
            .args(["-nostdin", "-v", "error", "-i"])
            .arg(input)
            .args(["-map", "0:v:0"])
            .args(every_frame)
            .args(["-vf", filters])
            .args(["-strict", "-1", "-f", "yuv4mpegpipe", "-"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(for_child)
            .spawn()
            .map_err(|e| match e.kind() {
                ErrorKind::NotFound => Error::Missing(format!(
                    "{}: reading compressed video needs the program '{}', which is not on the PATH. Install ffmpeg, or give the frames as a folder of images or as Y4M (ffmpeg -i VIDEO -f yuv4mpegpipe - | jacoflow ... -)",
                    path.display(),
                    program.display()
                )),
                _ => Error::io(program, e),
            })?;
        Ok(Self { child, messages, folder })
    }

    /// The end of what the program said.
    fn last_words(&mut self) -> String {
        let mut text = Vec::new();
        let length = self.messages.seek(SeekFrom::End(0)).unwrap_or(0);
        let _ = self.messages.seek(SeekFrom::Start(length.saturating_sub(2000)));
        let _ = (&mut self.messages).take(2000).read_to_end(&mut text);
        String::from_utf8_lossy(&text).trim().to_string()
    }

    fn explain(&mut self, path: &Path, error: Error) -> Error {
        let _ = self.child.kill();
        let _ = self.child.wait();
        match self.last_words() {
            words if words.is_empty() => error,
            words => Error::format(path, format!("ffmpeg cannot decode it: {}. {CONVERT}", first_line(&words))),
        }
    }

    /// Waits for the program after its last frame; an error when it failed.
    fn finish(&mut self, path: &Path) -> Result<()> {
        let status = self.child.wait().map_err(|e| Error::io(path, e))?;
        let words = self.last_words();
        if !status.success() {
            return Err(Error::format(
                path,
                format!("ffmpeg stopped with {status}: {}. {CONVERT}", first_line(&words)),
            ));
        }
        if words.contains("File ended prematurely") {
            return Err(Error::format(path, format!("cut off: {words}")));
        }
        Ok(())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl<P: ChannelPolicy> FrameSource<P::Frame> for FfmpegSource<P> {
    fn next_frame(&mut self) -> Result<Option<P::Frame>> {
        match self.stream.next_frame() {
            Ok(None) => self.running.finish(&self.path).map(|()| None),
            Err(error) => Err(self.running.explain(&self.path, error)),
            frame => {
                self.times.pass(1);
                frame
            }
        }
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        let passed = self.stream.skip(count).map_err(|error| self.running.explain(&self.path, error))?;
        self.times.pass(passed);
        Ok(passed)
    }
    fn time(&self) -> Option<f64> {
        self.times.last.or_else(|| self.stream.time())
    }
    fn frame_rate(&self) -> Option<f64> {
        self.stream.frame_rate()
    }
    fn describe(&self) -> String {
        format!("{} (video, through ffmpeg)", self.path.display())
    }
}
