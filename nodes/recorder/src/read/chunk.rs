//! The inside of a chunk: decompressed, checked, and walked record by record.

use std::io::Read;
use std::ops::Range;

use mcap::records::op;

use super::walk::{FRAME_BYTES, Frame};
use super::{LARGEST_READ_CHUNK_BYTES, LossReason};

/// Channel, sequence, log time and publish time in front of a message's bytes.
const MESSAGE_HEADER_BYTES: usize = 22;

/// The part of a chunk's header that reading needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ChunkHeader {
    pub start_nanos: u64,
    plain_bytes: u64,
    crc: u32,
    compression: Range<usize>,
    data: Range<usize>,
}

/// One record inside a chunk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Inside {
    Message {
        channel: u16,
        sequence: u32,
        log_time_nanos: u64,
        publish_time_nanos: u64,
        data: Range<usize>,
    },
    Other {
        opcode: u8,
        body: Range<usize>,
    },
    /// No more records.
    End,
    /// Bytes that are no record, or a record that its end cuts.
    Bad {
        opcode: u8,
    },
}

/// Buffers for one chunk at a time, kept from chunk to chunk.
#[derive(Default)]
pub(super) struct ChunkBuffer {
    /// Body of the chunk record as it stands in the file.
    pub raw: Vec<u8>,
    plain: Vec<u8>,
    /// The records where they stand in `raw`, or `None` where they stand in `plain`.
    in_raw: Option<Range<usize>>,
    at: usize,
    zstd: Option<zstd::bulk::Decompressor<'static>>,
}

impl ChunkBuffer {
    pub(super) fn records(&self) -> &[u8] {
        match &self.in_raw {
            Some(range) => &self.raw[range.clone()],
            None => &self.plain,
        }
    }

    /// Takes `raw` as the records themselves.
    pub(super) fn take_bare(&mut self) {
        self.in_raw = Some(0..self.raw.len());
        self.at = 0;
    }

    pub(super) fn clear(&mut self) {
        self.raw.clear();
        self.plain.clear();
        self.in_raw = None;
        self.at = 0;
    }

    /// Opens the chunk whose body, or the part of it that the file holds, is in `raw`.
    pub(super) fn open(&mut self, frame: Frame) -> Result<ChunkHeader, LossReason> {
        self.plain.clear();
        self.in_raw = Some(0..0);
        self.at = 0;
        let header = parse_header(&self.raw, frame)?;
        let data = &self.raw[header.data.clone()];
        let compression = &self.raw[header.compression.clone()];
        let failed = || LossReason::Decompression {
            chunk_bytes: frame.body_bytes,
            compression: String::from_utf8_lossy(compression).into_owned(),
        };
        let plain_bytes = header.plain_bytes as usize;
        match compression {
            b"" => self.in_raw = Some(header.data.clone()),
            b"zstd" if frame.is_whole() => {
                self.plain.reserve(plain_bytes);
                if self.zstd.is_none() {
                    self.zstd = zstd::bulk::Decompressor::new().ok();
                }
                let decompressor = self.zstd.as_mut().ok_or_else(failed)?;
                decompressor
                    .decompress_to_buffer(data, &mut self.plain)
                    .map_err(|_| failed())?;
                self.in_raw = None;
            }
            b"zstd" => {
                let decoder = zstd::stream::read::Decoder::new(data).map_err(|_| failed())?;
                read_what_comes(decoder, plain_bytes, &mut self.plain);
                self.in_raw = None;
            }
            b"lz4" => {
                let decoder = lz4_flex::frame::FrameDecoder::new(data);
                let whole = read_what_comes(decoder, plain_bytes, &mut self.plain);
                if frame.is_whole() && !whole {
                    return Err(failed());
                }
                self.in_raw = None;
            }
            _ => return Err(failed()),
        }
        if frame.is_whole() {
            self.check(&header, frame)?;
        }
        Ok(header)
    }

    fn check(&mut self, header: &ChunkHeader, frame: Frame) -> Result<(), LossReason> {
        let records = self.records();
        let calculated = crc32fast::hash(records);
        let record_bytes = records.len() as u64;
        let chunk_bytes = frame.body_bytes;
        let wrong = if record_bytes != header.plain_bytes {
            LossReason::ChunkLength {
                chunk_bytes,
                saved_bytes: header.plain_bytes,
                record_bytes,
            }
        } else if header.crc != 0 && header.crc != calculated {
            // A CRC of 0 means that the writer computed no CRC.
            LossReason::ChunkCrc {
                chunk_bytes,
                saved: header.crc,
                calculated,
            }
        } else {
            return Ok(());
        };
        self.in_raw = Some(0..0);
        Err(wrong)
    }

    /// The record at the cursor; steps behind it.
    pub(super) fn step(&mut self) -> Inside {
        let records = match &self.in_raw {
            Some(range) => &self.raw[range.clone()],
            None => self.plain.as_slice(),
        };
        record_at(records, &mut self.at)
    }
}

/// Reads one record of `records` at `at`.
fn record_at(records: &[u8], at: &mut usize) -> Inside {
    let rest = &records[*at..];
    if rest.is_empty() {
        return Inside::End;
    }
    let frame = FRAME_BYTES as usize;
    let opcode = rest[0];
    let bad = Inside::Bad { opcode };
    let Some(length) = rest.get(1..frame).and_then(le_u64) else {
        *at = records.len();
        return bad;
    };
    let body = *at + frame;
    let fits = opcode != 0 && length <= (records.len() - body) as u64;
    let end = if fits {
        body + length as usize
    } else {
        records.len()
    };
    *at = end;
    if !fits {
        return bad;
    }
    if opcode != op::MESSAGE {
        return Inside::Other {
            opcode,
            body: body..end,
        };
    }
    let Some(header) = records[body..end].first_chunk::<MESSAGE_HEADER_BYTES>() else {
        return bad;
    };
    let [c0, c1, s0, s1, s2, s3, times @ ..] = *header;
    let (log, publish) = times.split_at(8);
    Inside::Message {
        channel: u16::from_le_bytes([c0, c1]),
        sequence: u32::from_le_bytes([s0, s1, s2, s3]),
        log_time_nanos: le_u64(log).unwrap_or_default(),
        publish_time_nanos: le_u64(publish).unwrap_or_default(),
        data: body + MESSAGE_HEADER_BYTES..end,
    }
}

fn le_u64(bytes: &[u8]) -> Option<u64> {
    bytes.first_chunk().map(|b| u64::from_le_bytes(*b))
}

fn le_u32(bytes: &[u8]) -> Option<u32> {
    bytes.first_chunk().map(|b| u32::from_le_bytes(*b))
}

fn parse_header(body: &[u8], frame: Frame) -> Result<ChunkHeader, LossReason> {
    let parse = || {
        let name_bytes = le_u32(body.get(28..)?)? as usize;
        let name_end = 32_usize.checked_add(name_bytes)?;
        let data_begin = name_end.checked_add(8)?;
        let data_bytes = le_u64(body.get(name_end..data_begin)?)?;
        let present = (body.len() - data_begin) as u64;
        // A whole chunk must hold all its data; a cut one holds what is there.
        if frame.is_whole() && data_bytes > present {
            return None;
        }
        Some(ChunkHeader {
            start_nanos: le_u64(body)?,
            plain_bytes: le_u64(body.get(16..)?)?,
            crc: le_u32(body.get(24..)?)?,
            compression: 32..name_end,
            data: data_begin..data_begin + data_bytes.min(present) as usize,
        })
    };
    let header = parse().ok_or(if frame.is_whole() {
        LossReason::BadRecord {
            opcode: frame.opcode,
        }
    } else {
        frame.cut()
    })?;
    if header.plain_bytes > LARGEST_READ_CHUNK_BYTES {
        return Err(LossReason::ChunkTooLarge {
            bytes: header.plain_bytes,
            limit_bytes: LARGEST_READ_CHUNK_BYTES,
        });
    }
    Ok(header)
}

/// Decompresses until the data or the limit ends; true when the data ended well.
fn read_what_comes(mut source: impl Read, limit_bytes: usize, plain: &mut Vec<u8>) -> bool {
    plain.resize(limit_bytes, 0);
    let mut filled = 0;
    let well = loop {
        match source.read(&mut plain[filled..]) {
            Ok(0) => break true,
            Ok(count) => filled += count,
            Err(_) => break false,
        }
    };
    plain.truncate(filled);
    well
}
