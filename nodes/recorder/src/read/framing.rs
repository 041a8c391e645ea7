//! Whether what a record says of its own lengths is true, before it is parsed.
//!
//! mcap 0.26 takes room for a text by the length that stands before it, up to 4 GiB, and subtracts the 4 bytes of an
//! attachment's CRC before it has compared lengths.

use mcap::records::op;

/// What is left of a record's body.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn skip(&mut self, bytes: usize) -> Option<()> {
        self.0 = self.0.get(bytes..)?;
        Some(())
    }

    fn length(&mut self) -> Option<usize> {
        let bytes = self.0.first_chunk()?;
        let length = u32::from_le_bytes(*bytes) as usize;
        self.skip(4)?;
        Some(length)
    }

    fn texts(&mut self, count: usize) -> Option<()> {
        for _ in 0..count {
            let length = self.length()?;
            self.skip(length)?;
        }
        Some(())
    }

    /// Texts by names, behind the bytes that they take together.
    fn text_map(&mut self) -> Option<()> {
        let length = self.length()?;
        let mut inside = Rest(self.0.get(..length)?);
        while !inside.0.is_empty() {
            inside.texts(2)?;
        }
        self.skip(length)
    }

    /// Data behind its length, then a CRC, and nothing else.
    fn data_and_crc(&mut self) -> Option<()> {
        let length = u64::from_le_bytes(*self.0.first_chunk()?);
        self.skip(8)?;
        let data = self.0.len().checked_sub(4)?;
        (length == data as u64).then_some(())
    }
}

/// Whether every text of a record ends inside it.
pub(super) fn is_framed(opcode: u8, body: &[u8]) -> bool {
    let mut rest = Rest(body);
    let mut walk = || match opcode {
        op::HEADER => rest.texts(2),
        op::SCHEMA => rest.skip(2).and_then(|()| rest.texts(2)),
        op::CHANNEL => {
            rest.skip(4)?;
            rest.texts(2)?;
            rest.text_map()
        }
        op::CHUNK_INDEX => {
            rest.skip(4 * 8)?;
            // Offsets of the message indexes, then the bytes of these.
            rest.texts(1)?;
            rest.skip(8)?;
            rest.texts(1)
        }
        op::ATTACHMENT => {
            rest.skip(2 * 8)?;
            rest.texts(2)?;
            rest.data_and_crc()
        }
        op::ATTACHMENT_INDEX => rest.skip(5 * 8).and_then(|()| rest.texts(2)),
        op::METADATA => rest.texts(1).and_then(|()| rest.text_map()),
        op::METADATA_INDEX => rest.skip(2 * 8).and_then(|()| rest.texts(1)),
        _ => Some(()),
    };
    walk().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Vec<u8> {
        let mut bytes = u32::try_from(text.len()).unwrap().to_le_bytes().to_vec();
        bytes.extend(text.as_bytes());
        bytes
    }

    #[test]
    fn a_text_longer_than_its_record_is_noticed_wherever_it_stands() {
        let map = [text("key"), text("value")].concat();
        let map_length = u32::try_from(map.len()).unwrap().to_le_bytes().to_vec();
        let two = [text("a"), text("bc")].concat();
        for (opcode, body) in [
            (op::HEADER, two.clone()),
            (op::SCHEMA, [vec![0; 2], two.clone(), text("data")].concat()),
            (
                op::CHANNEL,
                [vec![0; 4], two.clone(), map_length.clone(), map.clone()].concat(),
            ),
            (
                op::CHUNK_INDEX,
                [vec![0; 32], text(""), vec![0; 8], text("lz4"), vec![0; 16]].concat(),
            ),
            (op::ATTACHMENT_INDEX, [vec![0; 40], two.clone()].concat()),
            (op::METADATA, [text("a"), map_length, map].concat()),
            (op::METADATA_INDEX, [vec![0; 16], text("name")].concat()),
        ] {
            assert!(is_framed(opcode, &body), "{opcode}");
            let lengths = (0..body.len() - 3).filter(|at| {
                let length = u32::from_le_bytes(body[*at..at + 4].try_into().unwrap());
                (1..20).contains(&length) && body[*at + 1] == 0
            });
            for at in lengths.filter(|at| opcode != op::SCHEMA || *at < body.len() - 8) {
                let mut spoiled = body.clone();
                spoiled[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
                assert!(!is_framed(opcode, &spoiled), "{opcode} at {at}");
            }
        }
    }

    #[test]
    fn an_attachment_holds_its_data_and_nothing_more() {
        let mut body = [vec![0; 16], text("name"), text("type")].concat();
        body.extend(3_u64.to_le_bytes());
        body.extend([1, 2, 3, 0, 0, 0, 0]);
        assert!(is_framed(op::ATTACHMENT, &body));
        assert!(!is_framed(op::ATTACHMENT, &body[..body.len() - 1]));
        body.push(0);
        assert!(!is_framed(op::ATTACHMENT, &body));
    }
}
