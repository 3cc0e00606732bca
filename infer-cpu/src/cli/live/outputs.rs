//! The outputs of objects: lines on standard output, and a recording.

use std::io::{self, BufWriter, ErrorKind, StdoutLock, Write};

use crate::live::{Object, Pipeline, RecordError, Recorder};

pub struct Outputs {
    lines: Option<BufWriter<StdoutLock<'static>>>,
    recorder: Option<Recorder>,
    /// Why the lines or the recording ended early.
    lines_failure: Option<io::Error>,
    recorder_failure: Option<RecordError>,
}

impl Outputs {
    /// Lines, if `prints`, and a recording, if there is a recorder.
    pub fn new(prints: bool, recorder: Option<Recorder>) -> Self {
        let lines = prints.then(|| BufWriter::new(io::stdout().lock()));
        Self { lines, recorder, lines_failure: None, recorder_failure: None }
    }

    /// Writes an object, and flushes its line.
    pub fn object(&mut self, object: &Object) {
        if let Some(lines) = &mut self.lines {
            let line = serde_json::to_writer(&mut *lines, object).map_err(io::Error::from);
            let written = line.and_then(|()| writeln!(lines)).and_then(|()| lines.flush());
            if let Err(failure) = written {
                (self.lines, self.lines_failure) = (None, Some(failure));
            }
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.object(object);
        }
    }

    /// Records the last packet of `pipeline`, after its objects. A robot needs its results even if
    /// its disk is full: lines continue if the recording fails.
    pub fn packet(&mut self, pipeline: &Pipeline) {
        let Some(recorder) = &mut self.recorder else { return };
        if let Err(failure) = recorder.packet(pipeline) {
            if self.lines.is_some() {
                let cause = &failure.source;
                program::say!(
                    "warning: the recording ends, the lines continue: {failure}: {cause}"
                );
            }
            (self.recorder, self.recorder_failure) = (None, Some(failure));
        }
    }

    /// Whether an output still works.
    pub fn are_wanted(&self) -> bool {
        self.lines_failure.is_none() && (self.lines.is_some() || self.recorder_failure.is_none())
    }

    pub fn end(self, pipeline: &Pipeline) -> anyhow::Result<()> {
        let recorded = self.recorder.map(|recorder| recorder.finish(pipeline)).transpose();
        if let Some(failure) = self.lines_failure.filter(|f| f.kind() != ErrorKind::BrokenPipe) {
            return Err(failure.into());
        }
        if let Some((file, n_turns @ 1..)) = self.recorder_failure.map_or(recorded, Err)? {
            let turns = formats::counted(n_turns, "turn");
            let boxes = formats::counted(pipeline.counts().clusters, "box");
            program::say!("{}: {turns}, {boxes} of objects", file.display());
        }
        Ok(())
    }
}
