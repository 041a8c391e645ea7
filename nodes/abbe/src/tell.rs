//! Results on standard output.
//!
//! Whoever reads them may leave before the end (`abbe report BAG | head`): what is left is then not wanted, which is no
//! failure. Any other failure to write is one, and ends the program with 1: a page that is half told is none.

use node_runtime::complain;

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};

/// A line of a result, as `println!` takes it.
macro_rules! tell {
    ($($text:tt)*) => {
        $crate::tell::line(format_args!($($text)*))
    };
}
pub(crate) use tell;

/// Writes a line to standard output.
pub fn line(text: Arguments<'_>) {
    if let Err(error) = to(&mut std::io::stdout().lock(), text) {
        complain!("abbe: standard output: {error}");
        std::process::exit(1);
    }
}

fn to(out: &mut impl Write, text: Arguments<'_>) -> std::io::Result<()> {
    match writeln!(out, "{text}") {
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
    fn a_reader_who_has_left_is_no_failure_and_a_full_disk_is_one() {
        assert!(to(&mut Gone(ErrorKind::BrokenPipe), format_args!("x")).is_ok());
        let full = to(&mut Gone(ErrorKind::StorageFull), format_args!("x"));
        assert_eq!(full.unwrap_err().kind(), ErrorKind::StorageFull);
    }
}
