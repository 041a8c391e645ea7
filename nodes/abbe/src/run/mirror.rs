//! Shows a composed run on DDS, so that a person can watch it with `ros2`.

use anyhow::Result;
use node_runtime::Harness;

/// Publishes what the harness publishes.
pub struct Mirror;

impl Mirror {
    /// Begins.
    pub fn start(_harness: &mut Harness) -> Result<Option<Self>> {
        Ok(None)
    }
}
