//! Drives of the plant file, and their reduction to units of total inertia.

use metrology::Axis;
use serde::{Deserialize, Serialize};

use crate::plant::backlash::SoftBacklash;
use crate::plant::drive::DriveConstants;
use crate::plant::error::{PlantError, require, require_not_negative, require_positive};
use crate::plant::friction::FrictionConstants;

use super::heat::Place;

const MM_PER_M: f64 = 1e3;
const UM_PER_MM: f64 = 1e3;
const RAD_PER_ARCSEC: f64 = std::f64::consts::PI / 648_000.0;

/// A ball-screw drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearDriveEntry {
    /// Inertia of motor and screw, as mass at the nut.
    pub motor_inertia_kg: f64,
    /// Mass of the slide with all that it carries.
    pub slide_mass_kg: f64,
    /// Greatest force of the motor at the nut.
    pub force_limit_n: f64,
    /// Stiffness of screw, nut and bearing when the slide is pushed in the plus and the minus direction.
    pub screw_stiffness_n_per_um: [f64; 2],
    /// Share of critical damping of the elastic mode.
    pub screw_damping_ratio: f64,
    /// Width of the gap.
    pub backlash_um: f64,
    /// Rounding of the gap's corners.
    pub backlash_softness_um: f64,
    /// How the gap widens: what it is from some instants on.
    #[serde(default)]
    pub wear: Vec<WearEntry>,
    /// How the guides run dry: what their friction is from some instants on.
    #[serde(default)]
    pub lubrication: Vec<LubricationEntry>,
    /// Friction of bearings, seals and motor, at the nut.
    pub motor_friction: FrictionEntry,
    /// Friction of the guides.
    pub guide_friction: FrictionEntry,
    /// What the screw repeats with its turns; nothing where absent.
    #[serde(default)]
    pub lead_cycle: Option<LeadCycleEntry>,
}

/// Cyclic error of a screw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeadCycleEntry {
    /// Amplitude of what comes once a period.
    pub once_um: f64,
    /// Amplitude of what comes twice.
    pub twice_um: f64,
    /// Phase where the axis stands at zero.
    pub phase_deg: f64,
    /// Periods a turn of the screw.
    pub per_turn: f64,
    /// Growth of the amplitudes from the middle of the travel to its high end, as a share.
    pub growth: f64,
}

/// The gap from an instant on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WearEntry {
    /// Since the start.
    pub after_s: f64,
    /// Width of the gap.
    pub backlash_um: f64,
}

/// Friction of the guides from an instant on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LubricationEntry {
    /// Since the start.
    pub after_s: f64,
    /// Coulomb and breakaway friction over those of `guide_friction`.
    pub friction_ratio: f64,
}

/// Friction of a linear contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionEntry {
    /// Force at high velocity, viscous part not included.
    pub coulomb_n: f64,
    /// Force at breakaway.
    pub breakaway_n: f64,
    /// Velocity of half the Stribeck drop.
    pub stribeck_velocity_mm_s: f64,
    /// Viscous part.
    pub viscous_n_s_per_mm: f64,
    /// Elastic distance before everything slides.
    pub presliding_um: f64,
    /// Lag of friction behind velocity.
    pub memory_ms: f64,
}

/// A rotary drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotaryDriveEntry {
    /// Inertia on the motor's side of the gear, at the table.
    pub motor_inertia_kg_m2: f64,
    /// Inertia of table and load.
    pub table_inertia_kg_m2: f64,
    /// Greatest torque at the table.
    pub torque_limit_n_m: f64,
    /// Stiffness of the gear in plus and minus direction.
    pub gear_stiffness_n_m_per_arcsec: [f64; 2],
    /// Share of critical damping of the elastic mode.
    pub gear_damping_ratio: f64,
    /// Width of the gap.
    pub backlash_arcsec: f64,
    /// Rounding of the gap's corners.
    pub backlash_softness_arcsec: f64,
    /// Friction on the motor's side, at the table.
    pub motor_friction: RotaryFrictionEntry,
    /// Friction of the table's bearing.
    pub bearing_friction: RotaryFrictionEntry,
    /// Which place its friction warms.
    pub heats: Place,
}

/// Friction of a rotary contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotaryFrictionEntry {
    /// Torque at high velocity, viscous part not included.
    pub coulomb_n_m: f64,
    /// Torque at breakaway.
    pub breakaway_n_m: f64,
    /// Velocity of half the Stribeck drop.
    pub stribeck_velocity_rad_s: f64,
    /// Viscous part.
    pub viscous_n_m_s_per_rad: f64,
    /// Elastic angle before everything slides.
    pub presliding_arcsec: f64,
    /// Lag of friction behind velocity.
    pub memory_ms: f64,
}

/// A friction entry with force or torque turned into acceleration by `per_force`, lengths by `length`.
struct Contact<'a> {
    place: &'a str,
    coulomb: (&'static str, f64),
    breakaway: (&'static str, f64),
    stribeck: (&'static str, f64),
    viscous: (&'static str, f64),
    presliding: (&'static str, f64),
    memory_ms: f64,
}

impl Contact<'_> {
    fn constants(&self, per_force: f64, per_length: f64) -> Result<FrictionConstants, PlantError> {
        let at = |key: &str| format!("{}.{key}", self.place);
        require_positive(at(self.coulomb.0), self.coulomb.1)?;
        require(
            self.breakaway.1 >= self.coulomb.1 && self.breakaway.1.is_finite(),
            at(self.breakaway.0),
            self.breakaway.1,
            "finite and not below the Coulomb friction",
        )?;
        require_positive(at(self.stribeck.0), self.stribeck.1)?;
        require_not_negative(at(self.viscous.0), self.viscous.1)?;
        require_positive(at(self.presliding.0), self.presliding.1)?;
        require_not_negative(at("memory_ms"), self.memory_ms)?;
        Ok(FrictionConstants {
            coulomb: self.coulomb.1 * per_force,
            breakaway: self.breakaway.1 * per_force,
            stribeck_velocity: self.stribeck.1,
            viscous: self.viscous.1 * per_force,
            presliding: self.presliding.1 * per_length,
            memory_s: self.memory_ms / 1e3,
        })
    }
}

impl FrictionEntry {
    fn constants(&self, place: &str, per_force: f64) -> Result<FrictionConstants, PlantError> {
        Contact {
            place,
            coulomb: ("coulomb_n", self.coulomb_n),
            breakaway: ("breakaway_n", self.breakaway_n),
            stribeck: ("stribeck_velocity_mm_s", self.stribeck_velocity_mm_s),
            viscous: ("viscous_n_s_per_mm", self.viscous_n_s_per_mm),
            presliding: ("presliding_um", self.presliding_um),
            memory_ms: self.memory_ms,
        }
        .constants(per_force, 1.0 / UM_PER_MM)
    }
}

impl RotaryFrictionEntry {
    fn constants(&self, place: &str, per_torque: f64) -> Result<FrictionConstants, PlantError> {
        Contact {
            place,
            coulomb: ("coulomb_n_m", self.coulomb_n_m),
            breakaway: ("breakaway_n_m", self.breakaway_n_m),
            stribeck: ("stribeck_velocity_rad_s", self.stribeck_velocity_rad_s),
            viscous: ("viscous_n_m_s_per_rad", self.viscous_n_m_s_per_rad),
            presliding: ("presliding_arcsec", self.presliding_arcsec),
            memory_ms: self.memory_ms,
        }
        .constants(per_torque, RAD_PER_ARCSEC)
    }
}

impl LinearDriveEntry {
    pub(in crate::plant) fn constants(&self, axis: Axis) -> Result<DriveConstants, PlantError> {
        let at = |key: &str| format!("linear_drives.{axis}.{key}");
        require_positive(at("motor_inertia_kg"), self.motor_inertia_kg)?;
        require_positive(at("slide_mass_kg"), self.slide_mass_kg)?;
        require_positive(at("force_limit_n"), self.force_limit_n)?;
        require_positive(
            at("screw_stiffness_n_per_um[0]"),
            self.screw_stiffness_n_per_um[0],
        )?;
        require_positive(
            at("screw_stiffness_n_per_um[1]"),
            self.screw_stiffness_n_per_um[1],
        )?;
        require_not_negative(at("screw_damping_ratio"), self.screw_damping_ratio)?;
        require_not_negative(at("backlash_um"), self.backlash_um)?;
        require_positive(at("backlash_softness_um"), self.backlash_softness_um)?;
        let mass_kg = self.motor_inertia_kg + self.slide_mass_kg;
        let per_force = MM_PER_M / mass_kg;
        let stiffness = |n_per_um: f64| n_per_um * UM_PER_MM * per_force;
        Ok(DriveConstants {
            motor_share: self.motor_inertia_kg / mass_kg,
            demand_limit: self.force_limit_n * per_force,
            coupling: SoftBacklash {
                half_width: 0.5 * self.backlash_um / UM_PER_MM,
                softness: self.backlash_softness_um / UM_PER_MM,
                stiffness_up: stiffness(self.screw_stiffness_n_per_um[0]),
                stiffness_down: stiffness(self.screw_stiffness_n_per_um[1]),
            },
            damping_ratio: self.screw_damping_ratio,
            motor_friction: self
                .motor_friction
                .constants(&at("motor_friction"), per_force)?,
            slide_friction: self
                .guide_friction
                .constants(&at("guide_friction"), per_force)?,
        })
    }
}

impl LinearDriveEntry {
    /// Instants, s since the start, with half the width that the gap has from then on, mm.
    pub(in crate::plant) fn wear(&self, axis: Axis) -> Result<Vec<(f64, f64)>, PlantError> {
        let place = format!("linear_drives.{axis}.wear");
        let entries = self.wear.iter();
        let all = entries.map(|entry| (entry.after_s, entry.backlash_um));
        let all = course(&place, "backlash_um", all.collect())?;
        let half_mm = |um: f64| 0.5 * um / UM_PER_MM;
        Ok(all
            .into_iter()
            .map(|(after_s, um)| (after_s, half_mm(um)))
            .collect())
    }

    /// Instants, s since the start, with the friction of the guides from then on over that with oil.
    pub(in crate::plant) fn dryness(&self, axis: Axis) -> Result<Vec<(f64, f64)>, PlantError> {
        let place = format!("linear_drives.{axis}.lubrication");
        let entries = self.lubrication.iter();
        let all = entries.map(|entry| (entry.after_s, entry.friction_ratio));
        course(&place, "friction_ratio", all.collect())
    }
}

/// Instants in order with values that are not negative.
fn course(place: &str, key: &str, entries: Vec<(f64, f64)>) -> Result<Vec<(f64, f64)>, PlantError> {
    let mut before_s = 0.0;
    for (k, (after_s, value)) in entries.iter().enumerate() {
        require(
            after_s.is_finite() && *after_s >= before_s,
            format!("{place}[{k}].after_s"),
            *after_s,
            "finite and not below the one before",
        )?;
        require_not_negative(format!("{place}[{k}].{key}"), *value)?;
        before_s = *after_s;
    }
    Ok(entries)
}

impl RotaryDriveEntry {
    pub(in crate::plant) fn constants(&self, axis: Axis) -> Result<DriveConstants, PlantError> {
        let at = |key: &str| format!("rotary_drives.{axis}.{key}");
        let stiffnesses = self.gear_stiffness_n_m_per_arcsec;
        require_positive(at("motor_inertia_kg_m2"), self.motor_inertia_kg_m2)?;
        require_positive(at("table_inertia_kg_m2"), self.table_inertia_kg_m2)?;
        require_positive(at("torque_limit_n_m"), self.torque_limit_n_m)?;
        require_positive(at("gear_stiffness_n_m_per_arcsec[0]"), stiffnesses[0])?;
        require_positive(at("gear_stiffness_n_m_per_arcsec[1]"), stiffnesses[1])?;
        require_not_negative(at("gear_damping_ratio"), self.gear_damping_ratio)?;
        require_not_negative(at("backlash_arcsec"), self.backlash_arcsec)?;
        require_positive(
            at("backlash_softness_arcsec"),
            self.backlash_softness_arcsec,
        )?;
        let inertia_kg_m2 = self.motor_inertia_kg_m2 + self.table_inertia_kg_m2;
        let per_torque = 1.0 / inertia_kg_m2;
        Ok(DriveConstants {
            motor_share: self.motor_inertia_kg_m2 / inertia_kg_m2,
            demand_limit: self.torque_limit_n_m * per_torque,
            coupling: SoftBacklash {
                half_width: 0.5 * self.backlash_arcsec * RAD_PER_ARCSEC,
                softness: self.backlash_softness_arcsec * RAD_PER_ARCSEC,
                stiffness_up: stiffnesses[0] / RAD_PER_ARCSEC * per_torque,
                stiffness_down: stiffnesses[1] / RAD_PER_ARCSEC * per_torque,
            },
            damping_ratio: self.gear_damping_ratio,
            motor_friction: self
                .motor_friction
                .constants(&at("motor_friction"), per_torque)?,
            slide_friction: self
                .bearing_friction
                .constants(&at("bearing_friction"), per_torque)?,
        })
    }
}
