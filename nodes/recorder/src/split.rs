//! One file of a recording: chunks, counted and sealed.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;

use crate::channel::Channel;
use crate::config::RecorderConfig;
use crate::layout::{FileEntry, TimeSpan};

/// Opcode, length and message header in front of a message's bytes.
const MESSAGE_OVERHEAD_BYTES: u64 = 9 + 22;

/// What the file below took, and why it took no more.
#[derive(Debug, Default)]
struct Taken {
    bytes: AtomicU64,
    fault: Mutex<Option<io::Error>>,
}

/// Counts the bytes that the file took and keeps the system's own reason when it takes no more.
#[derive(Debug)]
struct Counted<F> {
    file: F,
    taken: Arc<Taken>,
}

impl<F: Write> Write for Counted<F> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.file.write(bytes) {
            Ok(n) => {
                self.taken.bytes.fetch_add(n as u64, Ordering::Relaxed);
                Ok(n)
            }
            Err(error) => {
                let copy = copy_of(&error);
                if let Ok(mut fault) = self.taken.fault.lock() {
                    *fault = Some(copy);
                }
                Err(error)
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

fn copy_of(error: &io::Error) -> io::Error {
    error
        .raw_os_error()
        .map_or_else(|| error.kind().into(), io::Error::from_raw_os_error)
}

/// Why a file stopped.
#[derive(Debug)]
pub(crate) enum SplitFault {
    Io(io::Error),
    Format(mcap::McapError),
}

type Sink<F> = NoSeek<BufWriter<Counted<F>>>;

/// A file that is being written.
pub(crate) struct Split<F: Write> {
    pub(crate) name: String,
    writer: mcap::Writer<Sink<F>>,
    taken: Arc<Taken>,
    mcap_channels: Vec<u16>,
    chunk_size_bytes: u64,
    flush_period_nanos: u64,
    /// Bytes up to the end of the last whole record.
    sealed_bytes: u64,
    sealed_messages: u64,
    sealed_span: TimeSpan,
    open_messages: u64,
    open_bytes: u64,
    open_since_nanos: u64,
    open_span: TimeSpan,
}

impl<F: Write> Split<F> {
    pub(crate) fn begin(
        name: String,
        file: F,
        config: &RecorderConfig,
    ) -> Result<Self, SplitFault> {
        let taken = Arc::new(Taken::default());
        let counted = Counted {
            file,
            taken: Arc::clone(&taken),
        };
        // Chunks are gathered in memory and written whole: a killed process leaves whole chunks.
        // One thread compresses, so that the same messages give the same bytes.
        let writer = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("abbe-recorder/", env!("CARGO_PKG_VERSION")))
            .compression(config.compression.of_mcap())
            .compression_threads(0)
            .compression_level(config.compression.level())
            .chunk_size(None)
            .disable_seeking(true)
            .create(NoSeek::new(BufWriter::with_capacity(1 << 16, counted)));
        let writer = writer.map_err(|error| fault_of(&taken, error))?;
        let mut split = Self {
            name,
            writer,
            taken,
            mcap_channels: Vec::new(),
            chunk_size_bytes: config.chunk_size_bytes,
            flush_period_nanos: config.flush_period_nanos(),
            sealed_bytes: 0,
            sealed_messages: 0,
            sealed_span: TimeSpan::default(),
            open_messages: 0,
            open_bytes: 0,
            open_since_nanos: 0,
            open_span: TimeSpan::default(),
        };
        split.seal()?;
        Ok(split)
    }

    pub(crate) fn add_channel(
        &mut self,
        channel: &Channel,
        qos_yaml: &str,
    ) -> Result<(), SplitFault> {
        let encoding = if channel.definition.is_empty() {
            ""
        } else {
            "ros2msg"
        };
        let schema = self
            .writer
            .add_schema(&channel.type_name, encoding, channel.definition.as_bytes())
            .map_err(|error| fault_of(&self.taken, error))?;
        let metadata = BTreeMap::from([
            ("offered_qos_profiles".to_owned(), qos_yaml.to_owned()),
            ("topic_type_hash".to_owned(), channel.type_hash.clone()),
        ]);
        let id = self
            .writer
            .add_channel(schema, &channel.topic, "cdr", &metadata)
            .map_err(|error| fault_of(&self.taken, error))?;
        self.mcap_channels.push(id);
        Ok(())
    }

    /// Writes one message; true when a chunk was sealed before it.
    pub(crate) fn write(
        &mut self,
        channel: usize,
        mut header: MessageHeader,
        data: &[u8],
    ) -> Result<bool, SplitFault> {
        let full = self.open_bytes >= self.chunk_size_bytes;
        let old = self.open_messages > 0
            && header.log_time.abs_diff(self.open_since_nanos) >= self.flush_period_nanos;
        let sealed = self.open_messages > 0 && (full || old);
        // Counted before anything can fail: a message that is refused by a full disk is lost.
        self.open_messages += 1;
        if sealed {
            self.seal_before_last()?;
        }
        header.channel_id = self.mcap_channels[channel];
        self.writer
            .write_to_known_channel(&header, data)
            .map_err(|error| fault_of(&self.taken, error))?;
        if self.open_messages == 1 {
            self.open_since_nanos = header.log_time;
        }
        self.open_bytes += MESSAGE_OVERHEAD_BYTES + data.len() as u64;
        self.open_span.include(header.log_time);
        Ok(sealed)
    }

    fn seal_before_last(&mut self) -> Result<(), SplitFault> {
        self.flush()?;
        self.sealed_messages += self.open_messages - 1;
        self.open_messages = 1;
        self.close_chunk();
        Ok(())
    }

    /// Writes the open chunk, so that a crash from here on loses none of it.
    pub(crate) fn seal(&mut self) -> Result<(), SplitFault> {
        self.flush()?;
        self.sealed_messages += self.open_messages;
        self.open_messages = 0;
        self.close_chunk();
        Ok(())
    }

    fn flush(&mut self) -> Result<(), SplitFault> {
        self.writer
            .flush()
            .map_err(|error| fault_of(&self.taken, error))
    }

    fn close_chunk(&mut self) {
        self.open_bytes = 0;
        self.sealed_span.join(self.open_span);
        self.open_span = TimeSpan::default();
        self.sealed_bytes = self.bytes_taken();
    }

    fn bytes_taken(&self) -> u64 {
        self.taken.bytes.load(Ordering::Relaxed)
    }

    pub(crate) fn add_metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), SplitFault> {
        let record = Metadata {
            name: name.to_owned(),
            metadata,
        };
        self.writer
            .write_metadata(&record)
            .map_err(|error| fault_of(&self.taken, error))?;
        self.seal()
    }

    pub(crate) fn attach(&mut self, attachment: &mcap::Attachment<'_>) -> Result<(), SplitFault> {
        self.writer
            .attach(attachment)
            .map_err(|error| fault_of(&self.taken, error))?;
        self.seal()
    }

    /// Messages that a crash cannot take, and those that it can.
    pub(crate) fn messages(&self) -> (u64, u64) {
        (self.sealed_messages, self.open_messages)
    }

    pub(crate) fn sealed_bytes(&self) -> u64 {
        self.sealed_bytes
    }

    /// Earliest log time of its whole chunks.
    pub(crate) fn since_nanos(&self) -> Option<u64> {
        self.sealed_span.bounds_nanos().map(|(first, _)| first)
    }

    pub(crate) fn entry(&self) -> FileEntry {
        FileEntry {
            path: self.name.clone(),
            starting_time: self.sealed_span.starting_time(),
            duration: self.sealed_span.duration(),
            message_count: self.sealed_messages,
        }
    }

    pub(crate) fn span(&self) -> TimeSpan {
        self.sealed_span
    }

    /// Writes the index; the file is whole.
    pub(crate) fn finish(&mut self) -> Result<(), SplitFault> {
        self.seal()?;
        self.writer
            .finish()
            .map_err(|error| fault_of(&self.taken, error))?;
        Ok(())
    }

    /// Gives the file back to the system, with the last bytes of its index.
    pub(crate) fn close(self) -> Result<u64, SplitFault> {
        let taken = Arc::clone(&self.taken);
        match self.writer.into_inner().into_inner().into_inner() {
            Ok(_file) => Ok(taken.bytes.load(Ordering::Relaxed)),
            Err(error) => Err(SplitFault::Io(error.into_error())),
        }
    }

    /// Drops the file without writing what is still in memory.
    pub(crate) fn abandon(self) {
        let _ = self.writer.into_inner().into_inner().into_parts();
    }
}

fn fault_of(taken: &Taken, error: mcap::McapError) -> SplitFault {
    let fault = taken.fault.lock().ok().and_then(|mut fault| fault.take());
    match (fault, error) {
        (Some(fault), _) | (None, mcap::McapError::Io(fault)) => SplitFault::Io(fault),
        (None, error) => SplitFault::Format(error),
    }
}
