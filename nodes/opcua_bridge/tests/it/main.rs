//! The bridge as its shell drives it.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![cfg_attr(
    feature = "opcua",
    expect(clippy::disallowed_methods, reason = "a peer is waited for")
)]

mod attempts;
mod stage;

#[cfg(feature = "opcua")]
mod server;
