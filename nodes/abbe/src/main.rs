//! The command line of Abbe.

fn main() {}
