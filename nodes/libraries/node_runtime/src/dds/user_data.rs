//! The type hash that ROS 2 transmits in USER_DATA of an endpoint.
//!
//! ```text
//!   parameter = length of the text, u32 | text | padding        (1)
//!   text      = (key "=" value ";")*                            (2)
//!   typehash  = "RIHS01_" 64 hexadecimal digits                 (3)
//! ```
//!
//! RustDDS passes (1) as it came, without its byte order, so the order is the one whose length fits.
//!
//! # References
//! OMG DDSI-RTPS 2.5, 9.6.4 for (1); `rmw_dds_common`, `qos.cpp`, `encode_type_hash_for_user_data_qos` for (2);
//! REP 2011 for (3).

/// Longest text that is read; that of ROS 2 has 81 bytes.
const LONGEST_TEXT: usize = 1_024;
const HASH_KEY: &str = "typehash";
const HASH_VERSION: &str = "RIHS01_";
const DIGITS: usize = 64;

/// The type hash in the value of a parameter USER_DATA; none where it is absent or malformed.
pub(super) fn type_hash(parameter: &[u8]) -> Option<String> {
    let mut pairs = text(parameter)?.split(';');
    let hash = pairs
        .find_map(|pair| pair.split_once('=').filter(|(key, _)| *key == HASH_KEY))?
        .1;
    is_hash(hash).then(|| hash.to_owned())
}

/// (1)
fn text(parameter: &[u8]) -> Option<&str> {
    let (length, rest) = parameter.split_first_chunk::<4>()?;
    let lengths = [u32::from_le_bytes(*length), u32::from_be_bytes(*length)];
    let mut fitting = lengths
        .into_iter()
        .filter_map(|length| usize::try_from(length).ok());
    let length = fitting.find(|length| *length <= rest.len().min(LONGEST_TEXT))?;
    std::str::from_utf8(&rest[..length]).ok()
}

/// (3)
fn is_hash(text: &str) -> bool {
    let digits = text.strip_prefix(HASH_VERSION);
    digits.is_some_and(|digits| {
        let mut all = digits.bytes();
        digits.len() == DIGITS && all.all(|one| matches!(one, b'0'..=b'9' | b'a'..=b'f'))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hash() -> String {
        format!("{HASH_VERSION}{}", "0123456789abcdef".repeat(4))
    }

    /// A parameter's value with the text behind its length in one byte order.
    fn parameter(text: &str, order: fn(u32) -> [u8; 4]) -> Vec<u8> {
        let mut value = order(u32::try_from(text.len()).unwrap()).to_vec();
        value.extend_from_slice(text.as_bytes());
        value.resize(value.len().next_multiple_of(4), 0);
        value
    }

    fn read(text: &str) -> Option<String> {
        let both = [u32::to_le_bytes, u32::to_be_bytes];
        let [little, big] = both.map(|order| type_hash(&parameter(text, order)));
        assert_eq!(little, big, "{text}");
        little
    }

    #[test]
    fn eq2_the_hash_stands_between_its_key_and_a_semicolon() {
        let hash = hash();
        for text in [
            format!("typehash={hash};"),
            format!("typehash={hash}"),
            format!("enclave=/;typehash={hash};other=1;"),
        ] {
            assert_eq!(read(&text), Some(hash.clone()), "{text}");
        }
    }

    #[test]
    fn eq3_texts_without_a_whole_hash_have_none() {
        let hash = hash();
        let upper = hash.to_uppercase();
        for text in [
            String::new(),
            "typehash".to_owned(),
            "typehash=;".to_owned(),
            format!("hash={hash};"),
            format!("typehash ={hash};"),
            format!("typehash={}0;", hash),
            format!("typehash={};", &hash[..hash.len() - 1]),
            format!("typehash={upper};"),
            format!("typehash={};", hash.replace("RIHS01", "RIHS02")),
            format!("{}typehash={hash};", "é".repeat(LONGEST_TEXT)),
        ] {
            assert_eq!(read(&text), None, "{text}");
        }
    }

    #[test]
    fn eq1_cut_and_lengthened_parameters_have_none() {
        let text = format!("typehash={};", hash());
        let whole = parameter(&text, u32::to_le_bytes);
        for len in 0..4 + text.len() {
            assert_eq!(type_hash(&whole[..len]), None, "{len}");
        }
        for length in [u32::MAX, 1 << 20, u32::try_from(whole.len()).unwrap()] {
            let mut spoiled = whole.clone();
            spoiled[..4].copy_from_slice(&length.to_le_bytes());
            assert_eq!(type_hash(&spoiled), None, "{length}");
        }
        let mut no_text = whole;
        no_text[7] = 0xff;
        assert_eq!(type_hash(&no_text), None);
    }
}
