//! Compressed video, decoded by an `ffmpeg` program on the `PATH`.

use super::{FrameSource, Kind, Y4mSource};
use crate::error::{Error, Result};
use crate::io::channels::{ChannelPolicy, Colour, ColourUse};
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

pub(super) const KIND: Kind = Kind {
    name: "ffmpeg",
    accepts: |spec| Path::new(spec).is_file(),
    has_planes: false,
    open: |spec, options| Ok(Box::new(FfmpegSource::open_with("ffmpeg", spec, options.colour)?)),
    open_colour: |spec, options| Ok(Box::new(FfmpegSource::open_with("ffmpeg", spec, options.grey)?)),
};

/// "Every coded frame once": for `ffmpeg` 5.1 and later, and for earlier ones.
const EVERY_FRAME: [[&str; 2]; 2] = [["-fps_mode", "passthrough"], ["-vsync", "0"]];

/// Conversion to what [`Y4mSource`] takes colour for, from any matrix and depth of the file. Limited range,
/// since older programs say nothing of the range.
const COLOUR: [&str; 2] = ["-vf", "scale=out_color_matrix=bt601:out_range=tv,format=yuv444p"];

/// Frames of a video file. Grey ones are the luma plane as coded, 8 to 16 bit (see [`Y4mSource`]); colour
/// ones have 8 bit, converted by the program.
///
/// The program runs beside this process and is stopped when the source is dropped.
#[derive(Debug)]
pub struct FfmpegSource<P = Colour> {
    path: PathBuf,
    stream: Y4mSource<BufReader<ChildStdout>, P>,
    running: Running,
}

/// The program, stopped on drop, and the file that takes its messages.
#[derive(Debug)]
struct Running {
    child: Child,
    messages: File,
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
        let conversion: &[&str] = if policy.colour_use() == ColourUse::Kept { &COLOUR } else { &[] };
        let mut failure = None;
        for every_frame in EVERY_FRAME {
            let mut running = Running::start(program, path, every_frame, conversion)?;
            let Some(output) = running.child.stdout.take() else { break };
            match Y4mSource::new(path, BufReader::with_capacity(1 << 18, output)) {
                Ok(stream) => {
                    return Ok(Self { path: path.to_path_buf(), stream: stream.with_policy(policy), running });
                }
                Err(error) => failure = Some(running.explain(path, error)),
            }
            // Only a program that does not know the option deserves the older spelling.
            if !failure.as_ref().is_some_and(|e| e.to_string().contains("fps_mode")) {
                break;
            }
        }
        Err(failure.unwrap_or_else(|| Error::format(path, "ffmpeg gave no output")))
    }
}

impl Running {
    fn start(program: &Path, path: &Path, every_frame: [&str; 2], conversion: &[&str]) -> Result<Self> {
        let messages = tempfile::tempfile().map_err(|e| Error::io(std::env::temp_dir(), e))?;
        let for_child = messages.try_clone().map_err(|e| Error::io(std::env::temp_dir(), e))?;
        // A name that begins with a dash or holds a colon must not be taken for an option or a protocol.
        let mut input = std::ffi::OsString::from("file:");
        input.push(path);
        let child = Command::new(program)
            .args(["-nostdin", "-v", "error", "-i"])
            .arg(input)
            .args(["-map", "0:v:0"])
            .args(every_frame)
            .args(conversion)
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
        Ok(Self { child, messages })
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
            words => Error::format(path, format!("ffmpeg cannot decode it: {words}")),
        }
    }

    /// Waits for the program after its last frame; an error when it failed.
    fn finish(&mut self, path: &Path) -> Result<()> {
        let status = self.child.wait().map_err(|e| Error::io(path, e))?;
        if status.success() {
            return Ok(());
        }
        let words = self.last_words();
        Err(Error::format(path, format!("ffmpeg stopped with {status}: {words}")))
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
            frame => frame,
        }
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        self.stream.skip(count).map_err(|error| self.running.explain(&self.path, error))
    }
    fn frame_rate(&self) -> Option<f64> {
        self.stream.frame_rate()
    }
    fn describe(&self) -> String {
        format!("{} (video, through ffmpeg)", self.path.display())
    }
}
