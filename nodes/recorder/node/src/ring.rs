//! The last minutes of the network in memory, saved as a bag when somebody asks for it or an error begins.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use abbe_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus};
use abbe_msgs::{Message as _, from_cdr};
use anyhow::Result;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::{RawTap, Selection, TapEvent, Tapped};
use recorder::{
    RecorderConfig, RecorderError, RecordingSummary, Ring, RingConfig, RingSink, RingStats,
    RunContext, Snapshot,
};

use crate::begin::{free_folder, name_of};
use crate::capture::{Scribe, Store, Troubles};
use crate::time::Time;

/// Notices errors that begin on `/diagnostics`.
#[derive(Default)]
struct Alarm {
    standing: BTreeSet<String>,
}

impl Alarm {
    /// Whether a sample tells of an error that did not stand before.
    fn begins(&mut self, sample: &Tapped) -> bool {
        if sample.topic.type_name != DiagnosticArray::TYPE_NAME {
            return false;
        }
        let Ok(message) = from_cdr::<DiagnosticArray>(&sample.bytes) else {
            return false;
        };
        let mut begins = false;
        for status in message.status {
            if status.level == DiagnosticStatus::ERROR {
                begins |= self.standing.insert(status.name);
            } else {
                self.standing.remove(&status.name);
            }
        }
        begins
    }
}

type Saving = JoinHandle<Result<RecordingSummary, RecorderError>>;

/// A ring that goes on.
pub(crate) struct RingCapture {
    tap: RawTap,
    sink: RingSink,
    troubles: Arc<Troubles>,
    alarmed: Arc<AtomicBool>,
    folder: PathBuf,
    name: String,
    next: u32,
    writing: RecorderConfig,
    context: RunContext,
    saving: Vec<(PathBuf, Saving)>,
}

/// A save that has ended: where, and how many messages or why not.
pub(crate) type Saved = (PathBuf, Result<u64, String>);

impl RingCapture {
    /// Keeps what `selection` picks; bags are saved in `folder`.
    ///
    /// # Errors
    /// When a value is out of its range, or there is no network.
    pub fn start(
        names: &NodeNames,
        selection: Selection,
        config: &RingConfig,
        writing: RecorderConfig,
        (folder, context): (&Path, RunContext),
        time: Time,
    ) -> Result<Self> {
        writing.checked()?;
        let name = name_of(folder)?;
        let sink = RingSink::new(Ring::new(config)?);
        let troubles = Arc::<Troubles>::default();
        let alarmed = Arc::<AtomicBool>::default();
        let mut scribe = Scribe::new(Store::Ring(sink.clone()), Arc::clone(&troubles), time);
        let mut alarm = config.save_on_error.then(Alarm::default);
        let raised = Arc::clone(&alarmed);
        let tap = RawTap::start(&Environment::read()?, names, selection, move |event| {
            scribe.take(&event);
            if let (Some(alarm), TapEvent::Sample(sample)) = (&mut alarm, &event)
                && alarm.begins(sample)
            {
                raised.store(true, Ordering::Relaxed);
            }
        })?;
        Ok(Self {
            tap,
            sink,
            troubles,
            alarmed,
            folder: folder.to_owned(),
            name,
            next: 0,
            writing,
            context,
            saving: Vec::new(),
        })
    }

    /// Whether an error has begun since the last call.
    pub fn is_alarmed(&self) -> bool {
        self.alarmed.swap(false, Ordering::Relaxed)
    }

    pub fn stats(&self) -> RingStats {
        self.sink.stats()
    }

    pub fn troubles(&self) -> &Troubles {
        &self.troubles
    }

    /// Begins to write what is kept at this moment; gives the bag's folder and its messages.
    ///
    /// # Errors
    /// When no folder can be made for it.
    pub fn save(&mut self) -> Result<(PathBuf, usize), RecorderError> {
        let (path, directory) = free_folder(&self.folder, &self.name, &mut self.next)?;
        let snapshot = self.sink.snapshot();
        let messages = snapshot.len();
        let (writing, context) = (self.writing.clone(), self.context.clone());
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = name.into_owned();
        let write = move || Snapshot::write(&snapshot, directory, &name, &writing, &context);
        self.saving.push((path.clone(), std::thread::spawn(write)));
        Ok((path, messages))
    }

    /// Saves that have ended since the last call; `wait`: all of them.
    pub fn ended(&mut self, wait: bool) -> Vec<Saved> {
        let (ended, going): (Vec<_>, Vec<_>) = std::mem::take(&mut self.saving)
            .into_iter()
            .partition(|(_, saving)| wait || saving.is_finished());
        self.saving = going;
        let outcome = |(path, saving): (PathBuf, Saving)| {
            let outcome = match saving.join() {
                Ok(Ok(summary)) => Ok(summary.messages_written),
                Ok(Err(error)) => Err(error.to_string()),
                Err(_) => Err("the bag's thread panicked".to_owned()),
            };
            (path, outcome)
        };
        ended.into_iter().map(outcome).collect()
    }

    /// Leaves the network; patterns that fitted no topic, a sentence each.
    ///
    /// # Errors
    /// When the listener panicked.
    pub fn finish(self) -> Result<Vec<String>> {
        self.tap.stop()?;
        Ok(self.troubles.unmatched())
    }
}
