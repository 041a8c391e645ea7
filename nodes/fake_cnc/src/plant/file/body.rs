//! Shape of the machine in the plant file: structure that heat bends, errors of geometry, and the oil under the slides.

use std::collections::BTreeMap;

use metrology::Axis;
use serde::{Deserialize, Serialize};

/// Dimensions and expansion of the structure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructureEntry {
    /// Expansion of the castings.
    pub casting_expansion_um_per_m_k: f64,
    /// From the column's foot to the head's carriage when Z is 0.
    pub carriage_height_mm: f64,
    /// Depth of the column along Y.
    pub column_depth_mm: f64,
    /// Width of the column along X.
    pub column_width_mm: f64,
    /// From the carriage to the spindle axis, towards the operator (-Y).
    pub overhang_mm: f64,
    /// From the carriage down to the spindle's locating bearing.
    pub head_drop_mm: f64,
    /// Expansion of the spindle's shaft.
    pub shaft_expansion_um_per_m_k: f64,
    /// From the locating (rear) bearing to the front bearing.
    pub shaft_between_bearings_mm: f64,
    /// From the front bearing to the nose.
    pub shaft_nose_mm: f64,
    /// From the column's foot to the anchorage of the table's slide, along Y.
    pub bed_length_mm: f64,
    /// Depth of the bed.
    pub bed_depth_mm: f64,
    /// From the bed's guides to the table's top.
    pub table_height_mm: f64,
    /// Radius of the table's disc.
    pub table_radius_mm: f64,
    /// Height of the table's top, workpiece frame.
    pub table_top_mm: f64,
    /// Expansion of the table.
    pub table_expansion_um_per_m_k: f64,
    /// Expansion of the workpiece.
    pub workpiece_expansion_um_per_m_k: f64,
    /// Expansion of the posts on which the artefacts stand.
    pub post_expansion_um_per_m_k: f64,
    /// Expansion of the linear scales.
    pub scale_expansion_um_per_m_k: f64,
}

/// Errors of the cold geometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeometryEntry {
    /// Error motions of each linear axis.
    pub linear: BTreeMap<Axis, LinearErrorEntry>,
    /// Error motions and location of each rotary axis.
    pub rotary: BTreeMap<Axis, RotaryErrorEntry>,
    /// Squareness.
    pub squareness_urad: SquarenessEntry,
}

/// Tilt of one axis' line towards another's, µrad: the slope itself, not a component of ISO 230-1, of which it is
/// −EC0Y, +EB0Z and −EA0Z in this order (`metrology::squareness`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SquarenessEntry {
    /// Y towards X.
    pub y_to_x: f64,
    /// Z towards X.
    pub z_to_x: f64,
    /// Z towards Y.
    pub z_to_y: f64,
}

/// Standard deviations from which the error motions of a linear axis are drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearErrorEntry {
    /// Along the axis.
    pub positioning_um: f64,
    /// Across it.
    pub straightness_um: f64,
    /// About each direction.
    pub angular_urad: f64,
    /// Error of the screw's lead.
    pub lead_um_per_m: f64,
    /// Where the carriage is guided, machine frame, axes at zero: the centre of its rotations.
    pub carriage_mm: [f64; 3],
    /// Forms that are known by their drawing, beside what is drawn at random; none where absent.
    #[serde(default)]
    pub form: Vec<GuideFormEntry>,
}

/// A form of a guide in one of its six error motions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GuideFormEntry {
    /// X, Y, Z: a shift along it; A, B, C: a turn about X, Y, Z.
    pub component: Axis,
    /// Height of a bow over the travel's ends; µm of a shift, µrad of a turn.
    pub bow_um_urad: f64,
    /// Amplitude of one wave over the travel.
    pub wave_um_urad: f64,
    /// Depth of a dent.
    pub dent_um_urad: f64,
    /// Where the dent is.
    pub dent_at_mm: f64,
    /// Half width at 1/e of its depth.
    pub dent_width_mm: f64,
}

/// How a slide floats on the oil of its guides, differently from minute to minute.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OilFilmEntry {
    /// Standard deviation along the axis.
    pub along_um: f64,
    /// Standard deviation in each direction across it.
    pub across_um: f64,
    /// Distance along the axis over which it changes (correlation falls to exp(-1/2)).
    pub length_mm: f64,
    /// Time over which it changes (correlation falls to exp(-1)).
    pub time_s: f64,
}

/// How the tool shakes against the workpiece.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VibrationEntry {
    /// Amplitude along X, Y and Z of the workpiece.
    pub amplitude_um: [f64; 3],
    /// Frequency that it wanders about.
    pub frequency_hz: f64,
    /// Standard deviation of the frequency.
    pub wander_hz: f64,
    /// Time over which the frequency changes (correlation falls to exp(-1)).
    pub wander_time_s: f64,
}

/// Error motions and location of a rotary axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotaryErrorEntry {
    /// Standard deviation along and across the axis.
    pub run_out_um: f64,
    /// Standard deviation of tilts.
    pub wobble_urad: f64,
    /// Standard deviation of angular positioning.
    pub positioning_urad: f64,
    /// Shift of the axis' line from its nominal place, machine frame.
    pub location_um: [f64; 3],
    /// Tilt of the axis' line about X, Y and Z.
    pub tilt_urad: [f64; 3],
}
