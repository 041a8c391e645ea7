//! The frames of one file: kind, length, body.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

use super::LossReason;

/// Kind and length in front of every record.
pub(super) const FRAME_BYTES: u64 = 9;
/// `0x89 MCAP 0 CR LF` at both ends of a file.
const MAGIC_BYTES: u64 = 8;

/// Where a record stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Frame {
    pub opcode: u8,
    /// Byte of the opcode.
    pub at: u64,
    /// Length of the body as written.
    pub body_bytes: u64,
    /// Length of the body as far as the file goes.
    pub present_bytes: u64,
}

impl Frame {
    pub(super) fn end(self) -> u64 {
        self.at + FRAME_BYTES + self.body_bytes
    }

    pub(super) fn is_whole(self) -> bool {
        self.present_bytes == self.body_bytes
    }

    pub(super) fn cut(self) -> LossReason {
        LossReason::Cut {
            opcode: self.opcode,
            end_byte: self.at + FRAME_BYTES + self.present_bytes,
        }
    }
}

/// Walks from frame to frame.
pub(super) struct Walker<R> {
    source: BufReader<R>,
    at: u64,
    length: u64,
    crc: Option<crc32fast::Hasher>,
}

impl<R: Read + Seek> Walker<R> {
    /// Stands behind the magic; `with_crc` keeps the CRC of all that is read in order.
    pub(super) fn begin(mut source: R, with_crc: bool) -> Result<Self, LossReason> {
        let length = source.seek(SeekFrom::End(0)).map_err(io_loss)?;
        source.seek(SeekFrom::Start(0)).map_err(io_loss)?;
        let mut walker = Self {
            source: BufReader::with_capacity(1 << 16, source),
            at: 0,
            length,
            crc: with_crc.then(crc32fast::Hasher::new),
        };
        let mut magic = [0_u8; MAGIC_BYTES as usize];
        if length < MAGIC_BYTES {
            return Err(LossReason::NotMcap);
        }
        walker.fill(&mut magic)?;
        if magic != mcap::MAGIC {
            return Err(LossReason::NotMcap);
        }
        Ok(walker)
    }

    pub(super) fn at(&self) -> u64 {
        self.at
    }

    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// CRC of everything read so far, when nothing was skipped.
    pub(super) fn crc(&self) -> Option<u32> {
        self.crc.clone().map(crc32fast::Hasher::finalize)
    }

    /// The next frame, `None` at the end of the file.
    pub(super) fn next_frame(&mut self) -> Result<Option<Frame>, LossReason> {
        let left = self.length - self.at;
        if left == 0 {
            return Ok(None);
        }
        let at = self.at;
        let mut bytes = [0_u8; FRAME_BYTES as usize];
        if left < FRAME_BYTES {
            let part = left as usize;
            self.fill(&mut bytes[..part])?;
            return Err(LossReason::Cut {
                opcode: bytes[0],
                end_byte: self.length,
            });
        }
        self.fill(&mut bytes)?;
        let [opcode, length @ ..] = bytes;
        if opcode == 0 {
            return Err(LossReason::BadRecord { opcode });
        }
        let body_bytes = u64::from_le_bytes(length);
        Ok(Some(Frame {
            opcode,
            at,
            body_bytes,
            present_bytes: body_bytes.min(self.length - self.at),
        }))
    }

    /// Reads what is there of the body into `body`, behind what it holds.
    pub(super) fn read_body(&mut self, frame: Frame, body: &mut Vec<u8>) -> Result<(), LossReason> {
        let begin = body.len();
        // The caller has compared the length with the file's and with its own limit.
        body.resize(begin + frame.present_bytes as usize, 0);
        self.fill(&mut body[begin..])
    }

    pub(super) fn skip_body(&mut self, frame: Frame) -> Result<(), LossReason> {
        self.seek(self.at + frame.present_bytes)
    }

    pub(super) fn seek(&mut self, to: u64) -> Result<(), LossReason> {
        let to = to.min(self.length);
        let step = i64::try_from(to as i128 - self.at as i128).map_err(|_| LossReason::Io {
            kind: io::ErrorKind::InvalidInput,
        })?;
        self.source.seek_relative(step).map_err(io_loss)?;
        self.at = to;
        self.crc = None;
        Ok(())
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), LossReason> {
        self.source.read_exact(bytes).map_err(io_loss)?;
        self.at += bytes.len() as u64;
        if let Some(crc) = &mut self.crc {
            crc.update(bytes);
        }
        Ok(())
    }
}

fn io_loss(error: io::Error) -> LossReason {
    LossReason::Io { kind: error.kind() }
}
