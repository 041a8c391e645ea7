//! Results on standard output.
//!
//! Whoever reads them may leave before the end (`abbe report BAG | head`): what is left is then not wanted, which is no
//! failure, nor is a terminal that was closed. Any other failure to write is one, and ends the program with 1: a page that is
//! printed only in part must not look whole.

use metrology::visible::visible;
use node_runtime::complain;

use std::fmt::Arguments;
use std::io::{Error, ErrorKind, Write};
use std::os::unix::fs::FileTypeExt;

use nix::errno::Errno;

/// A line of a result, as `println!` takes it.
macro_rules! tell {
    ($($text:tt)*) => {
        $crate::tell::line(format_args!($($text)*))
    };
}
pub(crate) use tell;

/// Writes a line to standard output.
pub fn line(text: Arguments<'_>) {
    if let Err(error) = to(&mut std::io::stdout().lock(), text)
        && !(is_of_closed_terminal(&error) && is_device())
    {
        complain!("abbe: standard output: {error}");
        std::process::exit(1);
    }
}

/// Whether a write failed as on a closed terminal; a failing disk gives the same error.
fn is_of_closed_terminal(error: &Error) -> bool {
    error.raw_os_error() == Some(Errno::EIO as i32)
}

/// Whether standard output is a terminal, or another device without blocks. A closed one is no longer recognised as one.
fn is_device() -> bool {
    let out = std::fs::metadata("/dev/stdout");
    out.is_ok_and(|out| out.file_type().is_char_device())
}

fn to(out: &mut impl Write, text: Arguments<'_>) -> std::io::Result<()> {
    // What comes from outside commands no terminal.
    match writeln!(out, "{}", visible(&text.to_string())) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        told => told,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that is gone, or a disk that is full.
    struct Gone(ErrorKind);

    impl Write for Gone {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn control_characters_are_written_out_and_json_stays_json() {
        let mut out = Vec::new();
        let name = serde_json::json!({ "name": "\u{9b}2J\u{202e}" });
        to(&mut out, format_args!("{name}")).unwrap();
        let shown = String::from_utf8(out).unwrap();
        assert_eq!(shown, "{\"name\":\"\\u009b2J\\u202e\"}\n");
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&shown).unwrap(),
            name
        );
    }

    #[test]
    fn a_reader_who_has_left_is_no_failure_and_a_full_disk_is_one() {
        assert!(to(&mut Gone(ErrorKind::BrokenPipe), format_args!("x")).is_ok());
        assert!(is_of_closed_terminal(&Error::from_raw_os_error(5)));
        assert!(!is_of_closed_terminal(&ErrorKind::StorageFull.into()));
        let full = to(&mut Gone(ErrorKind::StorageFull), format_args!("x"));
        assert_eq!(full.unwrap_err().kind(), ErrorKind::StorageFull);
    }
}
