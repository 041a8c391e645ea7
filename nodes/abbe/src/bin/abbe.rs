//! The program `abbe`: its command line is the library of the same name.

use std::process::ExitCode;

fn main() -> ExitCode {
    abbe::execute()
}
