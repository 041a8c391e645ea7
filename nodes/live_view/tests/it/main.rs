//! The live view as others see it: its page from what was heard, and its server over loopback.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod page;
#[cfg(feature = "serve")]
mod served;
mod settings;
