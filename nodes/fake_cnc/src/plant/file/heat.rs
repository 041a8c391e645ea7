//! Heat sources, capacities and paths of the plant file.

use std::collections::BTreeMap;
use std::fmt;

use metrology::Axis;
use serde::{Deserialize, Serialize};

/// A lumped heat capacity of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(
    missing_docs,
    reason = "named places; left and right are -X and +X, front is -Y"
)]
pub enum Place {
    SpindleFront,
    SpindleRear,
    SpindleMotor,
    Head,
    ColumnFront,
    ColumnRear,
    ColumnLeft,
    ColumnRight,
    Bed,
    BedBase,
    Table,
    TableCentre,
    Workpiece,
    Posts,
}

impl Place {
    /// How many there are.
    pub const COUNT: usize = 14;
    /// All places, in the order in which arrays hold them.
    pub const ALL: [Self; Self::COUNT] = [
        Self::SpindleFront,
        Self::SpindleRear,
        Self::SpindleMotor,
        Self::Head,
        Self::ColumnFront,
        Self::ColumnRear,
        Self::ColumnLeft,
        Self::ColumnRight,
        Self::Bed,
        Self::BedBase,
        Self::Table,
        Self::TableCentre,
        Self::Workpiece,
        Self::Posts,
    ];
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SpindleFront => "spindle_front",
            Self::SpindleRear => "spindle_rear",
            Self::SpindleMotor => "spindle_motor",
            Self::Head => "head",
            Self::ColumnFront => "column_front",
            Self::ColumnRear => "column_rear",
            Self::ColumnLeft => "column_left",
            Self::ColumnRight => "column_right",
            Self::Bed => "bed",
            Self::BedBase => "bed_base",
            Self::Table => "table",
            Self::TableCentre => "table_centre",
            Self::Workpiece => "workpiece",
            Self::Posts => "posts",
        })
    }
}

/// All heat of the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeatEntry {
    /// Temperature at which the machine has its cold geometry.
    pub reference_temp_degc: f64,
    /// Air of the shop.
    pub shop_air: ShopAirEntry,
    /// Every lumped place.
    pub places: BTreeMap<Place, PlaceEntry>,
    /// Conduction between places.
    pub links: Vec<LinkEntry>,
    /// Sources that are always on (cabinet, hydraulics, holding torque).
    pub standing_heat_w: BTreeMap<Place, f64>,
    /// The spindle's losses.
    pub spindle: SpindleLossEntry,
    /// Ball screws by axis.
    pub screws: BTreeMap<Axis, ScrewEntry>,
}

/// Air of the shop over the day.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShopAirEntry {
    /// Temperature at the start, to which everything has soaked.
    pub start_temp_degc: f64,
    /// Amplitude of the day's cycle.
    pub day_amplitude_k: f64,
    /// Phase of the day's cycle at the start; 0 is its steepest rise.
    pub day_phase_deg: f64,
    /// Standard deviation of slow random draughts.
    pub draught_k: f64,
    /// Correlation time of the draughts.
    pub draught_time_s: f64,
}

/// One lumped place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaceEntry {
    /// Heat capacity.
    pub heat_capacity_j_per_k: f64,
    /// Convection to the air.
    pub to_air_w_per_k: f64,
}

/// Conduction between two places.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkEntry {
    /// One end.
    pub from: Place,
    /// The other end.
    pub to: Place,
    /// Conductance.
    pub conductance_w_per_k: f64,
}

/// Losses of the spindle: power at 1000 1/min times (speed / 1000 1/min)^exponent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpindleLossEntry {
    /// Front bearings.
    pub front_bearing_w_at_1000_rpm: f64,
    /// Rear bearing.
    pub rear_bearing_w_at_1000_rpm: f64,
    /// Exponent of the bearings' losses.
    pub bearing_exponent: f64,
    /// Motor.
    pub motor_w_at_1000_rpm: f64,
    /// Exponent of the motor's losses.
    pub motor_exponent: f64,
}

/// Which end of a screw is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScrewEnd {
    /// The end at the lower axis position.
    Low,
    /// The end at the higher axis position.
    High,
}

/// A ball screw with nut, bearing and motor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScrewEntry {
    /// Nut positions, as axis positions, at which the nut would stand at the two ends of the screw.
    pub ends_mm: [f64; 2],
    /// Where the fixed bearing and the motor are.
    pub fixed_end: ScrewEnd,
    /// Diameter.
    pub diameter_mm: f64,
    /// Thermal conductivity.
    pub conductivity_w_per_m_k: f64,
    /// Heat capacity by volume.
    pub heat_capacity_mj_per_m3_k: f64,
    /// Expansion coefficient.
    pub expansion_um_per_m_k: f64,
    /// Convection of the screw's surface.
    pub convection_w_per_m2_k: f64,
    /// Stretch between the bearings when cold; 0: the far bearing floats.
    pub pretension_um: f64,
    /// Length of the nut.
    pub nut_length_mm: f64,
    /// Friction torque of the preloaded nut.
    pub nut_torque_n_m: f64,
    /// Share of the nut's heat that enters the screw at once.
    pub nut_heat_share_to_screw: f64,
    /// Heat capacity of the nut.
    pub nut_heat_capacity_j_per_k: f64,
    /// Conductance from nut to screw.
    pub nut_to_screw_w_per_k: f64,
    /// Conductance from nut to `nut_place`.
    pub nut_to_place_w_per_k: f64,
    /// What carries the nut.
    pub nut_place: Place,
    /// Friction torque of the fixed bearing.
    pub bearing_torque_n_m: f64,
    /// Heat capacity of fixed bearing and motor flange.
    pub bearing_heat_capacity_j_per_k: f64,
    /// Conductance from bearing to screw.
    pub bearing_to_screw_w_per_k: f64,
    /// Conductance from bearing to `bearing_place`.
    pub bearing_to_place_w_per_k: f64,
    /// What carries the fixed bearing and the guides.
    pub bearing_place: Place,
    /// Loss of the motor that reaches its flange, per square of its force.
    pub motor_loss_w_per_kn2: f64,
}
