//! Node parameters: what `ros2 param` shows, and how they become a node's configuration.
//!
//! Parameters are resolved once, before the node is built, and frozen from then on: a bag holds the
//! resolved values, and only so do its inputs determine its outputs. A change is a restart.

/// A parameter's value, in the types of `rcl_interfaces/msg/ParameterValue`.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "named after the ROS parameter types")]
pub enum Value {
    Bool(bool),
    Integer(i64),
    Double(f64),
    String(String),
    BoolArray(Vec<bool>),
    IntegerArray(Vec<i64>),
    DoubleArray(Vec<f64>),
    StringArray(Vec<String>),
}

/// One parameter as it is served.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name, nested keys joined by dots.
    pub name: String,
    /// Value.
    pub value: Value,
    /// Meaning, with the unit.
    pub description: String,
    /// Least and greatest value, where it is a number with limits.
    pub range: Option<(f64, f64)>,
}
