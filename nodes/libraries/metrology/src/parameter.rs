//! What a parameter of a node means: name, unit, sentence and limits, kept beside the configuration.
//!
//! A node crate lists its parameters in one `const` table; the runtime serves it to
//! `ros2 param describe`, and a test checks the node's README against it.

/// One parameter in a node's table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterDoc {
    /// Name, nested keys joined by dots; ends with the unit.
    pub name: &'static str,
    /// Unit as a person writes it, e.g. `µm/m`; empty for a number without one.
    pub unit: &'static str,
    /// Meaning, one sentence.
    pub description: &'static str,
    /// Least and greatest value, both allowed, where it is a number with limits.
    pub range: Option<(f64, f64)>,
}
