//! What goes beside a payload: number, time and sender, as `rmw_zenoh_cpp` serialises them.
//!
//! ```text
//!   number i64 | nanoseconds since 1970 i64 | 16 | sender 16 bytes      33 bytes, little-endian
//! ```

use ::zenoh::bytes::ZBytes;

use crate::network::{Guid, RequestIdentity};

const SENDER_LEN: u8 = 16;
const LEN: usize = 33;

/// The three fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Attachment {
    pub sequence: i64,
    pub source_nanos: i64,
    pub sender: Guid,
}

impl Attachment {
    pub fn bytes(&self) -> [u8; LEN] {
        let mut bytes = [0; LEN];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.source_nanos.to_le_bytes());
        bytes[16] = SENDER_LEN;
        bytes[17..].copy_from_slice(&self.sender);
        bytes
    }

    /// `None` when it is something else.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (sequence, rest) = bytes.split_first_chunk::<8>()?;
        let (source, rest) = rest.split_first_chunk::<8>()?;
        let (len, rest) = rest.split_first()?;
        let sender = Guid::try_from(rest).ok().filter(|_| *len == SENDER_LEN)?;
        Some(Self {
            sequence: i64::from_le_bytes(*sequence),
            source_nanos: i64::from_le_bytes(*source),
            sender,
        })
    }

    pub fn of(attached: Option<&ZBytes>) -> Result<Self, String> {
        let read = attached.and_then(|bytes| Self::read(&bytes.to_bytes()));
        read.ok_or_else(|| "no number, time and sender attached, as rmw_zenoh_cpp does".to_owned())
    }

    pub const fn identity(&self) -> RequestIdentity {
        RequestIdentity {
            writer: self.sender,
            sequence: self.sequence,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_that_of_rmw_zenoh() {
        let attachment = Attachment {
            sequence: 7,
            source_nanos: 0x0102_0304_0506_0708,
            sender: [0xab; 16],
        };
        let bytes = attachment.bytes();
        let expected: Vec<u8> = [7, 0, 0, 0, 0, 0, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1, 16]
            .into_iter()
            .chain([0xab; 16])
            .collect();
        assert_eq!(bytes[..], expected);
        assert_eq!(Attachment::read(&bytes), Some(attachment));
        assert_eq!(Attachment::read(&bytes[..32]), None);
        assert_eq!(Attachment::read(&[]), None);
    }
}
