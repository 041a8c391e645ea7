//! Probe, artefacts, sensors and faults of the plant file.

use serde::{Deserialize, Serialize};

/// The touch probe as it really is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TouchProbeEntry {
    /// Mean time from electrical contact to the edge's arrival at the control.
    pub latency_ms: f64,
    /// Standard deviation of that time.
    pub jitter_ms: f64,
    /// Standard deviation of one trigger's place.
    pub repeatability_um: f64,
    /// True radius of the ball less the machine file's.
    pub ball_radius_deviation_um: f64,
    /// From the plane of the supports to the ball's centre.
    pub stylus_length_mm: f64,
    /// Diameter of the stylus' stem.
    pub stem_diameter_mm: f64,
    /// Elastic modulus of the stem.
    pub stem_modulus_gpa: f64,
    /// Force of the seating spring.
    pub spring_force_n: f64,
    /// Radius on which the three supports stand.
    pub support_radius_mm: f64,
    /// Direction of the first support from +X.
    pub support_angle_deg: f64,
    /// Share of the tipping force at which the first contact opens.
    pub contact_share: f64,
    /// Growth of the triggering force with speed.
    pub force_growth_s_per_m: f64,
    /// How far the ball must come back before the contact closes again.
    pub release_hysteresis_um: f64,
}

/// The artefacts as they really are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArtefactsEntry {
    /// Edge of a reference block.
    pub block_edge_mm: f64,
    /// Wall of a ring gauge.
    pub ring_wall_mm: f64,
    /// Height of ring gauges and bosses, centred on the probing height.
    pub height_mm: f64,
    /// Thickness of plane artefacts.
    pub plane_thickness_mm: f64,
    /// Standard deviation with which artefacts stand off their nominal place, per direction.
    pub placement_um: f64,
}

/// All temperature sensors alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorsEntry {
    /// First-order lag.
    pub time_constant_s: f64,
    /// Standard deviation of the sensors' offsets.
    pub offset_k: f64,
    /// Standard deviation of one reading.
    pub noise_k: f64,
}

/// What is broken.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultsEntry {
    /// Fault of the probe.
    #[serde(default)]
    pub probe: ProbeFaultEntry,
    /// Artefacts that are not there.
    #[serde(default)]
    pub missing_blocks: Vec<String>,
    /// Artefacts that are knocked.
    #[serde(default)]
    pub bumped_blocks: Vec<BumpEntry>,
}

/// Fault of the probe.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum ProbeFaultEntry {
    /// The probe works.
    #[default]
    None,
    /// The signal says deflected whatever the stylus does.
    StuckClosed {
        /// From when, since the start.
        from_s: f64,
    },
    /// The signal says free whatever the stylus does.
    Dead {
        /// From when, since the start.
        from_s: f64,
    },
    /// The contact chatters: pairs of edges follow each true one.
    Bounce {
        /// Number of pairs.
        pairs: u32,
        /// Mean time between edges; each is drawn between half of it and one and a half.
        spacing_us: f64,
    },
}

/// A knock that shifts an artefact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BumpEntry {
    /// Name of the artefact.
    pub id: String,
    /// When, since the start.
    pub at_s: f64,
    /// By how much, workpiece frame.
    pub shift_um: [f64; 3],
}
