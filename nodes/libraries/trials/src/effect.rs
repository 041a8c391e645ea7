//! What can be hidden in a plant, class by class.
//!
//! A class has the id of the catalogue's entry that describes it, what it can act on, and the range of its physical
//! sizes. Hiding it changes the plant's file or the control's gains, never the machine file. Its *form* is the plant's
//! own physics; a *foreign* form is one that the catalogue's formula does not follow:
//!
//! | class | hidden as | foreign form |
//! |---|---|---|
//! | `backlash` | play of the drive with slightly rounded corners | corners as wide as a third of the play, or (1) |
//! | `scale_error` | lead error of the screw | and a quarter as much of a bow, which is a `pitch_error` |
//! | `squareness` | lean of an axis | and a tenth of µm per µrad as a bow, which is its `straightness` |
//! | `pitch_error`, `straightness`, `angular_error` | bow and S of a guide, as cosine and sine | a dent besides |
//! | `cyclic_error` | once and twice a turn | not quite once a turn, growing along the screw |
//! | `servo_lag` | another velocity feed-forward | a softer position loop |
//! | `reversal_spike` | friction of the motor's side | with a breakaway force twice as large |
//! | `probe_latency` | a later trigger | a triggering force that grows with the feed |
//! | `clock_offset` | late stamps of the grid encoder | by 10 to 40 % more and less from minute to minute, a `clock_drift` |
//! | `length_wavelength` | wrong wavelength of the laser | which drifts |
//! | `screw_elongation` | a nut that rubs | and a bearing that rubs |
//! | `drive_windup` | a softer screw | softer in one direction |
//!
//! Corners of a play are no wider than the friction of the guides, a deflection f of the screw, presses the slide
//! through: of a play b whose corners are wider than
//!
//! ```text
//!   eps = sqrt(f b / 2)                                                   (1)
//! ```
//!
//! friction alone would not cross three quarters; the slide would hang on a soft spring, which is another effect.
//!
//! The tool of a machine whose effects are foreign shakes besides, at a frequency that wanders.
//!
//! Classes that the common programme does not show are in `own`, each with its programme.

use fake_cnc::plant::{GuideFormEntry, LeadCycleEntry};
use metrology::Axis;
use serde::{Deserialize, Serialize};

use crate::error::TrialError;
use crate::rig::Rig;

/// A class of effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the ids of the catalogue")]
pub enum Class {
    Backlash,
    ScaleError,
    Squareness,
    PitchError,
    Straightness,
    AngularError,
    CyclicError,
    ServoLag,
    ReversalSpike,
    ProbeLatency,
    ClockOffset,
    LengthWavelength,
    ScrewElongation,
    DriveWindup,
    PlateError,
    ClockDrift,
    ProbeLobing,
    ProbePretravel,
    LatencyJitter,
    InterpolationError,
    RotaryLocation,
    RotaryMotion,
    RotaryBacklash,
    SpindleGrowth,
    ColumnBend,
    AmbientDrift,
}

use Class::{
    AmbientDrift, AngularError, Backlash, ClockDrift, ClockOffset, ColumnBend, CyclicError,
    DriveWindup, InterpolationError, LatencyJitter, LengthWavelength, PitchError, PlateError,
    ProbeLatency, ProbeLobing, ProbePretravel, ReversalSpike, RotaryBacklash, RotaryLocation,
    RotaryMotion, ScaleError, ScrewElongation, ServoLag, SpindleGrowth, Squareness, Straightness,
};

/// An effect that is hidden.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hidden {
    /// Its class.
    pub class: Class,
    /// What it acts on, as the catalogue names it.
    pub axis: &'static str,
    /// Its size, in the class' unit.
    pub size: f64,
    /// Whether its form is foreign.
    pub is_foreign: bool,
    /// What else its form depends on: two numbers from 0 to 1.
    pub shape: [f64; 2],
}

const AXES: &[&str] = &["X", "Y", "Z"];

impl Class {
    /// Every class that the common programme shows, in order.
    pub const ALL: [Self; 14] = [
        Backlash,
        ScaleError,
        Squareness,
        PitchError,
        Straightness,
        AngularError,
        CyclicError,
        ServoLag,
        ReversalSpike,
        ProbeLatency,
        ClockOffset,
        LengthWavelength,
        ScrewElongation,
        DriveWindup,
    ];

    /// Classes that have a programme of their own, in order.
    pub const OWN: [Self; 12] = [
        PlateError,
        ClockDrift,
        ProbeLobing,
        ProbePretravel,
        LatencyJitter,
        InterpolationError,
        RotaryLocation,
        RotaryMotion,
        RotaryBacklash,
        SpindleGrowth,
        ColumnBend,
        AmbientDrift,
    ];

    /// Every class, whatever shows it.
    pub fn every() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().chain(Self::OWN)
    }

    /// Classes with a double, and what looks like them.
    pub const CONFUSABLE: [(Self, &'static str); 7] = [
        (Backlash, "reversal_spike"),
        (ReversalSpike, "backlash"),
        (ScaleError, "length_wavelength"),
        (LengthWavelength, "scale_error"),
        (ServoLag, "clock_offset"),
        (Squareness, "straightness"),
        (DriveWindup, "acceleration_lag"),
    ];

    /// Id of the catalogue's entry.
    #[must_use]
    pub const fn id(self) -> &'static str {
        [
            "backlash",
            "scale_error",
            "squareness",
            "pitch_error",
            "straightness",
            "angular_error",
            "cyclic_error",
            "servo_lag",
            "reversal_spike",
            "probe_latency",
            "clock_offset",
            "length_wavelength",
            "screw_elongation",
            "drive_windup",
            "plate_error",
            "clock_drift",
            "probe_lobing",
            "probe_pretravel",
            "latency_jitter",
            "interpolation_error",
            "rotary_location",
            "rotary_motion",
            "rotary_backlash",
            "spindle_growth",
            "column_bend",
            "ambient_drift",
        ][self as usize]
    }

    /// What it can act on.
    #[must_use]
    pub const fn axes(self) -> &'static [&'static str] {
        match self {
            Squareness => &["XY", "XZ", "YZ"],
            Straightness => &["YX", "ZX", "XY", "ZY", "XZ", "YZ"],
            AngularError => &["AX", "BX", "CX", "AY", "BY", "CY", "AZ", "BZ"],
            ProbeLatency | LengthWavelength | PlateError | ProbeLobing | ProbePretravel
            | LatencyJitter | SpindleGrowth | ColumnBend => &[""],
            ClockOffset | ClockDrift => &["grid"],
            InterpolationError => &["X", "Y"],
            RotaryLocation => &["X0C", "Y0C", "Y0A", "Z0A"],
            RotaryMotion => &["CC", "AA"],
            RotaryBacklash => &["C", "A"],
            AmbientDrift => &["Y"],
            _ => AXES,
        }
    }

    /// Least and greatest physical size, and the unit.
    #[must_use]
    pub const fn sizes(self) -> ([f64; 2], &'static str) {
        match self {
            Backlash => ([0.3, 20.0], "µm"),
            ScaleError => ([1.0, 60.0], "µm/m"),
            Squareness => ([1.0, 60.0], "µrad"),
            PitchError => ([0.1, 15.0], "µm"),
            Straightness => ([0.3, 30.0], "µm"),
            AngularError => ([1.0, 60.0], "µrad"),
            CyclicError => ([0.1, 5.0], "µm"),
            ServoLag => ([0.02, 2.0], "ms"),
            ReversalSpike => ([20.0, 2500.0], "N"),
            ProbeLatency => ([0.05, 5.0], "ms"),
            ClockOffset => ([0.01, 5.0], "ms"),
            LengthWavelength => ([0.5, 40.0], "ppm"),
            ScrewElongation => ([0.05, 8.0], "N m"),
            DriveWindup => ([0.2, 12.0], "µm at 1 m/s2"),
            PlateError => ([1.0, 60.0], "µm/m"),
            ClockDrift => ([0.1, 50.0], "ppm"),
            ProbeLobing | ProbePretravel => ([0.1, 8.0], "N"),
            LatencyJitter => ([0.01, 0.5], "ms"),
            InterpolationError => ([0.02, 0.5], "µm"),
            RotaryLocation => ([1.0, 50.0], "µm"),
            RotaryMotion => ([1.0, 200.0], "µrad"),
            RotaryBacklash => ([0.5, 30.0], "arcsec"),
            SpindleGrowth => ([0.05, 5.0], "W at 1000 /min"),
            ColumnBend | AmbientDrift => ([10.0, 2000.0], "W"),
        }
    }

    /// Whether the physics has sizes of both signs.
    #[must_use]
    pub const fn has_both_signs(self) -> bool {
        matches!(
            self,
            ScaleError
                | Squareness
                | PitchError
                | Straightness
                | AngularError
                | ClockOffset
                | LengthWavelength
                | PlateError
                | ClockDrift
                | RotaryLocation
        )
    }

    /// The catalogue's parameter that is this size, where there is one.
    #[must_use]
    pub const fn parameter(self) -> Option<&'static str> {
        match self {
            Backlash => Some("width_um"),
            ScaleError => Some("scale_um_per_m"),
            Squareness => Some("angle_urad"),
            ServoLag => Some("time_ms"),
            ProbeLatency => Some("latency_ms"),
            ClockOffset => Some("offset_ms"),
            LengthWavelength => Some("scale_ppm"),
            DriveWindup => Some("windup_um"),
            ClockDrift => Some("drift_ppm"),
            LatencyJitter => Some("jitter_ms"),
            RotaryLocation => Some("size_um_urad"),
            _ => None,
        }
    }
}

impl Hidden {
    /// The same at another size.
    #[must_use]
    pub const fn sized(self, size: f64) -> Self {
        Self { size, ..self }
    }

    /// The catalogue's entry that its form brings along on the same target.
    #[must_use]
    pub const fn besides(&self) -> Option<&'static str> {
        match self.class {
            ScaleError if self.is_foreign => Some("pitch_error"),
            Squareness if self.is_foreign => Some("straightness"),
            ClockOffset if self.is_foreign => Some("clock_drift"),
            // The seat of a probe whose stylus bends lobes as well.
            ProbePretravel => Some("probe_lobing"),
            _ => None,
        }
    }

    /// Hides it.
    ///
    /// # Errors
    /// Where this machine cannot have it.
    pub fn hide(&self, rig: &mut Rig) -> Result<(), TrialError> {
        let done = match self.class {
            Backlash | CyclicError | ReversalSpike | DriveWindup => self.in_drive(rig),
            ScaleError | PitchError | Straightness | AngularError => self.in_guide(rig),
            Squareness => self.in_squareness(rig),
            ServoLag => self.in_control(rig),
            ScrewElongation => self.in_screw(rig),
            ProbeLatency => {
                let probe = &mut rig.plant.touch_probe;
                probe.latency_ms += self.size;
                if self.is_foreign {
                    probe.force_growth_s_per_m += 20.0 * self.shape[0];
                }
                Some(())
            }
            ClockOffset => {
                rig.grid_late_s += self.size * 1e-3;
                if self.is_foreign {
                    rig.grid_late_wander = 0.1 + 0.3 * self.shape[0];
                }
                Some(())
            }
            LengthWavelength => {
                let laser = &mut rig.plant.length_reference;
                laser.wavelength_error_ppm += self.size;
                if self.is_foreign {
                    laser.wavelength_drift_ppm_per_h += 4.0 * self.size * self.shape[0];
                }
                Some(())
            }
            PlateError | ClockDrift | ProbeLobing | ProbePretravel | LatencyJitter
            | InterpolationError | RotaryLocation | RotaryMotion | RotaryBacklash
            | SpindleGrowth | ColumnBend | AmbientDrift => self.in_own(rig),
        };
        done.ok_or(TrialError::Impossible {
            effect: self.class.id(),
            axis: self.axis,
            size: self.size,
        })
    }

    /// The axis that moves: the last letter.
    pub(crate) fn moving(&self) -> Option<Axis> {
        self.axis
            .get(self.axis.len().checked_sub(1)?..)?
            .parse()
            .ok()
    }

    fn in_drive(&self, rig: &mut Rig) -> Option<()> {
        let drive = rig.plant.linear_drives.get_mut(&self.moving()?)?;
        match self.class {
            Backlash => {
                drive.backlash_um += self.size;
                if self.is_foreign {
                    let stiffness_n_per_um = drive.screw_stiffness_n_per_um[0];
                    let pressed_um = drive.guide_friction.coulomb_n / stiffness_n_per_um;
                    let widest_um = (0.5 * pressed_um * self.size).sqrt(); // (1)
                    drive.backlash_softness_um += (0.3 * self.size).min(widest_um);
                }
            }
            CyclicError => {
                drive.lead_cycle = Some(LeadCycleEntry {
                    once_um: self.size,
                    twice_um: 0.15 * self.size,
                    phase_deg: 360.0 * self.shape[0],
                    per_turn: if self.is_foreign {
                        1.0 + 0.2 * self.shape[1]
                    } else {
                        1.0
                    },
                    growth: if self.is_foreign {
                        0.8 * self.shape[1]
                    } else {
                        0.0
                    },
                });
            }
            ReversalSpike => {
                let friction = &mut drive.motor_friction;
                friction.coulomb_n += self.size;
                let over = if self.is_foreign { 2.0 } else { 1.1 };
                friction.breakaway_n = over * friction.coulomb_n;
            }
            _ => {
                let [up, down] = &mut drive.screw_stiffness_n_per_um;
                let mass_kg = drive.slide_mass_kg;
                let softer = |stiffness: f64| mass_kg / (mass_kg / stiffness + self.size);
                *up = softer(*up);
                if !self.is_foreign {
                    *down = softer(*down);
                }
            }
        }
        Some(())
    }

    fn in_guide(&self, rig: &mut Rig) -> Option<()> {
        let axis = self.moving()?;
        let travel_mm = rig.machine.linear(axis)?.travel_mm;
        let entry = rig.plant.geometry.linear.get_mut(&axis)?;
        let mut form = GuideFormEntry {
            component: self.axis.get(..1)?.parse().ok()?,
            bow_um_urad: self.size,
            wave_um_urad: self.size * (0.8 * self.shape[0] - 0.4),
            dent_um_urad: 0.0,
            dent_at_mm: 0.0,
            dent_width_mm: 25.0,
        };
        if self.class == ScaleError {
            entry.lead_um_per_m += self.size;
            let half_travel_mm = 0.5 * (travel_mm[1] - travel_mm[0]);
            form.bow_um_urad = 0.25 * self.size * half_travel_mm / 1e3;
            form.wave_um_urad = 0.0;
            if self.is_foreign {
                entry.form.push(form);
            }
            return Some(());
        }
        if self.is_foreign {
            form.dent_um_urad = 0.5 * self.size;
            let middle_mm = 0.5 * (travel_mm[0] + travel_mm[1]);
            form.dent_at_mm = middle_mm + 120.0 * (self.shape[1] - 0.5);
        }
        entry.form.push(form);
        Some(())
    }

    /// The signs are those of the catalogue: XY moves X by -a y, XZ X by +a z, YZ Y by -a z.
    fn in_squareness(&self, rig: &mut Rig) -> Option<()> {
        let lean = &mut rig.plant.geometry.squareness_urad;
        let (leaning, towards) = match self.axis {
            "XY" => {
                lean.y_to_x -= self.size;
                (Axis::Y, Axis::X)
            }
            "XZ" => {
                lean.z_to_x += self.size;
                (Axis::Z, Axis::X)
            }
            "YZ" => {
                lean.z_to_y -= self.size;
                (Axis::Z, Axis::Y)
            }
            _ => return None,
        };
        if self.is_foreign {
            let entry = rig.plant.geometry.linear.get_mut(&leaning)?;
            entry.form.push(GuideFormEntry {
                component: towards,
                bow_um_urad: 0.1 * self.size,
                wave_um_urad: 0.0,
                dent_um_urad: 0.0,
                dent_at_mm: 0.0,
                dent_width_mm: 25.0,
            });
        }
        Some(())
    }

    /// A lag of (1 - f) / K that is longer by the size: through f, or where the form is foreign through K.
    fn in_control(&self, rig: &mut Rig) -> Option<()> {
        let entry = rig.control_of(self.moving()?)?;
        let left = 1.0 - entry.velocity_feedforward;
        let lag_s = left / entry.position_gain_per_s + self.size * 1e-3;
        if self.is_foreign {
            // A loop below 8 /s is none that anybody runs: the rest is feed-forward.
            entry.position_gain_per_s = (left / lag_s).max(8.0);
        }
        entry.velocity_feedforward = 1.0 - lag_s * entry.position_gain_per_s;
        (0.0..=1.0)
            .contains(&entry.velocity_feedforward)
            .then_some(())
    }

    fn in_screw(&self, rig: &mut Rig) -> Option<()> {
        let screw = rig.plant.heat.screws.get_mut(&self.moving()?)?;
        screw.nut_torque_n_m += self.size;
        if self.is_foreign {
            screw.bearing_torque_n_m += self.size;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn every_class_can_be_hidden_on_every_axis_and_the_machine_file_does_not_tell() {
        let rig = Rig::draw(&mut Pcg64Mcg::seed_from_u64(4), false).unwrap();
        for class in Class::ALL {
            let ([low, high], _) = class.sizes();
            for axis in class.axes() {
                for is_foreign in [false, true] {
                    for size in [low, high] {
                        let hidden = Hidden {
                            class,
                            axis,
                            size,
                            is_foreign,
                            shape: [0.3, 0.7],
                        };
                        let mut with = rig.clone();
                        hidden.hide(&mut with).unwrap();
                        assert_eq!(with.machine, rig.machine);
                        assert_ne!(with, rig, "{hidden:?}");
                        fake_cnc::Plant::new(&with.control, &with.plant).unwrap();
                    }
                }
            }
        }
    }

    #[test]
    fn a_lag_is_longer_by_its_size() {
        let rig = Rig::draw(&mut Pcg64Mcg::seed_from_u64(5), false).unwrap();
        let lag_ms = |machine: &machine::MachineFile| {
            let entry = machine.linear(Axis::Y).unwrap();
            (1.0 - entry.velocity_feedforward) / entry.position_gain_per_s * 1e3
        };
        for is_foreign in [false, true] {
            let mut with = rig.clone();
            let hidden = Hidden {
                class: ServoLag,
                axis: "Y",
                size: 0.4,
                is_foreign,
                shape: [0.0; 2],
            };
            hidden.hide(&mut with).unwrap();
            assert!((lag_ms(&with.control) - lag_ms(&rig.machine) - 0.4).abs() < 1e-12);
        }
    }
}
