//! The file of a log, read piece by piece.

use std::fmt;
use std::io::Read;

use crate::stage::LogRead;

/// Bytes that are read at a time.
const PIECE_BYTES: usize = 1 << 16;

/// A log that is read as far as it reached when it was opened; what is added later is not replayed.
pub struct LogFile {
    source: Box<dyn Read + Send>,
    piece: Vec<u8>,
    read: u64,
}

impl fmt::Debug for LogFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "LogFile at byte {}", self.read)
    }
}

impl LogFile {
    /// The first `length` bytes of a log.
    #[must_use]
    pub fn new(source: impl Read + Send + 'static, length: u64) -> Self {
        Self {
            source: Box::new(source.take(length)),
            piece: vec![0; PIECE_BYTES],
            read: 0,
        }
    }

    /// The next piece.
    pub fn read(&mut self) -> LogRead<'_> {
        loop {
            match self.source.read(&mut self.piece) {
                Ok(0) => return LogRead::End,
                Ok(length) => {
                    self.read += length as u64;
                    return LogRead::Bytes(&self.piece[..length]);
                }
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => {
                    return LogRead::Failed {
                        reason: error.to_string(),
                        at_byte: self.read,
                    };
                }
            }
        }
    }
}
