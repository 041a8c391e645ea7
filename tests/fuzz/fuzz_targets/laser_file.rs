#![no_main]
#![allow(dead_code)]

#[path = "../import.rs"]
mod import;
#[path = "../messages.rs"]
mod messages;
#[path = "../targets.rs"]
mod targets;

libfuzzer_sys::fuzz_target!(|data: &[u8]| targets::laser_file(data));
