//! Why no run is proposed for something that a diagnosis left open.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What the runs of the library cannot do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the sentence names each field")]
pub enum NoRun {
    /// No run that can be proposed tells these apart.
    Separates {
        effects: Vec<String>,
        delta: f64,
        lever: String,
    },
    /// No run makes an effect large enough to be named: its D, the most that it would be, and what it has to be.
    Raises {
        effect: String,
        d: f64,
        most_d: f64,
        wanted_d: f64,
    },
    /// One run tells an effect from what looks like it and another makes it large enough to be named; none does both.
    DoesBoth {
        effect: String,
        d: f64,
        wanted_d: f64,
        separates: String,
        raises: String,
    },
}

impl fmt::Display for NoRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Separates {
                effects,
                delta,
                lever,
            } => write!(
                f,
                "no run in the library separates {} (squared distance {delta:.1} at most, 9 decides); the lever is {lever}",
                effects.join(" and ")
            ),
            Self::Raises {
                effect,
                d,
                most_d,
                wanted_d,
            } => write!(
                f,
                "no run in the library makes {effect} large enough to be named: D is {d:.1}, would be {most_d:.1} at most, \
                 and is surely named from {wanted_d:.1}"
            ),
            Self::DoesBoth {
                effect,
                d,
                wanted_d,
                separates,
                raises,
            } => write!(
                f,
                "no run in the library decides of {effect} alone: \"{separates}\" tells it from what looks like it, \
                 \"{raises}\" makes it large enough to be named (D is {d:.1}, surely from {wanted_d:.1}); run both"
            ),
        }
    }
}
