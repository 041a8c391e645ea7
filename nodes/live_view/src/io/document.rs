//! The page as one document with its style and program, and its content security policy.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

const FRAME: &str = include_str!("../../assets/page.html");
const STYLE: &str = include_str!("../../assets/page.css");
const PROGRAM: &str = include_str!("../../assets/page.js");

/// The document and its content security policy.
#[derive(Clone, Debug)]
pub(super) struct Document {
    pub html: String,
    pub policy: String,
}

fn hash(text: &str) -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text)))
}

impl Document {
    /// The policy allows this style, this program and connections to the own server only.
    pub fn new() -> Self {
        let html = FRAME
            .replace("/*STYLE*/", STYLE)
            .replace("/*PROGRAM*/", PROGRAM);
        let policy = format!(
            "default-src 'none'; script-src {}; style-src {}; connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
            hash(PROGRAM),
            hash(STYLE),
        );
        Self { html, policy }
    }
}
