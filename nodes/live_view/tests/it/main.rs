//! The live view as others see it: its page from what was heard, and its server over loopback.

mod page;
#[cfg(feature = "serve")]
mod served;
mod settings;
