//! Plain CDR, the form of every message on DDS and in bags.
//!
//! Four bytes of encapsulation header, then the fields in order, each aligned to its size counted
//! from the end of the header (OMG DDSI-RTPS 2.5, 10.2; CDR of CORBA 3.4, 9.3).

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::CdrDeserializer;

use crate::{Message, WireError};

/// Header of what is written here: little-endian plain CDR, no options.
pub const ENCAPSULATION: [u8; 4] = [0x00, 0x01, 0x00, 0x00];

const BIG_ENDIAN_CDR: u16 = 0x0000;
const LITTLE_ENDIAN_CDR: u16 = 0x0001;

/// RTPS pads a payload to a multiple of four bytes.
const MOST_PADDING: usize = 3;

/// The bytes of a message, header included.
#[must_use]
pub fn to_cdr<M: Message>(message: &M) -> Vec<u8> {
    let mut bytes = Vec::new();
    to_cdr_into(message, &mut bytes);
    bytes
}

/// Replaces what is in `bytes` by those of the message, header included; the buffer is kept.
pub fn to_cdr_into<M: Message>(message: &M, bytes: &mut Vec<u8>) {
    bytes.clear();
    bytes.extend_from_slice(&ENCAPSULATION);
    cdr_encoding::to_writer::<M, LittleEndian, _>(bytes, message)
        .expect("a Vec takes every byte and every generated type knows its lengths");
}

/// The message in bytes of either endianness, header included.
///
/// A length that the bytes cannot hold is noticed when they end: a sequence grows only as its
/// elements are read, and every element has at least one byte.
///
/// # Errors
/// When the bytes are not plain CDR, end early, hold a bad boolean or text, or go on after the end.
pub fn from_cdr<M: Message>(bytes: &[u8]) -> Result<M, WireError> {
    let Some((&[kind_high, kind_low, _, _], payload)) = bytes.split_first_chunk::<4>() else {
        return Err(WireError::NoHeader {
            message: M::TYPE_NAME,
            len: bytes.len(),
            needed: ENCAPSULATION.len(),
        });
    };
    let (decoded, consumed) = match u16::from_be_bytes([kind_high, kind_low]) {
        LITTLE_ENDIAN_CDR => {
            let mut reader = CdrDeserializer::<LittleEndian>::new(payload);
            (M::deserialize(&mut reader), reader.bytes_consumed())
        }
        BIG_ENDIAN_CDR => {
            let mut reader = CdrDeserializer::<BigEndian>::new(payload);
            (M::deserialize(&mut reader), reader.bytes_consumed())
        }
        kind => {
            return Err(WireError::UnknownEncapsulation {
                message: M::TYPE_NAME,
                kind,
            });
        }
    };
    let message = decoded.map_err(|source| WireError::Malformed {
        message: M::TYPE_NAME,
        at_byte: consumed + ENCAPSULATION.len(),
        len: bytes.len(),
        source,
    })?;
    let excess = payload.len() - consumed;
    if excess > MOST_PADDING {
        return Err(WireError::TooLong {
            message: M::TYPE_NAME,
            excess,
            limit: MOST_PADDING,
        });
    }
    Ok(message)
}
